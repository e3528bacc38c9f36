//! `chefshat mcp` over standard input and output: whole games of a scripted client of the Rust SDK, in
//! the current revision of the Model Context Protocol and in an older one; illegal actions; what is
//! recorded. `mcp_raw` reads every byte, `mcp_http` has the other transport.

use std::process::Stdio;

use chefshat_client::{Client, count_in, v1};
use chefshat_proto::v1::record_line::Line;
use chefshat_record::replay;
use chefshat_tests::{TestServer, patiently, set_up};
use rmcp::model::{
    CallToolRequestParams, CallToolResult, GetPromptRequestParams, ProtocolVersion,
    ReadResourceRequestParams, ResourceContents,
};
use rmcp::service::{RoleClient, RunningService};
use rmcp::{ClientLifecycleMode, ClientServiceExt as _};
use serde_json::{Value, json};
use tokio::process::{Child, Command};

/// Longest run of letters and digits in a text for models: the id of a game. Tickets are longer.
const LONGEST_WORD: usize = 32;

/// A room with one open seat, in which nobody has to hurry.
pub(crate) async fn room(
    client: &Client,
    rules: v1::RuleSet,
    visibility: v1::Visibility,
) -> v1::CreateRoomResponse {
    use v1::seat_config::FilledBy::{BuiltInAgent, ReservedFor};
    let open = ReservedFor(v1::ParticipantKind::Model.into());
    let agents = ["greedy", "random", "greedy"].map(|kind| BuiltInAgent(kind.into()));
    let seats = std::iter::once(open).chain(agents);
    let request = v1::CreateRoomRequest {
        name: "a table for a model".into(),
        rules: Some(rules),
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(3_600_000),
            pace_ms: Some(0),
            visibility: visibility.into(),
            ..v1::RoomPolicy::default()
        }),
        seats: seats
            .map(|filled_by| v1::SeatConfig {
                filled_by: Some(filled_by),
                ..v1::SeatConfig::default()
            })
            .collect(),
        ..v1::CreateRoomRequest::default()
    };
    client.create_room(request).await.expect("a new room")
}

/// The program, connected to a server.
pub(crate) fn program(server: &TestServer, arguments: &[&str], ticket: Option<&str>) -> Child {
    let mut command = Command::new(set_up("CHEFSHAT_BIN"));
    command
        .args(["mcp", "--server", &server.url()])
        .args(arguments);
    for name in ["TICKET", "TOKEN", "CA", "NAME"] {
        command.env_remove(format!("CHEFSHAT_{name}"));
    }
    if let Some(ticket) = ticket {
        command.env("CHEFSHAT_TICKET", ticket);
    }
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .kill_on_drop(true)
        .spawn()
        .expect("the program starts")
}

/// The number of the open decision.
pub(crate) fn decision(text: &str) -> Option<u64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("decision "))?;
    let (number, _) = line.split_once(':').expect("a number, then what is asked");
    Some(number.parse().expect("a number"))
}

/// The legal actions, with their words.
pub(crate) fn options(text: &str) -> Vec<(u32, &str)> {
    let (_, options) = (text.split_once("\noptions\n")).expect("a decision has options");
    let options = options.lines().map(|line| {
        let (id, words) = line.split_once('=').expect("an id and words");
        let id = id.strip_prefix('a').expect("an id");
        (id.parse().expect("a number"), words)
    });
    options.collect()
}

/// The URI of the record, which the last text says.
pub(crate) fn record_of(text: &str) -> &str {
    let at = text
        .find("chefshat://records/")
        .expect("where the record is");
    text[at..].split_whitespace().next().expect("a URI")
}

/// A client of the Rust SDK.
struct Player {
    client: RunningService<RoleClient, ()>,
    child: Child,
    texts: Vec<String>,
}

impl Player {
    async fn start(mut child: Child, lifecycle: ClientLifecycleMode) -> Self {
        let pipes = (
            child.stdout.take().expect("a pipe"),
            child.stdin.take().expect("a pipe"),
        );
        let client = patiently("the handshake", ().serve_with_lifecycle(pipes, lifecycle))
            .await
            .expect("the program answers");
        Self {
            client,
            child,
            texts: Vec::new(),
        }
    }

    async fn call(&mut self, tool: &'static str, arguments: Value) -> CallToolResult {
        let Value::Object(arguments) = arguments else {
            panic!("arguments are an object");
        };
        let request = CallToolRequestParams::new(tool).with_arguments(arguments);
        let result = patiently(tool, self.client.call_tool(request)).await;
        let result = result.expect("tools report errors in their results");
        self.texts.push(text_of(&result).to_owned());
        result
    }

    /// Calls a tool that succeeds.
    async fn say(&mut self, tool: &'static str, arguments: Value) -> String {
        let result = self.call(tool, arguments).await;
        assert_ne!(result.is_error, Some(true), "{result:?}");
        text_of(&result).to_owned()
    }

    async fn read(&mut self, uri: &str) -> String {
        let reading = self
            .client
            .read_resource(ReadResourceRequestParams::new(uri));
        let result = patiently(uri, reading).await.expect("a resource");
        let ResourceContents::TextResourceContents { text, .. } = &result.contents[0] else {
            panic!("{uri} is text");
        };
        text.clone()
    }

    async fn stop(mut self) {
        self.client.cancel().await.expect("it stops");
        let status = patiently("the program to end", self.child.wait()).await;
        assert!(status.expect("a child").success());
    }
}

fn text_of(result: &CallToolResult) -> &str {
    let [content] = &result.content[..] else {
        panic!("one text: {result:?}");
    };
    &content.as_text().expect("a text").text
}

/// Plays a game to 15 points, with an illegal action at the first decision. Returns the id of the
/// game.
async fn plays_a_game(player: &mut Player) -> String {
    let rooms = player.say("list_rooms", json!({})).await;
    assert!(
        rooms.contains("a table for a model: waiting, 1 of 4 seats free"),
        "{rooms}"
    );
    let joined = player.say("join_room", json!({"name": "Ada"})).await;
    assert!(joined.starts_with("table 1\n"), "{joined}");
    let mut text = player
        .say("wait_for_turn", json!({"after_sequence": 0}))
        .await;
    let mut illegal = 0;
    while !text.contains("The game is over.") {
        let Some(number) = decision(&text) else {
            text = player.say("wait_for_turn", json!({})).await;
            continue;
        };
        let legal = options(&text);
        if illegal == 0 {
            illegal = (0..214)
                .find(|id| legal.iter().all(|(it, _)| it != id))
                .expect("some are not");
            let wrong = json!({"decision": number, "action": illegal});
            let refused = player.call("play", wrong).await;
            assert_eq!(refused.is_error, Some(true));
            let refused = text_of(&refused);
            assert!(
                refused.starts_with(&format!("Illegal: a{illegal} (")),
                "{refused}"
            );
            assert!(refused.contains("Attempts left: 9."), "{refused}");
            assert_eq!(options(refused), legal);
            let table = player.say("get_table", json!({})).await;
            assert_eq!(decision(&table), Some(number));
        }
        let (action, words) = legal[0];
        let answer = json!({"decision": number, "action": action, "reason": format!("because of {words}"), "wait": true});
        let said = player.say("play", answer).await;
        assert!(said.starts_with(&format!("ok {words}.\nseq ")), "{said}");
        text = said;
    }
    // What has been answered is not open any more.
    let late = player
        .call("play", json!({"decision": 1, "action": 199}))
        .await;
    assert_eq!(late.is_error, Some(true));
    let uri = record_of(&text).to_owned();
    let record = player.read(&uri).await;
    assert!(record.contains("(because of "), "{record}");
    assert!(record.contains("Game over: 1st "), "{record}");
    let events = player.read("chefshat://tables/1/events").await;
    assert!(
        events.contains("you ") && events.contains("Game over: "),
        "{events}"
    );
    assert!(!events.contains("because of"), "{events}");
    player.texts.extend([record, events]);
    uri.trim_start_matches("chefshat://records/").to_owned()
}

/// Checks the record of such a game: it verifies, and has the attempt and the reasons.
async fn is_recorded(client: &Client, game_id: &str) {
    let record = client.record(game_id).await.expect("a finished game");
    let replayed = replay::replay(&record).expect("a valid record");
    assert_eq!(replayed.state, v1::RoomState::Finished);
    let decisions = record.iter().filter_map(|line| match &line.line {
        Some(Line::Decision(decision)) if decision.seat == 0 => Some(decision),
        _ => None,
    });
    let decisions: Vec<_> = decisions.collect();
    assert_eq!(decisions[0].invalid_attempts.len(), 1);
    for decision in &decisions {
        assert_eq!(decision.source(), v1::DecisionSource::Agent);
        let annotations = decision.annotations.as_ref().expect("a reason");
        assert!(annotations.extra["reason"].starts_with("because of "));
    }
}

fn without_tickets(texts: &[String]) {
    for text in texts {
        let mut words = text.split(|letter: char| !letter.is_ascii_alphanumeric());
        let long = words.find(|word| word.len() > LONGEST_WORD);
        assert_eq!(long, None, "{text}");
    }
}

#[tokio::test]
async fn a_scripted_client_plays_whole_games_with_and_without_a_handshake() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let lifecycles = [
        ClientLifecycleMode::Initialize,
        ClientLifecycleMode::Discover {
            preferred_versions: vec![ProtocolVersion::V_2026_07_28],
        },
    ];
    for lifecycle in lifecycles {
        let made = room(&client, v1::RuleSet::default(), v1::Visibility::Public).await;
        let child = program(&server, &["--code", &made.join_code], None);
        let mut player = Player::start(child, lifecycle).await;
        let game_id = plays_a_game(&mut player).await;
        assert_eq!(made.room.expect("a room").game_id, game_id);
        is_recorded(&client, &game_id).await;
        without_tickets(&player.texts);

        let complete = player
            .read(&format!("chefshat://records/{game_id}.jsonl"))
            .await;
        let lines: Vec<v1::RecordLine> = complete
            .lines()
            .map(|line| serde_json::from_str(line).expect("a line of a record"))
            .collect();
        replay::replay(&lines).expect("the same record");
        let rules = player.read("chefshat://rules").await;
        assert!(rules.starts_with("# The rules of Chef's Hat"), "{rules}");
        let listed = player.client.list_all_resources().await.expect("a list");
        let uris: Vec<&str> = listed.iter().map(|it| it.uri.as_str()).collect();
        for uri in ["chefshat://rules", "chefshat://tables/1/events"] {
            assert!(uris.contains(&uri), "{uri} is not in {uris:?}");
        }
        assert!(
            uris.contains(&&*format!("chefshat://records/{game_id}")),
            "{uris:?}"
        );
        let unknown = ReadResourceRequestParams::new("chefshat://nothing");
        player
            .client
            .read_resource(unknown)
            .await
            .expect_err("no such resource");

        let prompts = player.client.list_all_prompts().await.expect("a list");
        assert_eq!(prompts.len(), 1);
        let mut asked = GetPromptRequestParams::new(prompts[0].name.as_str());
        let arguments = json!({"join_code": "BCDF2345"});
        asked.arguments = arguments.as_object().cloned();
        let prompt = player.client.get_prompt(asked).await.expect("a prompt");
        let prompt = prompt.messages[0].content.as_text().expect("a text");
        assert!(
            prompt
                .text
                .contains("join_room with join_code \"BCDF2345\""),
            "{}",
            prompt.text
        );
        player.stop().await;
    }
}

#[tokio::test]
async fn a_model_begins_a_game_of_its_own_and_decides_only_where_it_can() {
    let server = TestServer::start().await;
    let child = program(&server, &[], None);
    let mut player = Player::start(child, ClientLifecycleMode::Initialize).await;
    let refused = player
        .call("create_room", json!({"opponents": "nobody"}))
        .await;
    assert_eq!(refused.is_error, Some(true));
    assert!(text_of(&refused).contains("nobody"), "{refused:?}");
    let created = json!({"opponents": "random", "name": "Ada"});
    let joined = player.say("create_room", created).await;
    assert!(joined.starts_with("table 1\n"), "{joined}");
    let mut text = player
        .say("wait_for_turn", json!({"skip_forced": true}))
        .await;
    while !text.contains("The game is over.") {
        let Some(number) = decision(&text) else {
            text = player
                .say("wait_for_turn", json!({"skip_forced": true}))
                .await;
            continue;
        };
        let legal = options(&text);
        assert!(legal.len() > 1, "{text}");
        // As models write numbers, and the ids of actions.
        let (decision, action) = (number.to_string(), format!("a{}", legal[0].0));
        let action = match number % 2 {
            0 => json!(action),
            _ => json!(f64::from(legal[0].0)),
        };
        let answer =
            json!({"decision": decision, "action": action, "wait": true, "skip_forced": true});
        text = player.say("play", answer).await;
    }
    let wrong = player
        .call("play", json!({"decision": "1.5", "action": 199}))
        .await;
    assert!(text_of(&wrong).contains("not a whole number"), "{wrong:?}");
    let game_id = record_of(&text).trim_start_matches("chefshat://records/");
    let record = server.client().await.record(game_id).await;
    let record = record.expect("a finished game");
    let own = record.iter().filter_map(|line| match &line.line {
        Some(Line::Decision(decision)) if decision.seat == 0 => Some(decision),
        _ => None,
    });
    let sources: Vec<_> = own
        .map(|it| (it.source(), count_in(&it.action_mask)))
        .collect();
    let is_own = |source: &v1::DecisionSource| *source == v1::DecisionSource::Agent;
    assert!(
        sources.iter().all(|(source, _)| is_own(source)),
        "{sources:?}"
    );
    assert!(
        sources.iter().any(|(_, legal)| *legal == 1),
        "some were forced"
    );
    player.stop().await;
}

#[tokio::test]
async fn a_client_that_has_died_plays_on_with_the_tickets_of_a_file() {
    let server = TestServer::start().await;
    let rules = v1::RuleSet::default();
    let created = room(&server.client().await, rules, v1::Visibility::Public).await;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tickets");
    let arguments = ["--tickets", file.to_str().expect("text")];
    let start = async || {
        let child = program(&server, &arguments, None);
        Player::start(child, ClientLifecycleMode::Initialize).await
    };
    let mut player = start().await;
    let joined = json!({"join_code": created.join_code, "name": "Ada"});
    player.say("join_room", joined).await;
    let turn = async |player: &mut Player| loop {
        let table = player.say("get_table", json!({})).await;
        if let Some(number) = decision(&table) {
            return (number, options(&table)[0].0);
        }
        player.say("wait_for_turn", json!({})).await;
    };
    let (number, action) = turn(&mut player).await;
    let kept = std::fs::read_to_string(&file).expect("a file");
    assert_eq!(kept.lines().count(), 1, "{kept}");
    let other = program(&server, &arguments, None).wait_with_output();
    let other = patiently("the other program to end", other).await;
    assert!(
        !other.expect("it runs").status.success(),
        "the file is taken"
    );
    player.child.kill().await.expect("it has run");

    let mut player = start().await;
    assert_eq!(turn(&mut player).await, (number, action));
    let answer = json!({"decision": number, "action": action});
    player.say("play", answer).await;
    assert_eq!(std::fs::read_to_string(&file).expect("a file"), kept);
    player.say("leave", json!({})).await;
    assert_eq!(std::fs::read_to_string(&file).expect("a file"), "");
    player.stop().await;
}
