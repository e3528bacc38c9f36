//! A seat that is followed, whose stream breaks.

use chefshat_client::v1::{self, game_event::Kind, seat_command::Command, seat_update::Update};
use chefshat_client::{Followed, PlayError, SeatFollower, TicketFollower};
use tonic::Status;

use crate::fake::{Fake, Line, event};
use crate::play::quick;

/// Request id of the ticket that is followed.
const TICKET: u32 = u32::MAX;

fn events(numbers: impl IntoIterator<Item = u64>) -> Update {
    let events = numbers.into_iter().map(event).collect();
    Update::Events(v1::EventBatch { events })
}

fn ending(sequence: u64) -> Update {
    let end = Kind::GameEnded(Box::default());
    let events = vec![v1::GameEvent {
        kind: Some(end),
        ..event(sequence)
    }];
    Update::Events(v1::EventBatch { events })
}

fn decision(decision_id: u64) -> Update {
    Update::Decision(v1::DecisionRequest {
        decision_id,
        ..v1::DecisionRequest::default()
    })
}

fn attached() -> Update {
    Update::Attached(v1::Attached {
        request_id: TICKET,
        game_id: "game".to_owned(),
        ..v1::Attached::default()
    })
}

fn detached(reason: v1::DetachReason) -> Update {
    let reason = reason.into();
    Update::Detached(v1::Detached { reason })
}

async fn follower(fake: &Fake) -> SeatFollower {
    let client = fake.start().await;
    client.follow_seat("ticket").with_backoff(quick().backoff)
}

#[tokio::test]
async fn events_come_once_and_open_decisions_again_across_lost_streams() {
    let fake = Fake::default();
    fake.follow(vec![
        Ok(vec![attached(), events([1, 2])]),
        Ok(vec![]),
        Ok(vec![decision(1)]),
        Err(Status::unavailable("lost")),
    ]);
    // It stops in an orderly manner.
    fake.follow(vec![
        Ok(vec![attached(), events([2, 3]), decision(1)]),
        Ok(vec![detached(v1::DetachReason::ServerStopping)]),
    ]);
    fake.follow(vec![
        Ok(vec![attached(), events([3])]),
        Ok(vec![ending(4), detached(v1::DetachReason::GameOver)]),
    ]);
    let mut seat = follower(&fake).await;
    let mut updates = Vec::new();
    while let Some(update) = seat.next().await.unwrap() {
        updates.push(update);
    }
    let expected = [
        attached(),
        events([1, 2]),
        decision(1),
        attached(),
        events([3]),
        decision(1),
        attached(),
        ending(4),
    ];
    assert_eq!(updates, expected);
    assert!(fake.is_done());
    let asked = fake.attached();
    let from: Vec<u64> = asked.iter().map(|it| it.from_sequence).collect();
    assert_eq!(from, [1, 3, 4]);
    // The contribution to the seed is the same on every connection.
    assert_eq!(asked[0].entropy.len(), 32);
    assert!(asked.iter().all(|it| it.entropy == asked[0].entropy));
}

#[tokio::test]
async fn events_that_a_snapshot_stands_for_are_not_asked_for_again() {
    let fake = Fake::default();
    let snapshot = Update::Snapshot(Box::new(v1::Snapshot {
        next_sequence: 5_000,
        ..v1::Snapshot::default()
    }));
    fake.follow(vec![
        Ok(vec![attached(), snapshot.clone()]),
        Err(Status::unavailable("lost")),
    ]);
    fake.follow(vec![Ok(vec![
        attached(),
        ending(5_000),
        detached(v1::DetachReason::GameOver),
    ])]);
    let mut seat = follower(&fake).await;
    assert_eq!(seat.next().await.unwrap(), Some(attached()));
    assert_eq!(seat.next().await.unwrap(), Some(snapshot));
    while seat.next().await.unwrap().is_some() {}
    let from: Vec<u64> = (fake.attached().iter())
        .map(|it| it.from_sequence)
        .collect();
    assert_eq!(from, [1, 5_000]);
}

#[tokio::test]
async fn a_seat_that_is_lost_says_why_after_what_came_before() {
    let refused = Update::Refused(v1::Refused {
        request_id: TICKET,
        reason: "TICKET_UNKNOWN".to_owned(),
        ..v1::Refused::default()
    });
    let table = [
        (detached(v1::DetachReason::Superseded), "SUPERSEDED"),
        (detached(v1::DetachReason::Requested), "DETACHED"),
        (detached(v1::DetachReason::GameOver), "ENDING_UNKNOWN"),
        (refused, "TICKET_UNKNOWN"),
    ];
    for (last, reason) in table {
        let fake = Fake::default();
        fake.follow(vec![Ok(vec![attached(), events([1]), last])]);
        let mut seat = follower(&fake).await;
        assert_eq!(seat.next().await.unwrap(), Some(attached()));
        assert_eq!(seat.next().await.unwrap(), Some(events([1])));
        let failure: PlayError = seat.next().await.unwrap_err();
        assert_eq!(failure.reason(), Some(reason));
        assert_eq!(seat.next().await.unwrap(), None);
    }
}

#[tokio::test]
async fn a_stream_that_breaks_after_the_end_of_the_game_is_not_opened_again() {
    let fake = Fake::default();
    fake.follow(vec![
        Ok(vec![attached(), ending(1)]),
        Err(Status::unavailable("lost")),
    ]);
    let mut seat = follower(&fake).await;
    assert_eq!(seat.next().await.unwrap(), Some(attached()));
    assert_eq!(seat.next().await.unwrap(), Some(ending(1)));
    assert_eq!(seat.next().await.unwrap(), None);
    assert_eq!(fake.attached().len(), 1);
}

/// First handle of the seats that the server attaches.
const GAMES: u32 = 1 << 31;

fn entered() -> Update {
    Update::Entered(v1::Entered {
        request_id: TICKET,
        ..v1::Entered::default()
    })
}

/// The seat of a game, attached by the server (request id 0) or because it was asked for.
fn seated(request_id: u32, game: &str) -> Update {
    Update::Attached(v1::Attached {
        request_id,
        game_id: game.to_owned(),
        ticket: format!("ticket of {game}"),
        ..v1::Attached::default()
    })
}

fn refused(request_id: u32) -> Update {
    Update::Refused(v1::Refused {
        request_id,
        message: "no such seat".to_owned(),
        ..v1::Refused::default()
    })
}

async fn ticket_follower(fake: &Fake) -> TicketFollower {
    let client = fake.start().await;
    client.follow_ticket("cup").with_backoff(quick().backoff)
}

/// What a follower learns up to the end, in short.
async fn learnt(follower: &mut TicketFollower) -> Vec<String> {
    let mut lines = Vec::new();
    loop {
        lines.push(match follower.next().await {
            Ok(Some(Followed::Entered(_))) => "entered".to_owned(),
            Ok(Some(Followed::Update(game, update))) => match *update {
                Update::Attached(_) => format!("{game} attached"),
                Update::Events(batch) => {
                    let numbers = batch.events.iter().map(|event| event.sequence);
                    format!("{game} {:?}", numbers.collect::<Vec<_>>())
                }
                Update::Decision(request) => {
                    let answer = v1::Answer::default();
                    follower.send(&game, Command::Answer(answer)).await;
                    format!("{game} decides {}", request.decision_id)
                }
                other => panic!("{other:?}"),
            },
            Ok(Some(Followed::Gone(game, why))) => format!("{game} gone: {}", why.message()),
            Ok(Some(Followed::Lost(why))) => format!("lost: {}", why.message()),
            Ok(None) => return lines,
            Err(error) => {
                lines.push(format!("failed: {}", error.message()));
                return lines;
            }
        });
    }
}

#[tokio::test]
async fn the_games_of_a_participant_are_followed_across_lost_streams() {
    let fake = Fake::default();
    fake.follow_all(vec![
        Ok(vec![
            (0, entered()),
            (GAMES, seated(0, "a")),
            (GAMES, events([1, 2])),
            (GAMES + 1, seated(0, "b")),
            (GAMES + 1, ending(1)),
            (GAMES + 2, seated(0, "c")),
        ]),
        Err(Status::unavailable("no more")),
    ]);
    fake.play(async |mut line: Line| {
        let commands = line.heard().await.into_iter();
        let asked = commands.map(|command| match command.command {
            Some(Command::Attach(it)) => format!("{} from {}", it.ticket, it.from_sequence),
            other => panic!("not an attachment: {other:?}"),
        });
        let asked: Vec<_> = asked.collect();
        // The result of b is known.
        assert_eq!(
            asked,
            ["ticket of a from 3", "ticket of c from 1", "cup from 1"]
        );
        line.says(vec![
            (2, entered()),
            (GAMES, seated(0, "a")),
            // Refused late: the server has just attached it with its participant.
            (0, refused(1)),
            (1, refused(3)),
            // The server has not counted the end of b, since the connection was lost.
            (GAMES + 1, seated(0, "b")),
            (GAMES + 1, ending(1)),
            (GAMES, events([2, 3])),
        ])
        .await;
        let left = line.heard().await;
        assert_eq!(left.len(), 1);
        assert_eq!(left[0].handle, GAMES + 1);
        assert!(matches!(left[0].command, Some(Command::Detach(_))));
        line.says(vec![(GAMES, decision(7))]).await;
        let answered = line.heard().await;
        assert_eq!(answered[0].handle, GAMES);
        assert!(matches!(answered[0].command, Some(Command::Answer(_))));
        line.says(vec![
            (2, detached(v1::DetachReason::TournamentOver)),
            (GAMES, ending(4)),
            (GAMES, detached(v1::DetachReason::GameOver)),
        ])
        .await;
    });
    let mut follower = ticket_follower(&fake).await;
    assert_eq!(
        learnt(&mut follower).await,
        [
            "entered",
            "a attached",
            "a [1, 2]",
            "b attached",
            "b [1]",
            "c attached",
            "lost: no more",
            "entered",
            "a attached",
            "c gone: no such seat",
            "a [3]",
            "a decides 7",
            "a [4]",
        ]
    );
    assert!(fake.is_done());
}

#[tokio::test]
async fn a_place_that_is_taken_over_ends_everything() {
    let fake = Fake::default();
    fake.follow_all(vec![Ok(vec![
        (0, entered()),
        (GAMES, seated(0, "a")),
        (0, detached(v1::DetachReason::Superseded)),
    ])]);
    let mut follower = ticket_follower(&fake).await;
    let lines = learnt(&mut follower).await;
    let superseded = "failed: a newer connection has taken the seat";
    assert_eq!(lines, ["entered", "a attached", superseded]);
    assert!(learnt(&mut follower).await.is_empty());
}
