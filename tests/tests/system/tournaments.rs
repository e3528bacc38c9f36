//! Tournaments from the view of participants, over real connections: seated by the server, placed
//! last if absent. `tournament_deals` tests withheld deals, `tournament_refusals` refusals.

use chefshat_client::{Client, Connection};
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::{
    self, Answer, game_event::Kind, record_line::Line, seat_command::Command, seat_update::Update,
};
use chefshat_tests::{StreamSeat, TestServer, first_legal, one_shift, patiently};

pub(crate) type Tournaments = TournamentServiceClient<Connection>;

pub(crate) async fn create(
    service: &mut Tournaments,
    settings: v1::TournamentSettings,
) -> v1::CreateTournamentResponse {
    let settings = v1::TournamentSettings {
        name: "Coppa".into(),
        rules: Some(one_shift()),
        ..settings
    };
    let request = v1::CreateTournamentRequest {
        settings: Some(settings),
        ..Default::default()
    };
    let created = service.create_tournament(request).await;
    created.expect("created").into_inner()
}

pub(crate) async fn join(
    service: &mut Tournaments,
    code: &str,
    name: &str,
) -> v1::JoinTournamentResponse {
    let request = v1::JoinTournamentRequest {
        join_code: code.to_owned(),
        name: name.to_owned(),
        ..v1::JoinTournamentRequest::default()
    };
    join_as(service, request).await
}

pub(crate) async fn join_as(
    service: &mut Tournaments,
    request: v1::JoinTournamentRequest,
) -> v1::JoinTournamentResponse {
    let joined = service.join_tournament(request).await;
    joined.expect("joined").into_inner()
}

pub(crate) async fn start(service: &mut Tournaments, created: &v1::CreateTournamentResponse) {
    let request = v1::StartTournamentRequest {
        tournament_id: id_of(created),
        owner_token: created.owner_token.clone(),
    };
    service.start_tournament(request).await.expect("started");
}

pub(crate) fn id_of(created: &v1::CreateTournamentResponse) -> String {
    let tournament = created.tournament.as_ref();
    tournament.expect("a tournament").tournament_id.clone()
}

/// Follows a tournament until it is over.
pub(crate) async fn over(service: &mut Tournaments, tournament_id: &str) -> v1::Tournament {
    let request = v1::FollowTournamentRequest {
        tournament_id: tournament_id.to_owned(),
    };
    let follow = service.follow_tournament(request).await.expect("a stream");
    let mut follow = follow.into_inner();
    let mut last = None;
    while let Some(now) = patiently("the end", follow.message())
        .await
        .expect("no error")
    {
        last = now.tournament.or(last);
    }
    last.expect("an update")
}

async fn results(
    service: &mut Tournaments,
    tournament_id: &str,
) -> v1::GetTournamentResultsResponse {
    let request = v1::GetTournamentResultsRequest {
        tournament_id: tournament_id.to_owned(),
    };
    let results = service.get_tournament_results(request).await;
    results.expect("results").into_inner()
}

pub(crate) async fn games(
    service: &mut Tournaments,
    tournament_id: &str,
) -> Vec<v1::TournamentGame> {
    let mut all = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListTournamentGamesRequest {
            tournament_id: tournament_id.to_owned(),
            page_size: 2,
            page_token,
        };
        let page = service.list_tournament_games(request).await;
        let page = page.expect("a page").into_inner();
        all.extend(page.games);
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return all;
        }
    }
}

/// A stream attached to a participant, after its confirmation.
pub(crate) async fn entered(server: &TestServer, ticket: &str) -> StreamSeat {
    let mut stream = StreamSeat::open(server.channel().await).await;
    let attach = v1::Attach {
        ticket: ticket.to_owned(),
        request_id: 9,
        ..v1::Attach::default()
    };
    stream.attach(attach).await;
    match stream.next().await {
        Update::Entered(entered) => assert_eq!(entered.request_id, 9),
        other => panic!("not entered, but {other:?}"),
    }
    stream
}

/// First handle of seats that the server attaches.
pub(crate) const CALLED: u32 = 1 << 31;

/// A game of three built-in agents and one participant.
fn three_and_one() -> v1::TournamentSettings {
    v1::TournamentSettings {
        format: v1::TournamentFormat::RoundRobin.into(),
        rounds: 1,
        built_in_agents: vec!["random".into(); 3],
        policy: Some(unhurried()),
        ..v1::TournamentSettings::default()
    }
}

/// A policy under which no decision times out.
pub(crate) fn unhurried() -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(3_600_000),
        ..v1::RoomPolicy::default()
    }
}

/// The next room in which the server seats a participant, and its first decision there.
pub(crate) async fn seated(stream: &mut StreamSeat) -> (String, v1::DecisionRequest) {
    // The numbers of events start again.
    stream.last_event = 0;
    let room = match stream.next().await {
        Update::Attached(attached) => attached.room_id,
        other => panic!("not attached, but {other:?}"),
    };
    (room, stream.decision().await)
}

/// Plays a game from this decision to its end with first legal actions; returns the last event.
pub(crate) async fn play_game(
    stream: &mut StreamSeat,
    handle: u32,
    mut decision: v1::DecisionRequest,
) -> v1::GameEvent {
    loop {
        let answer = Answer {
            decision_id: decision.decision_id,
            action: first_legal(&decision),
            annotations: None,
        };
        stream.send_to(handle, Command::Answer(answer)).await;
        decision = loop {
            match stream.next().await {
                Update::Decision(decision) => break decision,
                Update::Result(_) => {}
                Update::Detached(detached) => {
                    assert_eq!(detached.reason(), v1::DetachReason::GameOver);
                    return stream.events.last().cloned().expect("the game ended");
                }
                other => panic!("unexpected {other:?}"),
            }
        };
    }
}

#[tokio::test]
async fn the_server_seats_a_participant_in_each_of_its_games() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            format: v1::TournamentFormat::RoundRobin.into(),
            rounds: 3,
            built_in_agents: vec!["random".into(); 3],
            ..v1::TournamentSettings::default()
        },
    )
    .await;
    let joined = join(&mut service, &created.join_code.to_lowercase(), "Ada").await;
    assert_eq!(joined.participant, 3);
    let mut stream = entered(&server, &joined.ticket).await;
    start(&mut service, &created).await;
    let mut rooms = Vec::new();
    for game in 0..3 {
        let attached = match stream.next().await {
            Update::Attached(attached) => attached,
            other => panic!("not attached, but {other:?}"),
        };
        assert_eq!(attached.tournament_id, id_of(&created));
        rooms.push(attached.room_id);
        // The numbers of events start again.
        stream.last_event = 0;
        let mut reason = None;
        while reason.is_none() {
            match stream.next().await {
                Update::Decision(decision) => {
                    let answer = Answer {
                        decision_id: decision.decision_id,
                        action: first_legal(&decision),
                        annotations: None,
                    };
                    (stream.send_to(CALLED + game, Command::Answer(answer))).await;
                }
                Update::Result(_) => {}
                Update::Detached(detached) => reason = Some(detached.reason()),
                other => panic!("unexpected {other:?}"),
            }
        }
        assert_eq!(reason, Some(v1::DetachReason::GameOver));
    }
    match stream.next().await {
        Update::Detached(detached) => {
            assert_eq!(detached.reason(), v1::DetachReason::TournamentOver);
        }
        other => panic!("unexpected {other:?}"),
    }
    let tournament = over(&mut service, &id_of(&created)).await;
    assert_eq!(tournament.state(), v1::TournamentState::Finished);
    let results = results(&mut service, &id_of(&created)).await;
    assert_eq!(results.standings.len(), 4);
    assert_eq!(results.confidence.len(), 3);
    let games = games(&mut service, &id_of(&created)).await;
    let played: Vec<&String> = games.iter().map(|game| &game.room_id).collect();
    assert_eq!(played, rooms.iter().collect::<Vec<_>>());
    for standing in &results.standings {
        let seats = games.iter().flat_map(|game| &game.seats);
        let score = seats
            .filter(|seat| seat.participant == standing.participant)
            .map(|seat| u64::from(seat.score));
        assert_eq!(standing.score, score.sum::<u64>());
        assert_eq!(
            (standing.games, standing.rating.map(|r| r.games)),
            (3, Some(3))
        );
    }
    // The records belong to games of this tournament, with the names of its participants.
    let client = Client::connect(server.url())
        .await
        .expect("the server listens");
    for game in &games {
        let lines = client.record(&game.game_id).await.expect("a record");
        let Some(Line::Header(header)) = &lines[0].line else {
            panic!("no header");
        };
        assert_eq!(header.tournament_id, id_of(&created));
        assert!(header.seats.iter().any(|seat| seat.name == "Ada"));
        chefshat_record::replay::replay(&lines).expect("a valid record");
    }
}

#[tokio::test]
async fn an_absent_participant_forfeits_and_the_others_play() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 1,
            built_in_agents: vec!["greedy".into(), "random".into(), "trained".into()],
            no_show_time_ms: 1_000,
            max_calls: 2,
            start_when_joined: 4,
            ..v1::TournamentSettings::default()
        },
    )
    .await;
    let joined = join(&mut service, &created.join_code, "nobody").await;
    over(&mut service, &id_of(&created)).await;
    let games = games(&mut service, &id_of(&created)).await;
    assert_eq!(games.len(), 1);
    assert_eq!(games[0].state(), v1::TournamentGameState::Counted);
    assert_eq!(games[0].calls, 2);
    assert!(!games[0].rated);
    let results = results(&mut service, &id_of(&created)).await;
    let last = results.standings.last().expect("four");
    assert_eq!(last.participant, joined.participant);
    assert_eq!((last.score, last.forfeited), (0, 1));
    let scores: Vec<u64> = results.standings.iter().map(|it| it.score).collect();
    assert_eq!(scores, [5, 3, 1, 0]);
}

#[tokio::test]
async fn the_newest_stream_gets_the_participant() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(&mut service, three_and_one()).await;
    let joined = join(&mut service, &created.join_code, "Ada").await;
    let mut older = entered(&server, &joined.ticket).await;
    start(&mut service, &created).await;
    let (room, asked) = seated(&mut older).await;
    let mut newer = entered(&server, &joined.ticket).await;
    // Both of its participant and of the seat that the server attached.
    for _ in 0..2 {
        match older.next().await {
            Update::Detached(detached) => {
                assert_eq!(detached.reason(), v1::DetachReason::Superseded);
            }
            other => panic!("not detached, but {other:?}"),
        }
    }
    let (again, decision) = seated(&mut newer).await;
    assert_eq!((&again, decision.decision_id), (&room, asked.decision_id));
    // Messages of the older one are ignored: this would be an invalid attempt, or the answer.
    let nonsense = Answer {
        decision_id: decision.decision_id,
        action: 9_999,
        annotations: None,
    };
    older.send_to(CALLED, Command::Answer(nonsense)).await;
    let ended = play_game(&mut newer, CALLED, decision).await;
    assert!(matches!(ended.kind, Some(Kind::GameEnded(_))), "{ended:?}");
    let tournament = over(&mut service, &id_of(&created)).await;
    assert_eq!(tournament.state(), v1::TournamentState::Finished);
    let games = games(&mut service, &id_of(&created)).await;
    assert!(games[0].rated, "no substitute took a decision");
    let wrong = games[0].seats.iter().map(|seat| seat.wrong_actions);
    assert_eq!(wrong.sum::<u64>(), 0);
}

#[tokio::test]
async fn a_tournament_closed_in_mid_game_counts_no_more_games() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            rounds: 2,
            ..three_and_one()
        },
    )
    .await;
    let joined = join(&mut service, &created.join_code, "Ada").await;
    let mut stream = entered(&server, &joined.ticket).await;
    start(&mut service, &created).await;
    let (_, decision) = seated(&mut stream).await;
    play_game(&mut stream, CALLED, decision).await;
    let (room, _) = seated(&mut stream).await;
    let close = v1::CloseTournamentRequest {
        tournament_id: id_of(&created),
        owner_token: created.owner_token.clone(),
    };
    let closed = service.close_tournament(close).await.expect("closed");
    let closed = closed.into_inner().tournament.expect("a tournament");
    assert_eq!(closed.state(), v1::TournamentState::Closed);
    let results = results(&mut service, &id_of(&created)).await;
    let state = results.tournament.map(|tournament| tournament.state());
    assert_eq!(state, Some(v1::TournamentState::Closed));
    assert!(results.standings.iter().all(|standing| standing.games == 1));
    let games = games(&mut service, &id_of(&created)).await;
    let states: Vec<_> = games.iter().map(v1::TournamentGame::state).collect();
    let (counted, void) = (
        v1::TournamentGameState::Counted,
        v1::TournamentGameState::Void,
    );
    assert_eq!(states, [counted, void]);
    assert_eq!(games[1].room_id, room);
    // The client receives both ends, in either order.
    let mut reasons = Vec::new();
    while reasons.len() < 2 {
        match stream.next().await {
            Update::Detached(detached) => reasons.push(detached.reason()),
            other => panic!("unexpected {other:?}"),
        }
    }
    assert!(reasons.contains(&v1::DetachReason::TournamentOver));
    let aborted = stream.events.last().and_then(|event| event.kind.as_ref());
    assert!(matches!(aborted, Some(Kind::GameAborted(_))), "{aborted:?}");
    let last = over(&mut service, &id_of(&created)).await;
    assert_eq!(last.state(), v1::TournamentState::Closed);
}
