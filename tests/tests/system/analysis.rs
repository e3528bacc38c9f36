//! Estimates of recorded decisions and of situations that a client describes.

use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_engine::{Seed, Viewer};
use chefshat_proto::v1::{
    self, analysis_service_client::AnalysisServiceClient, evaluate_request::Position,
    game_event::Kind,
};
use chefshat_record::branch::branch_of;
use chefshat_record::convert::{
    By, decision_kind, event_kind, observation_to_proto, rules_to_proto, seat_number,
};
use chefshat_server::config::ServerConfig;
use chefshat_server::store::MemoryStore;
use chefshat_tests::{TestServer, one_shift, patiently, room_of_four};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::played::{EndedGame, original, points};

/// Few enough that the time is never reached.
const ROLLOUTS: u64 = 60;

fn request(position: Position) -> v1::EvaluateRequest {
    v1::EvaluateRequest {
        position: Some(position),
        rollouts: ROLLOUTS,
        time_ms: 10_000,
        agent: "random".into(),
        seed: 5,
        ..v1::EvaluateRequest::default()
    }
}

fn moment(game_id: &str, decisions: usize) -> v1::RecordedMoment {
    v1::RecordedMoment {
        game_id: game_id.into(),
        decisions: decisions as u64,
    }
}

async fn evaluated(
    client: &Client,
    request: v1::EvaluateRequest,
) -> Result<v1::EvaluateResponse, Status> {
    let mut service = AnalysisServiceClient::new(client.channel());
    let mut answers = service.evaluate(request).await?.into_inner();
    let answer = answers.message().await?.expect("an answer");
    assert_eq!(answers.message().await?, None);
    Ok(answer)
}

/// A recorded decision as its seat saw it.
fn situation(game: &EndedGame, decisions: usize) -> v1::Situation {
    let branch = branch_of(&game.lines, decisions as u64).expect("a point of the game");
    let mut events = Vec::new();
    let at = branch
        .replayed(Seed([0; 32]), |event| events.push(event))
        .expect("a valid record");
    let seat = at.decision().expect("a decision is open").seat;
    let viewer = Viewer::Seat(seat);
    let by = By {
        source: v1::DecisionSource::Unspecified,
        decision_time_us: 0,
    };
    let seen = |event: &chefshat_engine::Event| {
        event_kind(&event.seen_by(viewer), branch.rules.actions(), by)
    };
    let kinds: Vec<Kind> = events.iter().filter_map(seen).collect();
    let from = kinds
        .iter()
        .rposition(|kind| matches!(kind, Kind::ShiftStarted(_)))
        .expect("the Shift started");
    let observation = at.observe(viewer);
    v1::Situation {
        rules: Some(rules_to_proto(&branch.rules)),
        seat: seat_number(seat),
        decision: Some(v1::DecisionRequest {
            kind: observation
                .kind
                .map_or(v1::DecisionKind::Unspecified, decision_kind)
                .into(),
            observation: Some(observation_to_proto(&observation)),
            ..v1::DecisionRequest::default()
        }),
        events: kinds[from..]
            .iter()
            .map(|kind| v1::GameEvent {
                kind: Some(kind.clone()),
                ..v1::GameEvent::default()
            })
            .collect(),
    }
}

#[tokio::test]
async fn a_recorded_decision_is_evaluated_by_what_its_seat_knew() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let game = original(&client).await;
    let positions = game.positions();
    let mut service = AnalysisServiceClient::new(client.channel());
    for decisions in points(&game) {
        let at = &positions[decisions];
        let seat = at.decision().expect("a decision is open").seat;
        let legal = at.legal_actions();

        let request_legal = v1::LegalActionsRequest {
            moment: Some(moment(game.game_id(), decisions)),
        };
        let answer = service.legal_actions(request_legal).await;
        let answer = answer.expect("legal actions").into_inner();
        assert_eq!(
            answer.action_mask,
            legal.to_bytes(at.rules().actions().size())
        );
        assert_eq!(answer.seat, seat_number(seat));

        let recorded = request(Position::Moment(moment(game.game_id(), decisions)));
        let found = evaluated(&client, recorded.clone())
            .await
            .expect("estimates");
        let actions: Vec<u32> = legal.iter().map(|action| action.index().into()).collect();
        let estimated: Vec<u32> = found.actions.iter().map(|found| found.action).collect();
        assert_eq!(estimated, actions);
        // Every action is tried in 4 deals, and all in the same number.
        let (count, budget) = (actions.len() as u64, ROLLOUTS.max(4 * actions.len() as u64));
        assert_eq!(found.rollouts, budget / count * count);
        for action in &found.actions {
            assert!((0.0..=5.0).contains(&action.points), "{action:?}");
            assert!((1.0..=4.0).contains(&action.place), "{action:?}");
        }
        for (hand, left) in found
            .hands
            .iter()
            .zip(at.observe(Viewer::Spectator).cards_left.values())
        {
            let cards: f64 = hand.cards.iter().sum();
            assert!((cards - f64::from(*left)).abs() < 1e-9);
        }
        // The same again, and from the seat's own view, which has no hidden card.
        assert_eq!(
            evaluated(&client, recorded).await.expect("estimates"),
            found
        );
        let described = request(Position::Situation(situation(&game, decisions)));
        assert_eq!(
            evaluated(&client, described).await.expect("estimates"),
            found
        );
    }
    // Points of any size, and hardly any time.
    let mut large = situation(&game, points(&game)[0]);
    large.rules.get_or_insert_default().points = vec![u32::MAX, u32::MAX, 1, 0];
    let brief = v1::EvaluateRequest {
        time_ms: 1,
        ..request(Position::Situation(large))
    };
    let found = evaluated(&client, brief).await.expect("estimates");
    for action in &found.actions {
        assert!(action.rollouts >= 4, "{action:?}");
        assert!(
            (0.0..=f64::from(u32::MAX)).contains(&action.points),
            "{action:?}"
        );
        assert!(action.standard_error.is_finite(), "{action:?}");
    }
    server.stop().await;
}

#[tokio::test]
async fn estimates_so_far_come_before_the_last() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let game = original(&client).await;
    let position = || Position::Moment(moment(game.game_id(), points(&game)[0]));
    let plain = v1::EvaluateRequest {
        rollouts: 2_000,
        ..request(position())
    };
    let last = evaluated(&client, plain.clone()).await.expect("estimates");
    let asked = v1::EvaluateRequest {
        update_ms: 50,
        ..plain
    };
    let mut service = AnalysisServiceClient::new(client.channel());
    let answers = service.evaluate(asked).await.expect("estimates");
    let mut answers = answers.into_inner();
    let mut all = Vec::new();
    while let Some(answer) = answers.message().await.expect("an answer") {
        all.push(answer);
    }
    assert_eq!(all.last(), Some(&last));
    assert!(all.is_sorted_by(|one, next| one.rollouts <= next.rollouts));
    for answer in &all {
        assert_eq!(answer.actions.len(), last.actions.len());
        assert_eq!(answer.hands, last.hands);
    }
    server.stop().await;
}

#[tokio::test]
async fn a_client_that_goes_away_frees_the_thread_and_the_place() {
    let one_thread = |config: &mut ServerConfig| config.vector_threads = 1;
    let server = TestServer::with(one_thread, Arc::new(MemoryStore::default())).await;
    let client = server.client().await;
    let game = original(&client).await;
    let limits = client.server_info().await.expect("information").limits;
    // One caller may have half of them on the server's machine.
    let most = limits["max_analyses"] * limits["local_share_percent"] / 100;
    let position = || Position::Moment(moment(game.game_id(), points(&game)[0]));
    let longest = || v1::EvaluateRequest {
        rollouts: limits["max_analysis_rollouts"],
        time_ms: u32::try_from(limits["max_analysis_ms"]).expect("milliseconds"),
        agent: "trained".into(),
        ..request(position())
    };
    let mut service = AnalysisServiceClient::new(client.channel());
    let mut open = Vec::new();
    for _ in 0..most {
        open.push(service.evaluate(longest()).await.expect("an analysis"));
    }
    let status = service.evaluate(longest()).await.expect_err("one too many");
    let details = status.get_details_error_info().expect("details");
    assert_eq!(
        (status.code(), details.reason.as_str()),
        (Code::ResourceExhausted, "TOO_MANY_ANALYSES")
    );
    // With one thread, they would take minutes. Others wait for none of them, and can be as many.
    drop(open);
    patiently("places for as many analyses", async {
        let mut again = Vec::new();
        while (again.len() as u64) < most {
            match service.evaluate(longest()).await {
                Ok(stream) => again.push(stream),
                Err(_) => tokio::task::yield_now().await,
            }
        }
    })
    .await;
    patiently("an analysis after those that were cancelled", async {
        while evaluated(&client, request(position())).await.is_err() {
            tokio::task::yield_now().await;
        }
    })
    .await;
    server.stop().await;
}

#[tokio::test]
async fn an_analysis_that_could_not_end_by_its_deadline_is_refused_at_once() {
    let one_thread = |config: &mut ServerConfig| config.vector_threads = 1;
    let server = TestServer::with(one_thread, Arc::new(MemoryStore::default())).await;
    let client = server.client().await;
    let game = original(&client).await;
    let limits = client.server_info().await.expect("information").limits;
    let longest = |deadline: Option<Duration>| {
        let mut request = tonic::Request::new(v1::EvaluateRequest {
            rollouts: limits["max_analysis_rollouts"],
            time_ms: u32::try_from(limits["max_analysis_ms"]).expect("milliseconds"),
            agent: "trained".into(),
            ..request(Position::Moment(moment(game.game_id(), points(&game)[0])))
        });
        if let Some(deadline) = deadline {
            request.set_timeout(deadline);
        }
        request
    };
    let mut service = AnalysisServiceClient::new(client.channel());
    let first = service.evaluate(longest(None)).await.expect("a place");
    // A second one would get half of the thread, and less if another caller came.
    let twice = Duration::from_millis(limits["max_analysis_ms"]) * 3 / 2;
    let refused = service.evaluate(longest(Some(twice))).await;
    let status = refused.expect_err("it could not end");
    let details = status.get_details_error_info().expect("details");
    assert_eq!(
        (status.code(), details.reason.as_str()),
        (Code::ResourceExhausted, "TOO_MANY_ANALYSES")
    );
    assert!(status.get_details_retry_info().is_some(), "{status}");
    let patient = service.evaluate(longest(None)).await;
    patient.expect("those without a deadline wait");
    drop(first);
    server.stop().await;
}

#[tokio::test]
async fn what_cannot_be_evaluated_is_refused() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let game = original(&client).await;
    let policy = v1::RoomPolicy::default();
    let (running, _tickets) = room_of_four(&client, one_shift(), policy).await;
    let running = running.room.expect("a room");
    let at = points(&game)[0];
    let check = async |request: v1::EvaluateRequest, code: Code, reason: &str| {
        let status = evaluated(&client, request).await.expect_err(reason);
        let details = status.get_details_error_info();
        let found = details.map_or_else(String::new, |details| details.reason);
        assert_eq!(
            (status.code(), found.as_str()),
            (code, reason),
            "{status:?}"
        );
    };
    let named = |game_id: &str, decisions| request(Position::Moment(moment(game_id, decisions)));
    let described = |change: fn(&mut v1::Situation)| {
        let mut situation = situation(&game, at);
        change(&mut situation);
        request(Position::Situation(situation))
    };
    let invalid = Code::InvalidArgument;
    let refused = "ANALYSIS_REFUSED";
    check(
        named(&running.game_id, 0),
        Code::FailedPrecondition,
        "GAME_RUNNING",
    )
    .await;
    check(named(&"0".repeat(32), 0), Code::NotFound, "GAME_UNKNOWN").await;
    check(named(game.game_id(), 1_000_000), invalid, refused).await;
    check(v1::EvaluateRequest::default(), invalid, refused).await;
    let valid = named(game.game_id(), at);
    for wrong in [
        v1::EvaluateRequest {
            time_ms: 10_001,
            ..valid.clone()
        },
        v1::EvaluateRequest {
            rollouts: 1_000_001,
            ..valid.clone()
        },
        v1::EvaluateRequest {
            agent: "clever".into(),
            ..valid.clone()
        },
        v1::EvaluateRequest {
            update_ms: 49,
            ..valid
        },
        described(|situation| situation.seat = 4),
        described(|situation| situation.decision = None),
        described(|situation| situation.events.clear()),
        // Another seat's hand.
        described(|situation| situation.seat = (situation.seat + 1) % 4),
    ] {
        check(wrong, invalid, refused).await;
    }
    let rules = described(|situation| {
        situation.rules = Some(v1::RuleSet {
            faces: Some(3),
            ..v1::RuleSet::default()
        })
    });
    check(rules, invalid, "RULE_SET_REFUSED").await;
    server.stop().await;
}
