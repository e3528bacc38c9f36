//! A knockout that is changed by hand: one participant leaves at the first card and another is
//! removed in the final, a finalist is replaced by somebody else, the organiser pauses, postpones and
//! calls again, and the server crashes in between. Agents of the SDK play whenever it is their turn;
//! two participants are controlled step by step, so that nothing depends on who is faster.

use std::collections::BTreeSet;

use chefshat_client::{Client, RandomAgent};
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line, seat_update::Update};
use chefshat_record::replay::replay;
use chefshat_tests::{Launch, PATIENCE, StreamSeat, patiently};
use tokio::task::JoinHandle;

use crate::physical::restarted;
use crate::tournaments::{
    CALLED, create, games, id_of, join, over, play_game, seated, start, unhurried,
};

const PARTICIPANTS: usize = 8;

fn settings() -> v1::TournamentSettings {
    v1::TournamentSettings {
        format: v1::TournamentFormat::Knockout.into(),
        policy: Some(v1::RoomPolicy {
            pace_ms: Some(0),
            ..unhurried()
        }),
        // Nobody is missed: those who play reconnect after the crash.
        no_show_time_ms: 3_600_000,
        ..v1::TournamentSettings::default()
    }
}

/// An agent that plays all its games until the tournament is over for it.
fn playing(client: &Client, ticket: String) -> JoinHandle<bool> {
    let client = client.clone();
    tokio::spawn(async move {
        let played = client.play_tournament(ticket, |_: &v1::Attached| RandomAgent::new(7));
        played.await.is_ok()
    })
}

/// A stream that has entered the tournament.
async fn entered(client: &Client, ticket: &str) -> StreamSeat {
    let mut stream = StreamSeat::open(client.channel()).await;
    let attach = v1::Attach {
        ticket: ticket.to_owned(),
        ..v1::Attach::default()
    };
    stream.attach(attach).await;
    let update = stream.next().await;
    assert!(matches!(update, Update::Entered(_)), "{update:?}");
    stream
}

/// Waits for the end of a participant's seat, then of its part in the tournament.
async fn dismissed(stream: &mut StreamSeat) {
    let mut reasons = BTreeSet::new();
    while reasons.len() < 2 {
        if let Update::Detached(detached) = stream.next().await {
            reasons.insert(detached.reason());
        }
    }
    let expected = [
        v1::DetachReason::Requested,
        v1::DetachReason::TournamentOver,
    ];
    assert_eq!(reasons, BTreeSet::from(expected));
}

async fn until(client: &Client, id: &str, wanted: impl Fn(&v1::Tournament) -> bool) {
    let waiting = async {
        let mut follower = client.follow_tournament(id);
        while let Some(update) = follower.next().await.expect("an update") {
            if update.tournament.as_ref().is_some_and(&wanted) {
                return;
            }
        }
        panic!("the tournament is over");
    };
    tokio::time::timeout(PATIENCE, waiting)
        .await
        .expect("a state that must come");
}

fn participants_of(game: &v1::TournamentGame) -> Vec<u32> {
    game.seats.iter().map(|seat| seat.participant).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_knockout_changed_by_hand_counts_each_game_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path()).with("--grace", 0);
    let mut server = launch.start().await.expect("the server starts");
    let client = Client::connect(&launch.url())
        .await
        .expect("the server listens");
    let mut service = TournamentServiceClient::new(client.channel());
    let created = create(&mut service, settings()).await;
    let (id, owner) = (id_of(&created), created.owner_token.clone());

    // Ada leaves before she has played a card.
    let ada = join(&mut service, &created.join_code, "Ada").await;
    let mut ada_plays = entered(&client, &ada.ticket).await;
    let mut agents = Vec::new();
    for number in 1..PARTICIPANTS {
        let joined = join(&mut service, &created.join_code, &format!("agent {number}")).await;
        agents.push(playing(&client, joined.ticket));
    }
    until(&client, &id, |it| {
        it.participants.iter().all(|it| it.connected)
    })
    .await;
    start(&mut service, &created).await;
    seated(&mut ada_plays).await;
    let paused = client.pause_tournament(id.as_str(), owner.as_str()).await;
    assert!(paused.expect("paused").paused);
    let left = v1::WithdrawParticipantRequest {
        tournament_id: id.clone(),
        ticket: ada.ticket.clone(),
        ..v1::WithdrawParticipantRequest::default()
    };
    let left = client
        .withdraw_participant(left.clone())
        .await
        .expect("left");
    assert!(left.participants[0].withdrawn);
    dismissed(&mut ada_plays).await;

    // The server crashes, perhaps in the middle of a game.
    server = restarted(&mut launch, server).await;
    until(&client, &id, |it| it.paused && it.games_over == 2).await;
    // Until it is resumed, no round is drawn. Bo takes the place of somebody who is in the final.
    let first_round = games(&mut service, &id).await;
    assert_eq!(first_round.len(), 2);
    let mut winners = first_round
        .iter()
        .flat_map(|game| &game.seats)
        .filter(|seat| seat.place == 1 && seat.participant != ada.participant);
    let replaced = winners.next().expect("a winner").participant;
    let by = v1::ReplaceParticipantRequest {
        tournament_id: id.clone(),
        owner_token: owner.clone(),
        participant: replaced,
        name: "Bo".into(),
        ..v1::ReplaceParticipantRequest::default()
    };
    let bo = client.replace_participant(by).await.expect("replaced");
    let place = &bo.tournament.expect("a tournament").participants[replaced as usize];
    assert_eq!((place.name.as_str(), place.former.len()), ("Bo", 1));
    let mut bo_plays = entered(&client, &bo.ticket).await;
    let called = client
        .call_game(id.as_str(), owner.as_str(), first_round[0].game)
        .await
        .expect_err("it was played");
    assert_eq!(called.reason(), Some("GAME_NOT_DUE"));
    let resumed = client.resume_tournament(id.as_str(), owner.as_str()).await;
    assert!(!resumed.expect("resumed").paused);

    // Another finalist is removed while Bo decides.
    let (_, decision) = seated(&mut bo_plays).await;
    let final_game = games(&mut service, &id).await[2].clone();
    let finalists = participants_of(&final_game);
    assert!(finalists.contains(&replaced) && !finalists.contains(&ada.participant));
    let others = finalists.iter().copied().find(|it| *it != replaced);
    let removed = others.expect("another finalist");
    let postpone = v1::PostponeGameRequest {
        tournament_id: id.clone(),
        ticket: bo.ticket.clone(),
        game: final_game.game,
        ..v1::PostponeGameRequest::default()
    };
    let refused = client.postpone_game(postpone).await.expect_err("played");
    assert_eq!(refused.reason(), Some("GAME_NOT_DUE"));
    let playing = client
        .remove_participant(id.as_str(), owner.as_str(), removed)
        .await;
    assert!(playing.expect("removed").participants[removed as usize].withdrawn);
    play_game(&mut bo_plays, CALLED, decision).await;
    let tournament = over(&mut service, &id).await;
    assert_eq!(tournament.state(), v1::TournamentState::Finished);
    for agent in agents {
        let ended = patiently("the end of an agent", agent).await;
        assert!(ended.expect("no panic"), "every agent's part ends in order");
    }

    let played = games(&mut service, &id).await;
    assert_eq!(played.len(), 3);
    for game in &played {
        assert_eq!(game.state(), v1::TournamentGameState::Counted);
        let gone: Vec<u32> = (game.seats.iter())
            .filter(|seat| seat.left)
            .map(|seat| seat.participant)
            .collect();
        let expected: &[u32] = match participants_of(game) {
            all if game.game == final_game.game => {
                assert_eq!(all, finalists);
                &[removed]
            }
            all if all.contains(&ada.participant) => &[ada.participant],
            _ => &[],
        };
        assert_eq!(gone, expected);
        check_record(&client, game).await;
    }
    let results = client
        .tournament_results(id.as_str())
        .await
        .expect("results");
    assert_eq!(results.standings.len(), PARTICIPANTS);
    for standing in &results.standings {
        let seats = played.iter().flat_map(|game| &game.seats);
        let own: Vec<_> = seats
            .filter(|seat| seat.participant == standing.participant)
            .collect();
        let score: u64 = own.iter().map(|seat| u64::from(seat.score)).sum();
        assert_eq!(
            (standing.games as usize, standing.score),
            (own.len(), score)
        );
        assert_eq!(
            standing.forfeited, 0,
            "everybody who left had begun to play"
        );
    }
    assert!(server.stop().await.status.success());
}

/// The record verifies, and says who left for good.
async fn check_record(client: &Client, game: &v1::TournamentGame) {
    let lines = client.record(&game.game_id).await.expect("a record");
    replay(&lines).expect("a valid record");
    let gone = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::Substituted(it)) if it.for_good => Some(it.seat),
            _ => None,
        },
        _ => None,
    });
    let left = (0..).zip(&game.seats).filter(|(_, seat)| seat.left);
    assert_eq!(
        gone.collect::<Vec<u32>>(),
        left.map(|(seat, _)| seat).collect::<Vec<u32>>()
    );
}
