//! Commands that connect: TLS with a private authority, tokens, and what is said when they are
//! missing.

use super::run::{chefshat, fixture, run, serve_with};

#[test]
fn commands_connect_with_tls_and_a_token() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().to_str().unwrap();
    let create = ["token", "create", "--role", "host", "--data-dir", dir];
    let token = chefshat(&create).well().stdout.trim().to_owned();
    let [ca, key] = ["tls/localhost.pem", "tls/localhost.key"].map(fixture);
    let [ca, key] = [ca.to_str().unwrap(), key.to_str().unwrap()];
    let tls = ["--tls-cert", ca, "--tls-key", key];
    let (_server, url) = serve_with(folder.path(), &tls);
    let url = url.replace("http://", "https://");

    run(&url, &format!("room list --token {token} --ca {ca}")).clean();
    let created = run(
        &url,
        &format!("room create --json --token {token} --ca {ca}"),
    );
    assert!(!created.clean().stdout.contains(&token));

    let missing = run(&url, &format!("room list --ca {ca}"));
    missing.assert_failed("CHEFSHAT_TOKEN");
    let unknown = format!("chefshat_00000000_{}", "A".repeat(43));
    let refused = run(&url, &format!("room list --token {unknown} --ca {ca}"));
    refused.assert_failed("does not know this token");
    assert!(!refused.stderr.contains(&unknown), "{refused:?}");
    run(&url, &format!("room list --token {token}")).assert_failed("CHEFSHAT_CA");
    run(&url, "room list --ca no-such-file").assert_failed("no-such-file");
}
