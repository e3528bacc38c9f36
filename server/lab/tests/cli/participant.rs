//! `chefshat participant` on the data folder of a server and on a running one: exports, what
//! remains after a deletion, and refusals.

use std::path::Path;

use chefshat_client::{ActionId, Agent, Client, RandomAgent, v1};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::import::TRANSCRIPT;
use super::run::{
    Ended, chefshat, in_runtime, json_lines, run, serve, serve_with, until, until_recorded,
};

/// The participant. Letters beyond ASCII test that names are compared as text.
const NAME: &str = "Rosa Müßig";
const OTHER: &str = "Bruno";

/// Takes the first legal action and annotates each decision.
struct Talker(RandomAgent, String);

impl Agent for Talker {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.0.decide(request)
    }

    fn annotate(&mut self) -> Option<v1::Annotations> {
        Some(v1::Annotations {
            extra: [("said".to_owned(), self.1.clone())].into(),
            ..v1::Annotations::default()
        })
    }
}

fn one_shift() -> Option<v1::RuleSet> {
    Some(v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(1)),
        ..v1::RuleSet::default()
    })
}

fn expression(label: &str, record_only: bool) -> v1::Expression {
    v1::Expression {
        label: label.to_owned(),
        record_only,
        ..v1::Expression::default()
    }
}

/// Plays a game of two participants, which both send expressions, and two built-in agents. Returns
/// its id.
async fn play_game(client: &Client) -> String {
    let built_in = || v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    let made = client
        .create_room(v1::CreateRoomRequest {
            name: format!("{NAME}’s table"),
            rules: one_shift(),
            seats: vec![
                v1::SeatConfig::default(),
                built_in(),
                v1::SeatConfig::default(),
                built_in(),
            ],
            ..v1::CreateRoomRequest::default()
        })
        .await
        .unwrap();
    let mut seats = Vec::new();
    for name in [NAME, OTHER] {
        let joined = client.join_with_code(made.join_code.as_str(), name).await;
        let ticket = joined.unwrap().ticket;
        for record_only in [false, true] {
            let label = format!("as {name}");
            let shown = client.express(ticket.as_str(), expression(&label, record_only));
            shown.await.unwrap();
        }
        let said = format!("said by {name}");
        seats.push((ticket, Talker(RandomAgent::new(7), said)));
    }
    for outcome in client.play_many(seats).await {
        outcome.unwrap();
    }
    made.room.unwrap().game_id
}

async fn play_tournament(client: &Client) {
    let made = client
        .create_tournament(v1::TournamentSettings {
            name: "friday".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 1,
            rules: one_shift(),
            built_in_agents: vec!["random".into(); 3],
            start_when_joined: 4,
            ..v1::TournamentSettings::default()
        })
        .await
        .unwrap();
    let request = v1::JoinTournamentRequest {
        join_code: made.join_code,
        name: NAME.into(),
        ..v1::JoinTournamentRequest::default()
    };
    let ticket = client.join_tournament(request).await.unwrap().ticket;
    let played = client.play_tournament(ticket, |_| RandomAgent::new(7));
    assert_eq!(played.await.unwrap().len(), 1);
}

fn participant(arguments: &[&str], data_dir: &Path) -> Ended {
    let data_dir = data_dir.to_str().unwrap();
    chefshat(&[&["participant"], arguments, &["--data-dir", data_dir]].concat())
}

fn verify(data_dir: &Path) -> Ended {
    chefshat(&["verify", "--data-dir", data_dir.to_str().unwrap()]).well()
}

/// Asserts that no file in a folder contains a text.
fn assert_nowhere(folder: &Path, text: &str) -> usize {
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files += assert_nowhere(&path, text);
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        let found = bytes
            .windows(text.len())
            .any(|part| part == text.as_bytes());
        assert!(!found, "{text} stands in {}", path.display());
        files += 1;
    }
    files
}

#[test]
fn a_participant_is_exported_and_deleted_and_every_record_still_verifies() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().join("data");
    let (server, url) = serve(&data_dir);
    let game_id = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let game_id = play_game(&client).await;
        play_tournament(&client).await;
        game_id
    });
    until_recorded(2, &data_dir);
    // A running server locks the folder.
    let refused = participant(&["delete", NAME, "--yes"], &data_dir);
    refused.assert_refused("another chefshat server uses");
    drop(server);

    let out = folder.path().join("out.jsonl");
    let export = ["export", NAME, "--out", out.to_str().unwrap(), "--json"];
    let printed = participant(&export, &data_dir).well().json();
    assert_eq!(
        (
            &printed["games"],
            &printed["tournaments"],
            &printed["expressions"]
        ),
        (&json!(2), &json!(1), &json!(2))
    );
    check_export(&std::fs::read_to_string(&out).unwrap(), &game_id, &printed);
    participant(&export, &data_dir).assert_refused("exists already");

    participant(&["delete", NAME], &data_dir).assert_refused("confirm with --yes");
    let deleted = participant(&["delete", NAME, "--yes", "--json"], &data_dir);
    let deleted = deleted.well().json();
    let pseudonym = deleted["pseudonym"].as_str().unwrap();
    assert!(pseudonym.starts_with("deleted participant "), "{pseudonym}");
    assert_eq!(
        (&deleted["games"], &deleted["tournaments"]),
        (&json!(2), &json!(1))
    );
    assert_eq!(
        (&deleted["expressions"], &deleted["annotations"]),
        (&json!(2), &exported_annotations(&out))
    );
    assert!(assert_nowhere(&data_dir, NAME) > 2);
    verify(&data_dir);
    check_remaining(&data_dir, &game_id, pseudonym);

    let again = participant(&["delete", NAME, "--yes"], &data_dir);
    again.assert_failed("nothing is stored");
}

#[test]
fn a_participant_is_exported_and_deleted_while_the_server_runs() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().join("data");
    let dir = data_dir.to_str().unwrap();
    let token = chefshat(&["token", "create", "--role", "admin", "--data-dir", dir]);
    let token = token.well().stdout.trim().to_owned();
    let (server, url) = serve_with(&data_dir, &["--access", "open"]);
    let on_server = |arguments: &[&str]| {
        let place = ["--server", &url, "--token", &token];
        chefshat(&[&["participant"], arguments, &place].concat())
    };
    let out = folder.path().join("out.jsonl");
    let export = ["export", NAME, "--out", out.to_str().unwrap(), "--json"];
    let delete = ["delete", NAME, "--yes", "--json"];
    on_server(&export).assert_failed("nothing is stored under this name");
    assert!(!out.exists());
    let nothing = on_server(&delete);
    assert_eq!(
        (nothing.code, &nothing.json()["games"]),
        (Some(1), &json!(0))
    );

    let (game_id, room_id) = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let game_id = play_game(&client).await;
        play_tournament(&client).await;
        let made = client.create_room(v1::CreateRoomRequest::default()).await;
        let made = made.unwrap();
        client.join_with_code(made.join_code, NAME).await.unwrap();
        (game_id, made.room.unwrap().room_id)
    });
    until_recorded(2, &data_dir);
    on_server(&delete).assert_failed("a game that is not over; nothing was changed");
    let close = [
        "admin", "close", "room", &room_id, "--server", &url, "--token", &token,
    ];
    chefshat(&close).well();

    let told = on_server(&export).well().json();
    check_export(&std::fs::read_to_string(&out).unwrap(), &game_id, &told);
    on_server(&["delete", NAME]).assert_refused("confirm with --yes");
    let refused = ["participant", "delete", NAME, "--yes", "--server", &url];
    chefshat(&refused).assert_failed("token");
    let deleted = on_server(&delete).well().json();
    let pseudonym = deleted["pseudonym"].as_str().unwrap();
    assert_eq!(deleted["tournaments"], json!(1));
    assert!(deleted["games"].as_u64() >= Some(2), "{deleted}");
    assert_eq!(deleted["annotations"], exported_annotations(&out));

    // Nothing that the server shows has the name any more.
    in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let rooms = client.list_rooms(v1::ListRoomsRequest::default()).await;
        let tournaments = client
            .list_tournaments(v1::ListTournamentsRequest::default())
            .await
            .unwrap();
        let id = tournaments.tournaments[0].tournament_id.clone();
        let shown = [
            format!("{:?}", rooms.unwrap()),
            format!("{:?}", client.record(&game_id).await.unwrap()),
            format!("{:?}", client.tournament(id.as_str()).await.unwrap()),
        ];
        for text in &shown {
            assert!(!text.contains(NAME), "{text}");
        }
        assert!(shown[1].contains(pseudonym) && shown[2].contains(pseudonym));
    });
    let board = run(&url, "leaderboard --json").well();
    assert!(!board.stdout.contains(NAME), "{}", board.stdout);
    let nothing = on_server(&delete);
    assert_eq!(
        (nothing.code, &nothing.json()["games"]),
        (Some(1), &json!(0))
    );
    drop(server);
    assert!(assert_nowhere(&data_dir, NAME) > 2);
    verify(&data_dir);
}

/// The export has all data of the participant and none of the other.
fn check_export(text: &str, game_id: &str, printed: &Value) {
    let lines = json_lines(text);
    assert_eq!(lines[0]["participant"]["name"], NAME);
    let of =
        |key: &str| -> Vec<&Value> { lines.iter().filter(|line| !line[key].is_null()).collect() };
    assert_eq!(of("game").len(), 2);
    assert_eq!(of("tournament")[0]["tournament"]["name"], "friday");
    assert_eq!(of("expression").len(), 2);
    assert_eq!(json!(of("decision").len()), printed["decisions"]);
    let of_game: Vec<&Value> = (of("decision").into_iter())
        .filter(|line| line["gameId"] == game_id)
        .collect();
    assert!(of_game.len() > 3);
    for line in of_game {
        let said = &line["decision"]["annotations"]["extra"]["said"];
        assert_eq!(said, &format!("said by {NAME}"));
    }
    assert!(!text.contains(OTHER));
}

fn exported_annotations(out: &Path) -> Value {
    let lines = json_lines(&std::fs::read_to_string(out).unwrap());
    let annotated = |line: &&Value| !line["decision"]["annotations"].is_null();
    json!(lines.iter().filter(annotated).count())
}

/// The data of the other participant remain, and the file agrees with the server's database.
fn check_remaining(data_dir: &Path, game_id: &str, pseudonym: &str) {
    let path = data_dir.join("records").join(format!("{game_id}.jsonl"));
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(&format!("as {OTHER}")));
    assert!(text.contains(&format!("said by {OTHER}")));
    assert!(text.contains(&format!("{pseudonym}’s table")));
    let file = json_lines(&text);
    let (_server, url) = serve(data_dir);
    let (record, rated) = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let record = client.record(game_id).await.unwrap();
        let tournaments = client
            .list_tournaments(v1::ListTournamentsRequest::default())
            .await;
        let id = &tournaments.unwrap().tournaments[0].tournament_id;
        (record, client.tournament(id.as_str()).await.unwrap())
    });
    let held: Vec<Value> = (record.iter())
        .map(|line| serde_json::to_value(line).unwrap())
        .collect();
    assert_eq!(file, held);
    let names: Vec<&str> = (rated.participants.iter())
        .map(|participant| participant.name.as_str())
        .collect();
    assert!(names.contains(&pseudonym), "{names:?}");
}

#[test]
fn unfinished_games_and_tournaments_prevent_a_deletion() {
    let folder = TempDir::new().unwrap();
    let (server, url) = serve(folder.path());
    let room_id = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let made = client.create_room(v1::CreateRoomRequest::default()).await;
        let made = made.unwrap();
        client.join_with_code(made.join_code, NAME).await.unwrap();
        let settings = v1::TournamentSettings {
            name: "friday".into(),
            format: v1::TournamentFormat::Swiss.into(),
            ..v1::TournamentSettings::default()
        };
        let tournament = client.create_tournament(settings).await.unwrap();
        let request = v1::JoinTournamentRequest {
            join_code: tournament.join_code,
            name: OTHER.into(),
            ..v1::JoinTournamentRequest::default()
        };
        client.join_tournament(request).await.unwrap();
        made.room.unwrap().room_id
    });
    drop(server);
    let refused = participant(&["delete", NAME, "--yes"], folder.path());
    refused.assert_refused("a game that is not over");
    let refused = participant(&["delete", OTHER, "--yes"], folder.path());
    refused.assert_refused("a tournament that is not over");

    // Nothing has changed.
    let (_server, url) = serve(folder.path());
    let (room, tournaments) = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let request = v1::ListTournamentsRequest::default();
        let tournaments = client.list_tournaments(request).await.unwrap().tournaments;
        let tournament = client.tournament(tournaments[0].tournament_id.as_str());
        (
            client.get_room(room_id).await.unwrap(),
            tournament.await.unwrap(),
        )
    });
    assert_eq!(room.seats[0].name, NAME);
    assert_eq!(tournaments.participants[0].name, OTHER);
}

/// Writes the record of a real table with Ana to a data folder. Returns the file and the id of the
/// game.
fn real_table(data_dir: &Path) -> (String, String) {
    let folder = TempDir::new().unwrap();
    let transcript = folder.path().join("table.csv");
    std::fs::write(&transcript, TRANSCRIPT).unwrap();
    let import = ["import", transcript.to_str().unwrap(), "--json"];
    let printed = chefshat(&[&import[..], &["--data-dir", data_dir.to_str().unwrap()]].concat());
    let printed = printed.well().json();
    let text = |key: &str| printed[key].as_str().unwrap().to_owned();
    (text("file"), text("game_id"))
}

#[test]
fn a_damaged_file_is_reported_if_it_contains_the_name() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().join("data");
    let (file, _) = real_table(&data_dir);
    let records = data_dir.join("records");
    // A damaged record may contain the name in escaped form.
    std::fs::write(records.join("0-foreign.jsonl"), "{\"broken\": \"\\u0041").unwrap();
    let out = folder.path().join("ana.jsonl");
    let export = ["export", "Ana", "--out", out.to_str().unwrap(), "--force"];
    let exported = participant(&export, &data_dir).well();
    assert!(
        exported.stderr.contains("0-foreign.jsonl"),
        "{}",
        exported.stderr
    );

    let damaged = records.join("1-damaged.jsonl");
    std::fs::write(&damaged, "{\"name\": \"Ana\"").unwrap();
    std::fs::remove_file(&out).unwrap();
    let delete = ["delete", "Ana", "--yes", "--json"];
    for command in [&export[..], &delete[..]] {
        let ended = participant(command, &data_dir);
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(
            ended.stderr.contains("done, except for files that contain"),
            "{ended:?}"
        );
        assert!(ended.stderr.contains("1-damaged.jsonl"), "{ended:?}");
        assert!(!ended.stdout.is_empty(), "{ended:?}");
    }
    let exported = json_lines(&std::fs::read_to_string(&out).unwrap());
    assert_eq!(exported[0]["participant"]["name"], "Ana");
    assert!(exported.len() > 2);
    let rewritten = std::fs::read_to_string(&file).unwrap();
    assert!(!rewritten.contains("\"Ana\"") && rewritten.contains("deleted participant"));

    std::fs::remove_file(&damaged).unwrap();
    let again = participant(&delete[..3], &data_dir);
    again.assert_failed("nothing is stored");
}

#[test]
fn a_player_of_a_real_table_is_deleted_from_the_file_and_the_database() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().join("data");
    let (file, game_id) = real_table(&data_dir);
    let (server, url) = serve_with(&data_dir, &["--allow-import"]);
    run(&url, &format!("records import {file}")).well();
    drop(server);
    let before = std::fs::read(&file).unwrap();

    let deleted = participant(&["delete", "Ana", "--yes", "--json"], &data_dir);
    let deleted = deleted.well().json();
    assert_eq!(
        (&deleted["games"], &deleted["files"]),
        (&json!(1), &json!(1))
    );
    assert_nowhere(&data_dir, "\"Ana\"");
    verify(&data_dir);
    let names = |text: &str| -> Vec<Value> {
        let seats = json_lines(text)[0]["header"]["seats"].clone();
        let seats = seats.as_array().unwrap();
        seats.iter().map(|seat| seat["name"].clone()).collect()
    };
    let expected = [deleted["pseudonym"].clone(), json!("Pepper")];
    let rewritten = std::fs::read_to_string(&file).unwrap();
    assert_eq!(names(&rewritten), expected);

    // As after a run that was interrupted between the database and the files: the next run uses the
    // pseudonym from the database.
    std::fs::write(&file, before).unwrap();
    let again = participant(&["delete", "Ana", "--yes", "--json"], &data_dir);
    let again = again.well().json();
    assert_eq!(again["pseudonym"], deleted["pseudonym"]);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), rewritten);
    let (_server, url) = serve(&data_dir);
    let got = run(&url, &format!("records get {game_id}"));
    assert_eq!(names(&got.stdout), expected);
}

#[test]
fn a_missing_folder_is_not_created() {
    let folder = TempDir::new().unwrap();
    let missing = folder.path().join("missing");
    participant(&["delete", NAME, "--yes"], &missing).assert_refused("there is no data directory");
    assert!(!missing.exists());
    // Empty seats have this name.
    participant(&["delete", "", "--yes"], folder.path()).assert_refused("a value is required");
    chefshat(&["participant", "delete", "--help"]).assert_helps("chefshat participant delete P07");
    chefshat(&["participant", "export", "--help"]).assert_helps("chefshat participant export P07");
}

#[test]
fn of_those_who_share_a_name_only_the_one_meant_is_exported_and_deleted() {
    let folder = TempDir::new().unwrap();
    let data_dir = folder.path().join("data");
    let (server, url) = serve(&data_dir);
    let (fingerprint, game_id) = in_runtime(async {
        let client = Client::connect(&url).await.unwrap();
        let made = client
            .create_room(v1::CreateRoomRequest {
                rules: one_shift(),
                ..v1::CreateRoomRequest::default()
            })
            .await
            .unwrap();
        let mut seats = Vec::new();
        let mut fingerprint = String::new();
        // Two of one name, and one who was there before the game and left.
        let key: &[u8] = &[7; 32];
        for (name, key) in [
            (NAME, key),
            (NAME, &[][..]),
            (NAME, key),
            (OTHER, &[]),
            (OTHER, &[]),
        ] {
            let request = v1::JoinRoomRequest {
                join_code: made.join_code.clone(),
                name: name.into(),
                name_key: key.into(),
                ..v1::JoinRoomRequest::default()
            };
            let joined = client.join(request).await.unwrap();
            let seat = joined.seat as usize;
            if fingerprint.is_empty() {
                fingerprint = joined.room.unwrap().seats[seat].name_fingerprint.clone();
                client.leave_room(joined.ticket).await.unwrap();
            } else {
                seats.push((joined.ticket, RandomAgent::new(7)));
            }
        }
        for outcome in client.play_many(seats).await {
            outcome.unwrap();
        }
        (fingerprint, made.room.unwrap().game_id)
    });
    let record = data_dir.join("records").join(format!("{game_id}.jsonl"));
    until("the record", || record.exists());
    drop(server);
    let out = folder.path().join("out.jsonl");
    let out = out.to_str().unwrap();
    let export = |fingerprint: &str| {
        let arguments = [
            "export",
            NAME,
            "--out",
            out,
            "--force",
            "--json",
            "--fingerprint",
            fingerprint,
        ];
        participant(&arguments, &data_dir)
    };
    let seats = |fingerprint: &str| -> Vec<Value> {
        export(fingerprint).well();
        let text = std::fs::read_to_string(out).unwrap();
        let lines = json_lines(&text);
        let games = lines.iter().filter(|line| line.get("game").is_some());
        games.map(|line| line["game"]["seats"].clone()).collect()
    };
    for (fingerprint, shown) in [
        (fingerprint.as_str(), json!(fingerprint)),
        ("none", Value::Null),
    ] {
        let [seats] = &seats(fingerprint)[..] else {
            panic!("one game");
        };
        assert_eq!(seats.as_array().map(Vec::len), Some(1));
        assert_eq!(seats[0]["nameFingerprint"], shown);
    }
    export("eff42f032b0bc531").assert_failed("nothing is stored");
    export("eff4").assert_refused("give 16 hexadecimal digits");

    let delete = |fingerprint: &str| {
        participant(
            &[
                "delete",
                NAME,
                "--yes",
                "--json",
                "--fingerprint",
                fingerprint,
            ],
            &data_dir,
        )
    };
    let deleted = delete(&fingerprint).well().json();
    assert_eq!(
        (&deleted["games"], &deleted["files"]),
        (&json!(1), &json!(1))
    );
    verify(&data_dir);
    assert_nowhere(&data_dir, &fingerprint);
    export(&fingerprint).assert_failed("nothing is stored");
    assert_eq!(seats("none").len(), 1, "the other is still there");
    delete("none").well();
    verify(&data_dir);
    assert_nowhere(&data_dir, NAME);
}
