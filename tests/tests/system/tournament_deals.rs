//! Deals that others still play: nothing that could reveal them is published before the last game
//! with the deal has ended, and everything afterwards.

use std::collections::BTreeSet;

use chefshat_client::Client;
use chefshat_proto::v1::{
    self, game_event::Kind, record_line::Line, record_service_client::RecordServiceClient,
    seat_update::Update, tournament_service_client::TournamentServiceClient, vector_setup,
};
use chefshat_tests::{StreamSeat, TestServer, patiently};
use futures::TryStreamExt as _;

use crate::played::{all_recorded, point};
use crate::tournaments::{
    CALLED, Tournaments, create, entered, games, id_of, join, join_as, over, play_game, seated,
    start, unhurried,
};
use crate::vectors::setup;

/// The first counted game of the tournament.
pub(crate) async fn counted(service: &mut Tournaments, tournament_id: &str) -> v1::TournamentGame {
    let request = v1::FollowTournamentRequest {
        tournament_id: tournament_id.to_owned(),
    };
    let follow = service.follow_tournament(request).await.expect("a stream");
    let mut follow = follow.into_inner();
    loop {
        let games = games(service, tournament_id).await;
        let counted = |game: &v1::TournamentGame| game.state() == v1::TournamentGameState::Counted;
        if let Some(game) = games.into_iter().find(counted) {
            return game;
        }
        let update = follow.message().await.expect("no error");
        assert!(update.is_some(), "the tournament continues");
    }
}

/// Checks that nothing that could reveal the deals of a game is accessible.
pub(crate) async fn withheld(client: &Client, game: &v1::TournamentGame) {
    let id = game.game_id.as_str();
    let refused = client.record(id).await.expect_err("a withheld record");
    assert_eq!(refused.reason(), Some("SERIES_OPEN"));
    assert_eq!(streamed(client).await, BTreeSet::new());
    let watched = client.spectate(&game.room_id, 0).next().await;
    let refused = watched.expect_err("spectators are refused");
    assert_eq!(refused.reason(), Some("SPECTATORS_NOT_ADMITTED"));
    let from_it = v1::CreateRoomRequest {
        start: point(id, 1, true),
        ..v1::CreateRoomRequest::default()
    };
    let with_its_players = v1::CreateRoomRequest {
        seats: all_recorded(id),
        ..v1::CreateRoomRequest::default()
    };
    for request in [from_it, with_its_players] {
        let refused = client
            .create_room(request)
            .await
            .expect_err("a withheld record");
        assert_eq!(refused.reason(), Some("SERIES_OPEN"));
    }
    let games = v1::VectorSetup {
        start: Some(vector_setup::Start::Branch(v1::BranchPoint {
            game_id: id.to_owned(),
            decisions: 1,
            same_deals: true,
        })),
        ..setup(1, 1)
    };
    let refused = client.vector(games).await.expect_err("a withheld record");
    assert_eq!(refused.reason(), Some("SERIES_OPEN"));
}

/// The games whose records a stream contains.
pub(crate) async fn streamed(client: &Client) -> BTreeSet<String> {
    let mut service = RecordServiceClient::new(client.channel());
    let stream = service.stream_records(v1::StreamRecordsRequest::default());
    let stream = stream.await.expect("a stream").into_inner();
    let parts: Vec<v1::StreamRecordsResponse> =
        patiently("the stream to end", stream.try_collect())
            .await
            .expect("no error");
    let lines = parts.into_iter().flat_map(|part| part.lines);
    lines
        .filter_map(|line| match line.line {
            Some(Line::Header(header)) => Some(header.game_id),
            _ => None,
        })
        .collect()
}

/// Checks that all records of a finished tournament are accessible, and have the same deals.
async fn open_and_alike(client: &Client, games: &[v1::TournamentGame]) {
    let mut seeds = BTreeSet::new();
    for game in games {
        let lines = client
            .record(&game.game_id)
            .await
            .expect("an accessible record");
        chefshat_record::replay::replay(&lines).expect("a valid record");
        let reveal = lines.iter().rev().find_map(|line| match &line.line {
            Some(Line::Event(event)) => match &event.kind {
                Some(Kind::GameEnded(ended)) => ended.reveal.clone(),
                _ => None,
            },
            _ => None,
        });
        seeds.insert(reveal.expect("a revealed seed").game_seed);
        assert_eq!(game.series_id, games[0].series_id);
    }
    assert_eq!(seeds.len(), 1, "all games had the same deals");
    let all: BTreeSet<String> = games.iter().map(|game| game.game_id.clone()).collect();
    assert_eq!(streamed(client).await, all);
}

#[tokio::test]
async fn deals_that_other_tables_still_play_are_withheld() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            format: v1::TournamentFormat::RoundRobin.into(),
            rounds: 1,
            deals: v1::TournamentDeals::SameAtAllTables.into(),
            built_in_agents: vec!["random".into(); 7],
            policy: Some(unhurried()),
            ..v1::TournamentSettings::default()
        },
    )
    .await;
    let joined = join(&mut service, &created.join_code, "Ada").await;
    let mut stream = StreamSeat::open(server.channel().await).await;
    stream
        .attach(v1::Attach {
            ticket: joined.ticket,
            // A table's contribution to the seed must not change its deals.
            entropy: vec![1; 32],
            ..v1::Attach::default()
        })
        .await;
    start(&mut service, &created).await;
    assert!(matches!(stream.next().await, Update::Entered(_)));
    let (_, decision) = seated(&mut stream).await;
    let client = Client::connect(server.url())
        .await
        .expect("the server listens");
    // The built-in agents' table ends without this client.
    let id = id_of(&created);
    let done = patiently("the other table's end", counted(&mut service, &id)).await;
    withheld(&client, &done).await;
    // Then this client plays on.
    let ended = play_game(&mut stream, CALLED, decision).await;
    match ended.kind {
        Some(Kind::GameEnded(ended)) => assert_eq!(ended.reveal, None, "it is only in the record"),
        other => panic!("the game did not end: {other:?}"),
    }
    over(&mut service, &id).await;
    let games = games(&mut service, &id).await;
    assert_eq!(games.len(), 2);
    open_and_alike(&client, &games).await;
}

#[tokio::test]
async fn a_deal_that_is_played_again_is_withheld_until_its_last_game_has_ended() {
    let server = TestServer::start().await;
    let mut service = TournamentServiceClient::new(server.channel().await);
    let created = create(
        &mut service,
        v1::TournamentSettings {
            format: v1::TournamentFormat::RoundRobin.into(),
            rounds: 1,
            deals: v1::TournamentDeals::Rotated.into(),
            built_in_agents: vec!["random".into(); 3],
            policy: Some(unhurried()),
            ..v1::TournamentSettings::default()
        },
    )
    .await;
    let ada = v1::JoinTournamentRequest {
        join_code: created.join_code.clone(),
        name: "Ada".into(),
        stateless: true,
        ..v1::JoinTournamentRequest::default()
    };
    let joined = join_as(&mut service, ada).await;
    let mut stream = entered(&server, &joined.ticket).await;
    start(&mut service, &created).await;
    let client = Client::connect(server.url())
        .await
        .expect("the server listens");
    let id = id_of(&created);
    for game in 0..4 {
        let (room, decision) = seated(&mut stream).await;
        let before = games(&mut service, &id).await;
        assert_eq!(before.len(), 4);
        assert_eq!(before[game].room_id, room);
        for done in &before[..game] {
            assert_eq!(done.state(), v1::TournamentGameState::Counted);
            withheld(&client, done).await;
        }
        let handle = CALLED + u32::try_from(game).expect("a few");
        play_game(&mut stream, handle, decision).await;
    }
    over(&mut service, &id).await;
    let games = games(&mut service, &id).await;
    open_and_alike(&client, &games).await;
}
