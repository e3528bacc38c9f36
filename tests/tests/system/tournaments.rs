//! Tournaments as participants live them, over real connections: seated by the server, told nothing of deals that others still play, placed
//! last when they do not come.

use std::collections::BTreeMap;

use chefshat_client::Client;
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::{
    self, Answer, game_event::Kind, record_line::Line, seat_command::Command, seat_update::Update,
};
use chefshat_tests::{StreamSeat, TestServer, first_legal, one_shift, patiently};
use tonic::Code;
use tonic::transport::Channel;
use tonic_types::StatusExt as _;

type Tournaments = TournamentServiceClient<Channel>;

async fn create(
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
    };
    let created = service.create_tournament(request).await;
    created.expect("the tournament is made").into_inner()
}

async fn join(service: &mut Tournaments, code: &str, name: &str) -> v1::JoinTournamentResponse {
    let request = v1::JoinTournamentRequest {
        join_code: code.to_owned(),
        name: name.to_owned(),
        ..v1::JoinTournamentRequest::default()
    };
    let joined = service.join_tournament(request).await;
    joined.expect("there is a place").into_inner()
}

async fn start(service: &mut Tournaments, created: &v1::CreateTournamentResponse) {
    let request = v1::StartTournamentRequest {
        tournament_id: id_of(created),
        owner_token: created.owner_token.clone(),
    };
    service.start_tournament(request).await.expect("it begins");
}

fn id_of(created: &v1::CreateTournamentResponse) -> String {
    let tournament = created.tournament.as_ref();
    tournament.expect("a tournament").tournament_id.clone()
}

/// Follows a tournament until it is over.
async fn over(service: &mut Tournaments, tournament_id: &str) -> v1::Tournament {
    let request = v1::FollowTournamentRequest {
        tournament_id: tournament_id.to_owned(),
    };
    let follow = service.follow_tournament(request).await.expect("it may");
    let mut follow = follow.into_inner();
    let mut last = None;
    while let Some(now) = patiently("the end", follow.message())
        .await
        .expect("no error")
    {
        last = now.tournament.or(last);
    }
    last.expect("it was told of")
}

async fn results(
    service: &mut Tournaments,
    tournament_id: &str,
) -> v1::GetTournamentResultsResponse {
    let request = v1::GetTournamentResultsRequest {
        tournament_id: tournament_id.to_owned(),
    };
    let results = service.get_tournament_results(request).await;
    results.expect("there are some").into_inner()
}

async fn games(service: &mut Tournaments, tournament_id: &str) -> Vec<v1::TournamentGame> {
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

/// A stream attached to a participant, which is told so.
async fn entered(server: &TestServer, ticket: &str) -> StreamSeat {
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
const CALLED: u32 = 1 << 31;

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
        // The numbers of events begin anew.
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
    // The records are those of games of this tournament, by the names under which its participants joined.
    let client = Client::connect(server.url()).await.expect("it listens");
    for game in &games {
        let lines = client.record(&game.game_id).await.expect("it has ended");
        let Some(Line::Header(header)) = &lines[0].line else {
            panic!("no header");
        };
        assert_eq!(header.tournament_id, id_of(&created));
        assert!(header.seats.iter().any(|seat| seat.name == "Ada"));
        chefshat_records::replay::replay(&lines).expect("it replays");
    }
}

#[tokio::test]
async fn who_does_not_come_forfeits_and_the_others_play() {
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
async fn deals_that_others_still_play_are_told_to_nobody() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            format: v1::TournamentFormat::RoundRobin.into(),
            rounds: 1,
            deals: v1::TournamentDeals::SameAtAllTables.into(),
            built_in_agents: vec!["random".into(); 7],
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(3_600_000),
                ..v1::RoomPolicy::default()
            }),
            ..v1::TournamentSettings::default()
        },
    )
    .await;
    let joined = join(&mut service, &created.join_code, "Ada").await;
    let mut stream = StreamSeat::open(server.channel().await).await;
    stream
        .attach(v1::Attach {
            ticket: joined.ticket,
            // What one table adds to the seed must not make its deals other ones.
            entropy: vec![1; 32],
            ..v1::Attach::default()
        })
        .await;
    start(&mut service, &created).await;
    assert!(matches!(stream.next().await, Update::Entered(_)));
    assert!(matches!(stream.next().await, Update::Attached(_)));
    let mut decision = match stream.next().await {
        Update::Decision(decision) => decision,
        other => panic!("no decision, but {other:?}"),
    };
    let client = Client::connect(server.url()).await.expect("it listens");
    // The built-in agents' table has ended, or will without us.
    let done = loop {
        let games = games(&mut service, &id_of(&created)).await;
        let counted = games
            .into_iter()
            .find(|game| game.state() == v1::TournamentGameState::Counted);
        if let Some(done) = counted {
            break done;
        }
        tokio::task::yield_now().await;
    };
    let refused = client
        .record(&done.game_id)
        .await
        .expect_err("it is closed");
    assert_eq!(refused.reason(), Some("SERIES_OPEN"));
    let watched = client.spectate(&done.room_id, 0).next().await;
    assert!(watched.is_err(), "nobody may watch");
    // Then we play on.
    let mut ended = None;
    loop {
        let answer = Answer {
            decision_id: decision.decision_id,
            action: first_legal(&decision),
            annotations: None,
        };
        stream.send_to(CALLED, Command::Answer(answer)).await;
        decision = loop {
            match stream.next().await {
                Update::Decision(decision) => break decision,
                Update::Detached(_) => {
                    ended = stream.events.last().cloned();
                    break v1::DecisionRequest::default();
                }
                _ => {}
            }
        };
        if ended.is_some() {
            break;
        }
    }
    match ended.and_then(|event| event.kind) {
        Some(Kind::GameEnded(ended)) => assert_eq!(ended.reveal, None, "it stands in the record"),
        other => panic!("the game did not end: {other:?}"),
    }
    over(&mut service, &id_of(&created)).await;
    let games = games(&mut service, &id_of(&created)).await;
    assert_eq!(games.len(), 2);
    assert_eq!(games[0].series_id, games[1].series_id);
    let mut seeds = BTreeMap::new();
    for game in &games {
        let lines = client.record(&game.game_id).await.expect("it is open now");
        chefshat_records::replay::replay(&lines).expect("it replays");
        let reveal = lines.iter().rev().find_map(|line| match &line.line {
            Some(Line::Event(event)) => match &event.kind {
                Some(Kind::GameEnded(ended)) => ended.reveal.clone(),
                _ => None,
            },
            _ => None,
        });
        let reveal = reveal.expect("the record reveals it");
        seeds.insert(reveal.game_seed, reveal.nonce);
    }
    assert_eq!(seeds.len(), 1, "both tables were dealt alike");
}

#[tokio::test]
async fn what_cannot_be_is_refused_by_name() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let swiss = v1::TournamentFormat::Swiss.into();
    let named = |format| v1::TournamentSettings {
        name: "Coppa".into(),
        format,
        ..v1::TournamentSettings::default()
    };
    let cases = [
        (named(0), "SETTINGS_REFUSED", "format"),
        (
            v1::TournamentSettings {
                name: String::new(),
                ..named(swiss)
            },
            "NAME_REFUSED",
            "name",
        ),
        (
            v1::TournamentSettings {
                rules: Some(v1::RuleSet {
                    players: Some(9),
                    ..v1::RuleSet::default()
                }),
                ..named(swiss)
            },
            "RULE_SET_REFUSED",
            "rules",
        ),
        (
            v1::TournamentSettings {
                policy: Some(v1::RoomPolicy {
                    abort: v1::AbortPolicy::AnyLost.into(),
                    ..v1::RoomPolicy::default()
                }),
                ..named(swiss)
            },
            "POLICY_REFUSED",
            "policy",
        ),
        (
            v1::TournamentSettings {
                deals: v1::TournamentDeals::SameAtAllTables.into(),
                policy: Some(v1::RoomPolicy {
                    spectators: Some(true),
                    ..v1::RoomPolicy::default()
                }),
                ..named(swiss)
            },
            "POLICY_REFUSED",
            "policy",
        ),
        (
            v1::TournamentSettings {
                built_in_agents: vec!["nobody".into()],
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "built_in_agents",
        ),
        (
            v1::TournamentSettings {
                draw_seed: vec![1],
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "draw_seed",
        ),
        (
            v1::TournamentSettings {
                max_calls: 99,
                ..named(swiss)
            },
            "SETTINGS_REFUSED",
            "max_calls",
        ),
    ];
    for (settings, reason, field) in cases {
        let request = v1::CreateTournamentRequest {
            settings: Some(settings),
        };
        let refused = service.create_tournament(request).await;
        let refused = refused.expect_err("it is refused");
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
        let info = refused.get_details_error_info().expect("it says why");
        assert_eq!(info.reason, reason);
        assert_eq!(info.metadata["field"], field);
    }
    let created = create(
        &mut service,
        v1::TournamentSettings {
            deals: v1::TournamentDeals::Rotated.into(),
            kinds: vec![v1::ParticipantKind::Agent.into()],
            max_participants: 2,
            ..named(swiss)
        },
    )
    .await;
    let ask = |name: &str| v1::JoinTournamentRequest {
        join_code: created.join_code.clone(),
        name: name.to_owned(),
        stateless: true,
        ..v1::JoinTournamentRequest::default()
    };
    let first = service.join_tournament(ask("Ada")).await;
    first.expect("there is a place");
    let joins = [
        (
            v1::JoinTournamentRequest {
                join_code: "WRONG".into(),
                ..ask("Bo")
            },
            "JOIN_CODE_WRONG",
        ),
        (
            v1::JoinTournamentRequest {
                tournament_id: "0".repeat(32),
                ..ask("Bo")
            },
            "TOURNAMENT_UNKNOWN",
        ),
        (
            v1::JoinTournamentRequest {
                kind: v1::ParticipantKind::Human.into(),
                ..ask("Bo")
            },
            "KIND_NOT_ADMITTED",
        ),
        (
            v1::JoinTournamentRequest {
                stateless: false,
                ..ask("Bo")
            },
            "NOT_STATELESS",
        ),
        (
            v1::JoinTournamentRequest {
                max_games: 65,
                ..ask("Bo")
            },
            "MAX_GAMES_REFUSED",
        ),
        (ask(" Ada "), "NAME_TAKEN"),
        (ask(""), "NAME_REFUSED"),
    ];
    for (request, reason) in joins {
        let refused = service.join_tournament(request).await;
        let refused = refused.expect_err("it is refused");
        let info = refused.get_details_error_info().expect("it says why");
        assert_eq!(info.reason, reason);
    }
    let early = v1::StartTournamentRequest {
        tournament_id: id_of(&created),
        owner_token: created.owner_token.clone(),
    };
    let stranger = v1::StartTournamentRequest {
        owner_token: "00".repeat(48),
        ..early.clone()
    };
    for (request, reason) in [
        (stranger, "OWNER_TOKEN_WRONG"),
        (early, "TOO_FEW_PARTICIPANTS"),
    ] {
        let refused = service.start_tournament(request).await;
        let refused = refused.expect_err("it is refused");
        let info = refused.get_details_error_info().expect("it says why");
        assert_eq!(info.reason, reason);
    }
    // Closed, it takes nobody any more.
    let close = v1::CloseTournamentRequest {
        tournament_id: id_of(&created),
        owner_token: created.owner_token.clone(),
    };
    let closed = service
        .close_tournament(close)
        .await
        .expect("its owner may");
    let closed = closed.into_inner().tournament.expect("a tournament");
    assert_eq!(closed.state(), v1::TournamentState::Closed);
    let refused = service.join_tournament(ask("Bo")).await;
    assert_eq!(
        refused.expect_err("it is over").code(),
        Code::FailedPrecondition
    );
}
