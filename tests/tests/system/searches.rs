//! Built-in agents that search: in rooms, after a crash of the server, in tournaments.

use chefshat_client::Client;
use chefshat_proto::v1::act_request::Command;
use chefshat_proto::v1::play_service_client::PlayServiceClient;
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line, seat_update::Update};
use chefshat_record::replay::replay;
use chefshat_tests::{
    Launch, TestServer, attach_all, first_legal, first_update, is_legal, one_shift, patiently,
    play_on, room_of_four,
};
use futures::future::join_all;

use crate::played::{built_in, ended, until_over};
use crate::tournaments;

/// Rollouts by random agents are quick.
const SEARCHER: &str = "monte_carlo:8:random";

fn request(agents: [&str; 4]) -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        rules: Some(one_shift()),
        seats: agents.map(built_in).to_vec(),
        game_seed: vec![5; 32],
        ..v1::CreateRoomRequest::default()
    }
}

#[tokio::test]
async fn agents_search_in_rooms_and_records_name_their_budgets() {
    let server = TestServer::start().await;
    let agents = [SEARCHER, "greedy", "monte_carlo:5ms:random", "random"];
    let game = ended(&server.client().await, request(agents)).await;
    let seats = game.header().seats.iter();
    let named: Vec<&str> = (seats.clone())
        .map(|seat| seat.built_in_agent.as_str())
        .collect();
    assert_eq!(named, agents);
    assert!(seats.clone().all(|seat| seat.name == seat.built_in_agent));
    assert!(
        (game.decisions().iter())
            .all(|it| it.source() == v1::DecisionSource::Agent && it.decision_time_us == 0)
    );
    let info = server.client().await.server_info().await.expect("info");
    assert!(info.built_in_agents.contains(&"monte_carlo".to_owned()));
    server.stop().await;
}

#[tokio::test]
async fn agents_play_what_they_find_and_records_say_where_they_did_not_search() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let played = async |agent| {
        let game = ended(&client, request([agent; 4])).await;
        let decisions = game.decisions().into_iter();
        let notes: Vec<String> = decisions
            .filter_map(|it| it.annotations.as_ref()?.extra.get("search").cloned())
            .collect();
        (game.course(), notes)
    };
    let (trained, notes) = played("trained").await;
    assert!(notes.is_empty());
    // Too few rollouts to show a gain.
    let (hasty, notes) = played("monte_carlo:1:random").await;
    assert_eq!(hasty, trained);
    assert!(notes.len() > 10 && notes.iter().all(|note| note == "too_few_deals"));
    let (searching, notes) = played("monte_carlo:1000:random").await;
    assert_ne!(searching, trained);
    assert!(notes.is_empty(), "{notes:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_game_of_agents_that_search_resumes_after_sigkill() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let mut server = launch.start().await.expect("the server starts");
    let client = Client::connect(launch.url()).await.expect("it listens");
    let created = client.create_room(request([SEARCHER; 4])).await;
    let room = created.expect("a new room").room.expect("a room");
    let mut kills = 0;
    for decisions in [3, 20] {
        let client = Client::connect(launch.url()).await.expect("it listens");
        let mut watching = client.spectate(&room.room_id, 0);
        let some = async {
            let mut seen = 0;
            while let Ok(Some(event)) = watching.next().await {
                seen += usize::from(matches!(event.kind, Some(Kind::Play(_) | Kind::Pass(_))));
                if seen == decisions {
                    return;
                }
            }
            panic!("the game ended before {decisions} decisions");
        };
        patiently("decisions", some).await;
        server.kill().await;
        kills += 1;
        server = launch.start().await.expect("the server restarts");
    }
    let client = Client::connect(launch.url()).await.expect("it listens");
    let game = patiently("the end", until_over(&client, room.room_id)).await;
    let replayed = replay(&game.lines).expect("a valid record");
    assert_eq!(replayed.state, v1::RoomState::Finished);
    let restarts = game.events(|kind| matches!(kind, Kind::ServerRestarted(_)));
    assert_eq!(restarts, kills);
    server.stop().await;
}

#[tokio::test]
async fn agents_that_search_take_part_in_tournaments() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let settings = v1::TournamentSettings {
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 1,
        built_in_agents: [SEARCHER, SEARCHER, "greedy"].map(str::to_owned).to_vec(),
        filler: "monte_carlo:9:random".into(),
        ..v1::TournamentSettings::default()
    };
    let created = tournaments::create(&mut service, settings).await;
    tournaments::start(&mut service, &created).await;
    let tournament = tournaments::over(&mut service, &tournaments::id_of(&created)).await;
    assert_eq!(tournament.state(), v1::TournamentState::Finished);
    let taking_part: Vec<(&str, &str)> = (tournament.participants.iter())
        .map(|it| (it.name.as_str(), it.built_in_agent.as_str()))
        .collect();
    assert_eq!(taking_part[0], ("monte_carlo:8:random 1", SEARCHER));
    assert_eq!(taking_part[1], ("monte_carlo:8:random 2", SEARCHER));
    assert!(taking_part.iter().any(|it| it.1 == "monte_carlo:9:random"));
    server.stop().await;
}

#[tokio::test]
async fn budgets_that_are_too_large_are_refused_with_their_bounds() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for (agent, words) in [
        ("monte_carlo:1001ms", "at most 1000ms or 5000 rollouts"),
        ("monte_carlo:5001", "at most 1000ms or 5000 rollouts"),
        ("monte_carlo:0", "write monte_carlo, monte_carlo:50ms"),
        ("monte carlo", "use one of random"),
    ] {
        let refused = client.create_room(request([agent; 4])).await;
        let error = refused.expect_err(agent);
        assert_eq!(error.reason(), Some("SEATS_REFUSED"), "{agent}");
        assert!(error.to_string().contains(words), "{error}");
        let policy = v1::RoomPolicy {
            substitute: agent.into(),
            ..v1::RoomPolicy::default()
        };
        let refused = client
            .create_room(v1::CreateRoomRequest {
                policy: Some(policy),
                ..request(["greedy"; 4])
            })
            .await;
        let error = refused.expect_err(agent);
        assert_eq!(error.reason(), Some("POLICY_REFUSED"), "{agent}");
    }
    let real = v1::CreateRoomRequest {
        physical: true,
        game_seed: Vec::new(),
        seats: [
            v1::SeatConfig {
                filled_by: Some(v1::seat_config::FilledBy::AtTable(
                    v1::ParticipantKind::Human.into(),
                )),
                name: "Rosa".into(),
            },
            built_in(SEARCHER),
            built_in("greedy"),
            built_in("greedy"),
        ]
        .to_vec(),
        ..request([SEARCHER; 4])
    };
    let error = client.create_room(real).await.expect_err("real cards");
    assert!(error.to_string().contains("choose trained"), "{error}");
    server.stop().await;
}

#[tokio::test]
async fn a_seat_is_given_hints_and_the_record_says_so() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let policy = v1::RoomPolicy {
        hints: true,
        ..tournaments::unhurried()
    };
    let (created, tickets) = room_of_four(&client, one_shift(), policy).await;
    let mut seats = attach_all(&server, &tickets).await;
    let (update, seat) = first_update(&mut seats).await;
    let Update::Decision(decision) = update else {
        panic!("not a decision, but {update:?}");
    };
    let (own, other) = (&tickets[seat], &tickets[(seat + 1) % 4]);
    let refused = client.hint(other, decision.decision_id).await;
    assert_eq!(
        refused.expect_err("another seat").reason(),
        Some("DECISION_CLOSED")
    );
    let repeated = v1::ActRequest {
        ticket: own.clone(),
        command: Some(Command::Hint(v1::AskHint {
            decision_id: decision.decision_id,
            request_id: vec![7; 32],
        })),
    };
    let mut service = PlayServiceClient::new(client.channel());
    let first = service.act(repeated.clone()).await.expect("a hint");
    let again = service.act(repeated).await.expect("the same hint");
    assert_eq!(first.into_inner(), again.into_inner());
    for _ in 0..2 {
        let hint = client
            .hint(own, decision.decision_id)
            .await
            .expect("a hint");
        assert!(is_legal(&decision, hint.action));
        // None of them are estimated if the machine has too much to do.
        for estimate in &hint.actions {
            assert!(is_legal(&decision, estimate.action) && estimate.rollouts > 0);
        }
    }
    let refused = client.hint(own, decision.decision_id).await;
    assert_eq!(
        refused.expect_err("the fourth").reason(),
        Some("TOO_MANY_HINTS")
    );
    let first = seat;
    seats[seat]
        .answer(decision.decision_id, first_legal(&decision))
        .await;
    join_all(seats.iter_mut().map(play_on)).await;
    let room = created.room.expect("a room");
    let record = client.record(&room.game_id).await.expect("a record");
    replay(&record).expect("a valid record");
    let hinted: Vec<(u32, u64, u32)> = (record.iter())
        .filter_map(|line| match &line.line {
            Some(Line::Decision(it)) if it.hints > 0 => Some((it.seat, it.decision_id, it.hints)),
            _ => None,
        })
        .collect();
    let first = u32::try_from(first).expect("a seat");
    assert_eq!(hinted, [(first, decision.decision_id, 3)]);

    let (_, tickets) = room_of_four(&client, one_shift(), tournaments::unhurried()).await;
    let refused = client.hint(&tickets[0], 1).await;
    assert_eq!(refused.expect_err("no hints").reason(), Some("HINTS_OFF"));
    server.stop().await;
}
