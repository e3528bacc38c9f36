//! A database written by an earlier version: it opens, what is unfinished resumes, and all records
//! are as that version wrote them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, RandomAgent};
use chefshat_proto::v1;
use chefshat_record::{jsonl, replay};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::SqliteStore;
use chefshat_tests::{patiently, random_agents};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures/database")
        .join(name)
}

/// The expected content of the fixture.
fn known() -> Value {
    let text = std::fs::read_to_string(fixture("known.json")).expect("the fixture");
    serde_json::from_str(&text).expect("JSON")
}

fn texts(list: &Value) -> Vec<String> {
    let list = list.as_array().expect("a list").iter();
    list.map(text).collect()
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

async fn start(data_dir: &Path) -> Host {
    let store = SqliteStore::open(data_dir).await.expect("a store");
    let config = ServerConfig {
        data_dir: Some(data_dir.to_path_buf()),
        grace: Duration::ZERO,
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::new(store)).await;
    host.expect("a free port")
}

/// The record of a game, replayed without an error, as the text of its file.
async fn verified(client: &Client, game_id: &str, folder: &Path) -> (v1::RoomState, Vec<u8>) {
    let lines = client.record(game_id).await;
    let lines = lines.unwrap_or_else(|error| panic!("{game_id}: {error}"));
    let replayed = replay::replay(&lines).unwrap_or_else(|error| panic!("{game_id}: {error}"));
    let path = folder.join(game_id);
    jsonl::write(&path, &lines).expect("a record file");
    (replayed.state, std::fs::read(path).expect("it exists"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_of_an_earlier_version_resumes_and_verifies() {
    let known = known();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = tempfile::tempdir().expect("a temporary folder");
    std::fs::copy(
        fixture("games.sqlite3"),
        folder.path().join("games.sqlite3"),
    )
    .expect("copied");
    let host = start(folder.path()).await;
    let client = Client::connect(host.url())
        .await
        .expect("the server listens");

    // Records of finished games are byte for byte what that version wrote.
    let records: BTreeMap<String, Value> =
        serde_json::from_value(known["records"].clone()).expect("an object");
    for (game_id, hash) in &records {
        let (_, bytes) = verified(&client, game_id, files.path()).await;
        assert_eq!(hex::encode(Sha256::digest(bytes)), text(hash), "{game_id}");
    }
    for game_id in texts(&known["aborted"]) {
        let (state, _) = verified(&client, &game_id, files.path()).await;
        assert_eq!(state, v1::RoomState::Aborted);
    }

    // Unfinished games resume and are played to the end with the tickets of their seats.
    let unfinished = known["unfinished"].as_array().expect("a list");
    for game in unfinished {
        let room = client.get_room(text(&game["room_id"])).await;
        let room = room.expect("the room has resumed");
        assert_eq!(room.state(), v1::RoomState::Playing, "{}", game["name"]);
        let playing = client.play_many(random_agents(texts(&game["tickets"])));
        for outcome in patiently("the game to end", playing).await {
            let outcome = outcome.unwrap_or_else(|error| panic!("{}: {error}", game["name"]));
            assert_eq!(outcome.aborted(), None, "{}", game["name"]);
        }
        let (state, _) = verified(&client, &text(&game["game_id"]), files.path()).await;
        assert_eq!(state, v1::RoomState::Finished, "{}", game["name"]);
    }

    // A finished tournament exists; an unfinished one continues to its end with its participants.
    let tournaments = known["tournaments"].as_array().expect("a list");
    for tournament in tournaments {
        let id = text(&tournament["tournament_id"]);
        let tickets = texts(&tournament["tickets"]).into_iter().zip(0..);
        let playing = tickets.map(|(ticket, seed)| {
            let client = client.clone();
            async move {
                let agents = |_: &v1::Attached| RandomAgent::new(seed);
                client.play_tournament(ticket, agents).await
            }
        });
        let played = patiently("the tournament", futures::future::join_all(playing)).await;
        for outcome in played {
            outcome.expect("the participant has played to the end");
        }
        let results = client.tournament_results(id.clone()).await.expect("known");
        let state = results.tournament.expect("a tournament").state();
        assert_eq!(state, v1::TournamentState::Finished, "{id}");
        let games = client
            .tournament_games(v1::ListTournamentGamesRequest {
                tournament_id: id,
                ..Default::default()
            })
            .await
            .expect("known");
        assert!(!games.games.is_empty());
        for game in games.games {
            let (state, _) = verified(&client, &game.game_id, files.path()).await;
            assert_eq!(state, v1::RoomState::Finished);
        }
    }

    patiently("the server to stop", host.stop())
        .await
        .expect("a clean end");
}
