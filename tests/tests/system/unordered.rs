//! A data directory of a version that wrote the keys of annotations in no order: it opens, what is
//! unfinished resumes and is signed so that it verifies, and what was signed is shown where that can
//! still be found.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, RandomAgent};
use chefshat_proto::v1;
use chefshat_record::signature::PublicKey;
use chefshat_record::{jsonl, replay};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::signing::key_or_new;
use chefshat_server::store::SqliteStore;
use chefshat_tests::patiently;
use serde_json::Value;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures/unordered")
        .join(name)
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

/// The record of a game, which is the same whenever it is read.
async fn record(client: &Client, game_id: &str) -> Vec<v1::RecordLine> {
    let written = |lines: &[v1::RecordLine]| {
        let lines = lines.iter().map(serde_json::to_string);
        lines.collect::<Result<Vec<_>, _>>().expect("JSON")
    };
    let lines = client.record(game_id).await.expect("a record");
    for _ in 0..4 {
        let again = client.record(game_id).await.expect("a record");
        assert_eq!(written(&again), written(&lines));
    }
    lines
}

#[tokio::test(flavor = "multi_thread")]
async fn a_data_directory_without_an_order_of_keys_resumes_and_verifies() {
    let known = std::fs::read_to_string(fixture("known.json")).expect("the fixture");
    let known: Value = serde_json::from_str(&known).expect("JSON");
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["games.sqlite3", "signing-key"] {
        std::fs::copy(fixture(name), folder.path().join(name)).expect("copied");
    }
    let secret = folder.path().join("signing-key");
    let private: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o600);
    std::fs::set_permissions(&secret, private).expect("its owner");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    let key = key_or_new(folder.path()).expect("the key");
    let config = ServerConfig {
        data_dir: Some(folder.path().to_path_buf()),
        grace: Duration::ZERO,
        signing_key: Some(Arc::new(key)),
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::new(store)).await;
    let host = host.expect("a free port");
    let client = Client::connect(host.url()).await.expect("it listens");
    let key: PublicKey = text(&known["key"]).parse().expect("a key");
    for (name, signed_by, uncheckable) in [
        ("ordinary", Some(key), None),
        ("small", Some(key), None),
        ("large", None, Some(key)),
    ] {
        let lines = record(&client, &text(&known[name])).await;
        let replayed = replay::replay(&lines).expect("it replays");
        assert_eq!(replayed.signed_by, signed_by, "{name}");
        assert_eq!(replayed.uncheckable, uncheckable, "{name}");
    }
    // The seat of the language model, which has annotated three decisions with three keys each.
    let unfinished = &known["unfinished"];
    let ticket = text(&unfinished["ticket"]);
    let playing = client.play_many([(ticket, RandomAgent::new(1))]);
    for outcome in patiently("the game to end", playing).await {
        assert_eq!(outcome.expect("it is played").aborted(), None);
    }
    let game = text(&unfinished["game_id"]);
    let lines = record(&client, &game).await;
    let replayed = replay::replay(&lines).expect("it replays");
    assert_eq!(replayed.signed_by, Some(key));
    patiently("the server to stop", host.stop())
        .await
        .expect("a clean end");
    let file = jsonl::read_record(&jsonl::path_of(folder.path(), &game)).expect("a file");
    let replayed = replay::walk_file(&file, |_| {}).expect("it replays");
    assert_eq!(replayed.signed_by, Some(key));
    assert!(file.lines == lines);
}
