//! `chefshat token`, and what a server does with tokens when it starts.

use super::run::chefshat;

#[test]
fn a_token_is_created_listed_and_revoked() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = |words: &[&str]| {
        let dir = folder.path().to_str().expect("a path");
        let mut all = vec!["token"];
        all.extend(words);
        all.extend(["--data-dir", dir]);
        chefshat(&all)
    };
    token(&["list"]).clean().assert_says(&["no tokens"]);
    let created = token(&[
        "create",
        "--role",
        "host",
        "--label",
        "Ana",
        "--expires",
        "30d",
    ])
    .well();
    let text = created.stdout.trim();
    let id = &text["chefshat_".len()..][..8];
    assert_eq!(text.len(), 61, "{text}");
    let link = token(&[
        "create",
        "--role",
        "player",
        "--link",
        "https://chef.example.org",
    ])
    .well();
    assert!(
        link.stdout
            .starts_with("https://chef.example.org#token=chefshat_"),
        "{link:?}"
    );
    let list = token(&["list"]).clean();
    list.assert_says(&[
        id,
        "host",
        "Ana",
        "29 days",
        "player",
        "until revoked",
        "everything",
    ]);
    assert!(!list.stdout.contains(&text[18..]), "{list:?}");
    list.assert_table_fits(3);
    let line = &token(&["list", "--json"]).clean().json()["tokens"][0];
    assert_eq!(
        (line["id"].as_str(), line["role"].as_str()),
        (Some(id), Some("host"))
    );
    token(&["revoke", id]).clean().assert_says(&["revoked", id]);
    token(&["revoke", id]).assert_refused("unknown token");
    token(&["create", "--role", "king"]).assert_refused("use spectator, player, host or admin");
    token(&["create", "--role", "host", "--expires", "30"]).assert_refused("90m, 12h or 30d");
}

#[test]
fn an_open_server_is_refused_where_others_reach_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let dir = folder.path().to_str().expect("a path");
    let serve = ["serve", "--listen", "0.0.0.0:0", "--data-dir", dir];
    chefshat(&serve).assert_refused("without tokens");
    let without_folder = [
        "serve",
        "--listen",
        "127.0.0.1:0",
        "--no-records",
        "--access",
        "tokens",
    ];
    chefshat(&without_folder).assert_refused("--access tokens needs a data directory");
}
