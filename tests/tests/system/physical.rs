//! A physical room over real sockets: two persons at the table, an agent in this process and a
//! built-in agent. A simulated table plays the truth with the rule engine and reports it, once
//! wrongly, once against the rules, with a question, and across a crash of the server.

use chefshat_client::{Client, Error, RandomAgent};
use chefshat_engine::{BySeat, Seat, Seed};
use chefshat_proto::v1::{
    self, game_event::Kind, record_line::Line, seat_config::FilledBy, table_report,
};
use chefshat_record::convert::{rules_from_proto, seat_number};
use chefshat_record::jsonl;
use chefshat_referee::Report;
use chefshat_tests::{Launch, Process, patiently, set_up};
use tokio::process::Command;

use crate::table_bridge::Bridge;

const ADA: Seat = Seat::new(0);
const AGENT: Seat = Seat::new(1);
const BO: Seat = Seat::new(3);

fn seats() -> Vec<v1::SeatConfig> {
    let seat = |filled_by, name: &str| v1::SeatConfig {
        filled_by: Some(filled_by),
        name: name.into(),
    };
    let at_table = || FilledBy::AtTable(v1::ParticipantKind::Human.into());
    vec![
        seat(at_table(), "Ada"),
        seat(FilledBy::ReservedFor(v1::ParticipantKind::Agent.into()), ""),
        seat(FilledBy::BuiltInAgent("greedy".into()), "Greta"),
        seat(at_table(), "Bo"),
    ]
}

fn request() -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        name: "lab".into(),
        rules: Some(v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(2)),
            // A decline is seen by nobody, so the truth could not follow it.
            special_actions: Some(false),
            ..v1::RuleSet::default()
        }),
        seats: seats(),
        policy: Some(v1::RoomPolicy {
            pace_ms: Some(0),
            decision_time_ms: Some(600_000),
            ..v1::RoomPolicy::default()
        }),
        physical: true,
        ..v1::CreateRoomRequest::default()
    }
}

pub(crate) async fn restarted(launch: &mut Launch, server: Process) -> Process {
    server.kill().await;
    launch.start().await.expect("the server restarts")
}

fn count(lines: &[v1::RecordLine], wanted: impl Fn(&Kind) -> bool) -> usize {
    let events = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => event.kind.as_ref(),
        _ => None,
    });
    events.filter(|kind| wanted(kind)).count()
}

pub(crate) async fn chefshat(arguments: &[&str]) -> String {
    let output = Command::new(set_up("CHEFSHAT_BIN"))
        .args(arguments)
        .output()
        .await
        .expect("the binary starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let problem = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {text}{problem}");
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn persons_at_a_table_play_with_agents_and_the_record_is_their_game() {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(data.path());
    let server = launch.start().await.expect("the server starts");
    let client = Client::connect(launch.url()).await.expect("it listens");
    let created = client.create_room(request()).await.expect("a new room");
    let room = created.room.expect("a room");
    assert_eq!(room.origin(), v1::GameOrigin::Physical);
    assert!(room.seed_commitment.is_empty() && !room.seed_fixed);
    let rules = rules_from_proto(room.rules.as_ref().expect("rules")).expect("valid rules");
    let at_table = BySeat::from_fn(4, |seat| seat == ADA || seat == BO);
    let mut bridge = Bridge::attach(
        &client,
        &room.room_id,
        created.table_ticket,
        rules,
        Seed([5; 32]),
        at_table,
    )
    .await;
    assert_eq!(bridge.state.stage(), v1::TableStage::Waiting);
    let early = client
        .report(
            &bridge.ticket,
            v1::TableReport {
                kind: Some(table_report::Kind::Cleared(v1::BoardCleared {})),
                ..v1::TableReport::default()
            },
        )
        .await;
    assert_eq!(
        early.expect_err("too early").reason(),
        Some("GAME_NOT_STARTED")
    );

    let joined = client.join_with_code(&created.join_code, "agent").await;
    let joined = joined.expect("the open seat");
    assert_eq!(joined.seat, seat_number(AGENT));
    let player = client.clone();
    let playing =
        tokio::spawn(async move { player.play(joined.ticket, RandomAgent::new(3)).await });
    while bridge.state.stage() == v1::TableStage::Waiting {
        bridge.next_state().await;
    }

    // A play that breaks the rules changes nothing.
    bridge.until(|it| it.reports > 12).await;
    let before = bridge.state.observation.clone();
    let violation = bridge
        .send(v1::TableReport {
            kind: Some(table_report::Kind::Laid(v1::CardsLaid {
                seat: None,
                cards: Some(v1::SeenCards {
                    cards: vec![2, 3],
                    golden: None,
                }),
            })),
            ..v1::TableReport::default()
        })
        .await;
    assert_eq!(violation.verdict(), v1::ReportVerdict::Violation);
    let shown = bridge.state.violation.clone().expect("it is shown");
    assert_eq!(
        (shown.rule(), &shown.text),
        (v1::ViolatedRule::Form, &violation.detail)
    );
    assert_eq!(bridge.state.observation, before);

    // A question is asked and answered.
    let question = v1::TableQuestion {
        question_id: "place 4".into(),
        text: "7 or 9 at place 4?".into(),
        options: vec!["7".into(), "9".into()],
        seat: None,
        picture: vec![1; 1000],
    };
    bridge
        .send(v1::TableReport {
            kind: Some(table_report::Kind::Question(question.clone())),
            ..v1::TableReport::default()
        })
        .await;
    assert_eq!(bridge.state.questions, [question]);
    bridge
        .report(Report::Answer {
            id: "place 4".into(),
            option: Some(1),
        })
        .await;
    assert!(bridge.state.questions.is_empty());

    // A misread play is corrected, while the agents already answer it.
    while !bridge.misread().await {
        bridge.until(|_| true).await;
    }

    // The server crashes and resumes the game at the same place.
    bridge.until(|it| it.reports > 40).await;
    let (stage, observation) = (bridge.state.stage(), bridge.state.observation.clone());
    let server = restarted(&mut launch, server).await;
    bridge.next_state().await;
    while bridge
        .state
        .room
        .as_ref()
        .is_some_and(|room| !room.seats[1].connected)
    {
        bridge.next_state().await;
    }
    assert_eq!(
        (bridge.state.stage(), &bridge.state.observation),
        (stage, &observation)
    );

    bridge.until(|_| false).await;
    let outcome = patiently("the agent", playing).await.expect("no panic");
    outcome.expect("the game has a result");
    let late = bridge.follower.next().await;
    assert!(matches!(late, Ok(Some(_) | None)), "{late:?}");
    let over: Result<_, Error> = client
        .report(
            &bridge.ticket,
            v1::TableReport {
                kind: Some(table_report::Kind::Cleared(v1::BoardCleared {})),
                ..v1::TableReport::default()
            },
        )
        .await;
    assert_eq!(over.expect_err("over").reason(), Some("GAME_OVER"));

    let record = client.record(&room.game_id).await.expect("a record");
    bridge.assert_recorded(&record);
    assert_eq!(count(&record, |it| matches!(it, Kind::Violation(_))), 1);
    assert_eq!(count(&record, |it| matches!(it, Kind::Correction(_))), 1);
    assert_eq!(
        count(&record, |it| matches!(it, Kind::ServerRestarted(_))),
        1
    );

    // Its file verifies, and is exported and rendered like others.
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    let file = jsonl::path_of(data.path(), &room.game_id);
    assert!(jsonl::read(&file).expect("a record file") == record);
    let file = file.to_str().expect("text");
    let out = data.path().join("out");
    let out = out.to_str().expect("text");
    chefshat(&["verify", file]).await;
    chefshat(&["export", file, "--out", out]).await;
    let picture = data.path().join("picture.png");
    let picture = picture.to_str().expect("text");
    chefshat(&["render", file, "--at", "20", "--out", picture]).await;
}
