//! Commands that connect: TLS with a private authority, tokens, and what is said when they are
//! missing.

use super::run::{Ended, chefshat, fixture, program, run, serve_with, typed};

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

#[test]
fn a_token_that_others_can_read_on_the_way_is_warned_of() {
    // Nobody listens there: the warning comes before the connection.
    let list = |address: &str| typed(&format!("room list --token t --server {address}")).stderr;
    let warning = "the token is sent unencrypted to 0.0.0.0; use https://0.0.0.0";
    let elsewhere = list("http://0.0.0.0:1");
    assert_eq!(elsewhere.matches(warning).count(), 1, "{elsewhere}");
    for safe in ["http://127.0.0.1:1", "https://0.0.0.0:1"] {
        let said = list(safe);
        assert!(!said.contains("unencrypted"), "{said}");
    }
}

#[test]
fn what_is_typed_counts_more_than_a_variable() {
    // This address is refused at once; before that, a variable would conflict with a flag.
    let refused = "is not the address of a server";
    let terminal = "needs an interactive terminal";
    for (line, expected) in [
        ("agent greedy --code C --server x://y", refused),
        ("agent greedy --server x://y", refused),
        (
            "tournament join --agent greedy --code C --server x://y",
            refused,
        ),
        ("play --code C", terminal),
        ("play --local", terminal),
        ("play --ticket T", terminal),
        ("mcp --listen 192.0.2.1:1", "192.0.2.1:1"),
    ] {
        let mut command = program();
        command.args(line.split_whitespace());
        command
            .env("CHEFSHAT_TICKET", "T")
            .env("CHEFSHAT_NAME", "Ada");
        Ended::of(command.output().unwrap()).assert_refused(expected);
    }
    let mut without = program();
    without.args(["agent", "greedy"]).env("CHEFSHAT_TICKET", "");
    let ended = Ended::of(without.output().unwrap());
    ended.assert_refused("--code");
    assert_eq!(ended.code, Some(2), "{ended:?}");
}
