//! `chefshat mcp` as a client sees it byte by byte: all revisions of the Model Context Protocol, no
//! ticket, mistakes of a model, seats that are given back.

use chefshat_client::{RandomAgent, v1};
use chefshat_tests::{TestServer, one_shift, patiently};
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{Child, ChildStdin, ChildStdout};

use crate::mcp::{decision, options, program, record_of, room};

/// The program on lines of JSON, to see everything that it writes.
struct Raw {
    child: Child,
    input: ChildStdin,
    output: Lines<BufReader<ChildStdout>>,
    written: String,
    calls: u64,
}

impl Raw {
    fn start(mut child: Child) -> Self {
        let input = child.stdin.take().expect("a pipe");
        let output = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        Self {
            child,
            input,
            output,
            written: String::new(),
            calls: 0,
        }
    }

    async fn send(&mut self, message: &Value) {
        let line = format!("{message}\n");
        self.input
            .write_all(line.as_bytes())
            .await
            .expect("the program reads");
    }

    async fn call(&mut self, method: &str, params: Value) -> Value {
        self.calls += 1;
        let id = self.calls;
        self.send(&json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params}))
            .await;
        loop {
            let line = patiently(method, self.output.next_line())
                .await
                .expect("text");
            let line = line.expect("the program answers");
            self.written.push_str(&line);
            let message: Value = serde_json::from_str(&line).expect("a JSON line");
            if message["id"] == json!(id) {
                return message;
            }
        }
    }

    /// Begins as clients of older revisions do; returns the revision agreed on.
    async fn initialize(&mut self, version: &str) -> String {
        let client = json!({"name": "test", "version": "1"});
        let params = json!({"protocolVersion": version, "capabilities": {}, "clientInfo": client});
        let answer = self.call("initialize", params).await;
        let notification = json!({"jsonrpc": "2.0", "method": "notifications/initialized"});
        self.send(&notification).await;
        answer["result"]["protocolVersion"]
            .as_str()
            .expect("a revision")
            .to_owned()
    }

    async fn tool(&mut self, name: &str, arguments: Value) -> (String, bool) {
        let answer = self
            .call("tools/call", json!({"name": name, "arguments": arguments}))
            .await;
        let result = &answer["result"];
        let text = result["content"][0]["text"].as_str();
        let text = text
            .unwrap_or_else(|| panic!("no text: {answer}"))
            .to_owned();
        (text, result["isError"] == json!(true))
    }

    async fn stop(mut self) -> String {
        drop(self.input);
        let status = patiently("the program to end", self.child.wait()).await;
        assert!(status.expect("a child").success());
        self.written
    }
}

#[tokio::test]
async fn clients_of_all_revisions_are_understood() {
    let server = TestServer::start().await;
    let oldest_to_newest = ["2024-11-05", "2025-03-26", "2025-06-18", "2025-11-25"];
    for version in oldest_to_newest {
        let mut raw = Raw::start(program(&server, &[], None));
        assert_eq!(raw.initialize(version).await, version);
        let tools = raw.call("tools/list", json!({})).await;
        assert_eq!(tools["result"]["tools"].as_array().map(Vec::len), Some(8));
        let (rooms, error) = raw.tool("list_rooms", json!({})).await;
        assert_eq!((rooms.as_str(), error), ("No rooms.", false));
        raw.stop().await;
    }
    // One that this program does not know: it answers with the newest that it has with a handshake.
    let mut raw = Raw::start(program(&server, &[], None));
    assert_eq!(raw.initialize("1999-01-01").await, "2025-11-25");
    raw.stop().await;
    // A client that ends before it has asked anything is no failure.
    Raw::start(program(&server, &[], None)).stop().await;
    // The current one needs no handshake: each request stands alone.
    let mut raw = Raw::start(program(&server, &[], None));
    let meta = json!({
        "io.modelcontextprotocol/protocolVersion": "2026-07-28",
        "io.modelcontextprotocol/clientInfo": {"name": "test", "version": "1"},
        "io.modelcontextprotocol/clientCapabilities": {},
    });
    let discovered = raw.call("server/discover", json!({"_meta": meta})).await;
    let versions = discovered["result"]["supportedVersions"]
        .as_array()
        .expect("revisions");
    assert!(versions.contains(&json!("2026-07-28")), "{discovered}");
    let tools = raw.call("tools/list", json!({"_meta": meta})).await;
    assert_eq!(tools["result"]["tools"].as_array().map(Vec::len), Some(8));
    raw.stop().await;
}

#[tokio::test]
async fn a_resumed_seat_is_played_and_its_ticket_is_never_shown() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let made = room(&client, one_shift(), v1::Visibility::Private).await;
    let request = v1::JoinRoomRequest {
        join_code: made.join_code,
        name: "Ada".into(),
        kind: v1::ParticipantKind::Model.into(),
        ..v1::JoinRoomRequest::default()
    };
    let joined = client.join(request).await.expect("a free seat");
    let mut raw = Raw::start(program(&server, &[], Some(&joined.ticket)));
    raw.initialize("2025-06-18").await;
    let (mut text, _) = raw.tool("get_table", json!({})).await;
    let mut expressed = false;
    while !text.contains("The game is over.") {
        let Some(number) = decision(&text) else {
            text = raw.tool("wait_for_turn", json!({"table": "1"})).await.0;
            continue;
        };
        if !expressed {
            let words = json!({"words": "Good luck, everybody!"});
            assert_eq!(raw.tool("express", words).await, ("ok".to_owned(), false));
            let feeling = json!({"label": "joy", "valence": 0.8, "arousal": 0.5});
            assert_eq!(raw.tool("express", feeling).await, ("ok".to_owned(), false));
            expressed = true;
        }
        let (action, _) = options(&text)[0];
        let (_, error) = raw
            .tool("play", json!({"decision": number, "action": action}))
            .await;
        assert!(!error);
        text = raw.tool("wait_for_turn", json!({})).await.0;
    }
    let (all, _) = raw
        .tool("wait_for_turn", json!({"after_sequence": 0}))
        .await;
    assert!(
        all.contains("Ada (you) says \"Good luck, everybody!\""),
        "{all}"
    );
    assert!(all.contains("Ada (you) shows joy"), "{all}");
    // Mistakes are explained, not answered with errors of the protocol.
    for (name, arguments, part) in [
        ("play", json!({"action": 3}), "missing field `decision`"),
        (
            "play",
            json!({"decision": 1, "action": "pass"}),
            "\"pass\" is not a whole number",
        ),
        ("get_table", json!({"table": "7"}), "no such table"),
        ("join_room", json!({}), "join_code"),
        ("join_room", json!({"join_code": "BCDF2345"}), "join code"),
        ("express", json!({}), "label or words"),
    ] {
        let (text, error) = raw.tool(name, arguments).await;
        assert!(error && text.contains(part), "{name}: {text}");
    }
    raw.call("resources/read", json!({"uri": record_of(&text)}))
        .await;
    // The record of a private game is for those who had a seat.
    for (uri, part) in [
        (record_of(&text).to_owned(), "Game over: "),
        (format!("{}.jsonl", record_of(&text)), "\"reveal\":"),
    ] {
        let read = raw.call("resources/read", json!({"uri": uri})).await;
        let record = read["result"]["contents"][0]["text"].as_str();
        assert!(record.is_some_and(|it| it.contains(part)), "{uri}: {read}");
    }
    let (left, _) = raw.tool("leave", json!({})).await;
    assert_eq!(left, "You have left the table.");
    let (none, error) = raw.tool("get_table", json!({})).await;
    assert!(error && none.contains("join_room"), "{none}");
    let written = raw.stop().await;
    assert!(!written.contains(&joined.ticket));
}

#[tokio::test]
async fn a_seat_of_a_game_that_has_not_begun_is_given_back() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let made = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let room_id = made.room.expect("a room").room_id;
    let fingerprints = async || {
        let room = client.get_room(&room_id).await.expect("a room");
        let taken = room.seats.into_iter().filter(|seat| !seat.name.is_empty());
        taken
            .map(|seat| seat.name_fingerprint)
            .collect::<Vec<String>>()
    };
    let taken = async || fingerprints().await.len();
    let folder = tempfile::tempdir().expect("a folder");
    let key = folder.path().join("ada.key");
    let arguments = [
        "--code",
        &made.join_code,
        "--name",
        "Ada",
        "--name-key",
        key.to_str().expect("a path in UTF-8"),
    ];
    let mut raw = Raw::start(program(&server, &arguments, None));
    raw.initialize("2025-06-18").await;
    let (joined, _) = raw.tool("join_room", json!({})).await;
    assert!(joined.contains("seats Ada, free, free, free"), "{joined}");
    let of_key = fingerprints().await;
    assert!(of_key.len() == 1 && of_key[0].len() == 16, "{of_key:?}");
    // The call returns before clients give up on it, although nothing happens.
    let (text, error) = raw.tool("wait_for_turn", json!({})).await;
    assert!(!error && text.contains("free seats: 3"), "{text}");
    let (left, _) = raw.tool("leave", json!({})).await;
    assert_eq!(left, "You have left the table.");
    assert_eq!(taken().await, 0);
    // So is one that a client leaves by ending the program.
    raw.tool("join_room", json!({})).await;
    assert_eq!(fingerprints().await, of_key);
    raw.stop().await;
    assert_eq!(taken().await, 0);
}

#[tokio::test]
async fn a_seat_is_taken_back_from_its_substitute() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let request = v1::CreateRoomRequest {
        rules: Some(v1::RuleSet {
            players: Some(2),
            ..v1::RuleSet::default()
        }),
        // A participant that does not answer is replaced at once, by a substitute that takes its time.
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(10),
            bank_ms: Some(0),
            max_timeouts: Some(1),
            abort: v1::AbortPolicy::Never.into(),
            pace_ms: Some(60_000),
            clocks: vec![v1::KindClock {
                kind: v1::ParticipantKind::Robot.into(),
                decision_time_ms: Some(3_600_000),
                ..v1::KindClock::default()
            }],
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    };
    let made = client.create_room(request).await.expect("a new room");
    let arguments = ["--code", &made.join_code, "--name", "Ada"];
    let mut raw = Raw::start(program(&server, &arguments, None));
    raw.initialize("2025-06-18").await;
    raw.tool("join_room", json!({})).await;
    let other = v1::JoinRoomRequest {
        join_code: made.join_code.clone(),
        name: "Bo".into(),
        kind: v1::ParticipantKind::Robot.into(),
        ..v1::JoinRoomRequest::default()
    };
    let other = client.join(other).await.expect("a free seat");
    let other = tokio::spawn(async move { client.play(other.ticket, RandomAgent::new(1)).await });
    let mut all = String::new();
    while !all.contains("Ada (you) is back") {
        let (text, error) = raw.tool("wait_for_turn", json!({})).await;
        assert!(
            !error && !text.contains("The game is over."),
            "{all}\n{text}"
        );
        all.push_str(&text);
    }
    let late = all
        .find(" (too late)")
        .expect("a decision without an answer");
    assert!(
        all[late..].contains("Ada (you) is replaced by random"),
        "{all}"
    );
    raw.stop().await;
    other.abort();
}
