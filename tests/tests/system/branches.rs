//! Games that branch from recorded ones, with the recorded players in their seats and with others.

use chefshat_client::Client;
use chefshat_proto::v1::{self, game_event::Kind, seat_config::FilledBy};
use chefshat_record::replay::replay;
use chefshat_tests::{Launch, StreamSeat, TestServer, patiently, play_on};

use crate::played::{
    EndedGame, all_recorded, built_in, ended, original, point, points, until_over,
};

#[tokio::test]
async fn a_branch_with_its_players_and_deals_repeats_the_game() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    assert!(first.course().len() > 150, "{}", first.course().len());
    for decisions in points(&first) {
        let branch = ended(
            &client,
            v1::CreateRoomRequest {
                seats: all_recorded(first.game_id()),
                start: point(first.game_id(), decisions, true),
                ..v1::CreateRoomRequest::default()
            },
        )
        .await;
        assert_eq!(branch.course(), first.course(), "from {decisions}");
        assert_eq!(branch.deals_and_results(), first.deals_and_results());
        for (index, decision) in branch.decisions().into_iter().enumerate() {
            let expected = if index < decisions {
                v1::DecisionSource::Recorded
            } else {
                v1::DecisionSource::Agent
            };
            assert_eq!(
                decision.source(),
                expected,
                "decision {index} of {decisions}"
            );
        }
        let said = Some(v1::BranchPoint {
            game_id: first.game_id().into(),
            decisions: decisions as u64,
            same_deals: true,
        });
        assert_eq!(branch.room.branched_from, said);
        assert_eq!(branch.room.origin(), v1::GameOrigin::Branched);
        assert_eq!(branch.header().origin(), v1::GameOrigin::Branched);
        let start = branch.header().start.clone().expect("a start");
        assert_eq!(start.branched_from, said);
        let players: Vec<_> = (branch.room.seats.iter())
            .map(|seat| {
                seat.replay
                    .clone()
                    .map(|player| (player.game_id, player.seat))
            })
            .collect();
        let expected = |seat| Some((first.game_id().to_owned(), seat));
        assert_eq!(players, [0, 1, 2, 3].map(expected));
    }
}

#[tokio::test]
async fn other_players_continue_a_branch_differently() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    let course = first.course();
    for decisions in points(&first) {
        let mut seats = all_recorded(first.game_id());
        seats[1] = built_in("greedy");
        seats[2] = built_in("greedy");
        let branch = ended(
            &client,
            v1::CreateRoomRequest {
                seats,
                start: point(first.game_id(), decisions, false),
                ..v1::CreateRoomRequest::default()
            },
        )
        .await;
        let other = branch.course();
        assert_eq!(other[..decisions], course[..decisions]);
        // The Shift of the point has the same hands.
        let position = |game: &EndedGame| game.positions()[decisions].clone();
        let (then, now) = (position(&first), position(&branch));
        assert_eq!((then.hands(), then.scores()), (now.hands(), now.scores()));
        if decisions < course.len() - 1 {
            assert_ne!(other, course, "from {decisions}");
        }
        assert_eq!(branch.room.seed_commitment.len(), 32, "later deals are new");

        // The branch has a record like any other: branch from it in turn, within its own part.
        let again = other.len() - 1;
        let twig = ended(
            &client,
            v1::CreateRoomRequest {
                seats: all_recorded(branch.game_id()),
                start: point(branch.game_id(), again, true),
                ..v1::CreateRoomRequest::default()
            },
        )
        .await;
        assert_eq!(twig.course(), other);
        assert_eq!(twig.deals_and_results(), branch.deals_and_results());
    }
}

#[tokio::test]
async fn a_participant_of_a_branch_receives_the_past_and_continues() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    let [_, _, mid_shift, ..] = points(&first);
    let mut seats = all_recorded(first.game_id());
    seats[2] = v1::SeatConfig {
        filled_by: Some(FilledBy::ReservedFor(0)),
        ..v1::SeatConfig::default()
    };
    let created = client
        .create_room(v1::CreateRoomRequest {
            seats,
            start: point(first.game_id(), mid_shift, true),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let joined = client
        .join(v1::JoinRoomRequest {
            join_code: created.join_code,
            name: "Ada".into(),
            ..v1::JoinRoomRequest::default()
        })
        .await
        .expect("a free seat");
    assert_eq!(joined.seat, 2);
    let mut seat = StreamSeat::attached(server.channel().await, &joined.ticket).await;
    let asked = seat.decision().await;
    // Its first request is what its predecessor was asked at that point.
    let before = first.decisions();
    let own_before = before[..mid_shift].iter().filter(|one| one.seat == 2);
    let next = before[mid_shift..].iter().find(|one| one.seat == 2);
    assert_eq!(asked.decision_id, own_before.count() as u64 + 1);
    let next = next.expect("the seat decided again");
    assert_eq!(
        (asked.decision_id, asked.action_mask.clone()),
        (next.decision_id, next.action_mask.clone())
    );
    // It receives all earlier events, redacted for it.
    let taken_over = seat.events.iter().filter(|event| {
        let source = match &event.kind {
            Some(Kind::Play(play)) => play.source(),
            Some(Kind::Pass(pass)) => pass.source(),
            _ => v1::DecisionSource::Unspecified,
        };
        source == v1::DecisionSource::Recorded
    });
    let turn = |one: &&&v1::DecisionRecord| one.kind() == v1::DecisionKind::Turn;
    assert_eq!(
        taken_over.count(),
        before[..mid_shift].iter().filter(turn).count()
    );
    let hands = seat.events.iter().filter_map(|event| match &event.kind {
        Some(Kind::ShiftStarted(started)) => Some(&started.hands),
        _ => None,
    });
    for hand in hands {
        assert_eq!(hand.iter().map(|hand| hand.seat).collect::<Vec<_>>(), [2]);
    }
    // It repeats one more decision of its predecessor, and then decides on its own.
    seat.answer(asked.decision_id, next.action).await;
    assert_eq!(play_on(&mut seat).await, v1::DetachReason::GameOver);
    let room_id = created.room.expect("a room").room_id;
    let ended = patiently("the game to end", until_over(&client, room_id)).await;
    replay(&ended.lines).expect("a valid record");
    let course = first.course();
    let same = ended
        .course()
        .iter()
        .zip(&course)
        .take_while(|(a, b)| a == b)
        .count();
    assert!(same > mid_shift, "{same} of {mid_shift}");
}

#[tokio::test]
async fn a_branch_and_its_players_survive_a_restart() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut launch = Launch::new(folder.path());
    let mut server = launch.start().await.expect("the server starts");
    let mut client = Client::connect(launch.url())
        .await
        .expect("the server listens");
    let first = original(&client).await;
    let course = first.course();
    let [_, decisions, ..] = points(&first);
    let mut restarts = 0;
    // Killed at once, while decisions are taken over or published, and later.
    for further in [0, 1, 10, 40] {
        let created = client
            .create_room(v1::CreateRoomRequest {
                seats: all_recorded(first.game_id()),
                start: point(first.game_id(), decisions, true),
                policy: Some(v1::RoomPolicy {
                    pace_ms: Some(5),
                    ..v1::RoomPolicy::default()
                }),
                ..v1::CreateRoomRequest::default()
            })
            .await
            .expect("a new room");
        let room = created.room.expect("a room");
        let mut watching = client.spectate(&room.room_id, 0);
        let mut own = 0;
        while own < further {
            let event = watching.next().await.expect("a watched room");
            let source = match event.expect("an event").kind {
                Some(Kind::Play(play)) => play.source(),
                Some(Kind::Pass(pass)) => pass.source(),
                _ => continue,
            };
            own += u32::from(source == v1::DecisionSource::Agent);
        }
        server.kill().await;
        server = launch.start().await.expect("the server restarts");
        client = Client::connect(launch.url())
            .await
            .expect("the server listens");
        let branch = patiently("the game to end", until_over(&client, room.room_id)).await;
        replay(&branch.lines).expect("a valid record");
        assert_eq!(branch.course(), course, "killed after {further}");
        assert_eq!(branch.deals_and_results(), first.deals_and_results());
        restarts += branch.events(|kind| matches!(kind, Kind::ServerRestarted(_)));
    }
    assert!(
        restarts > 0,
        "no game was over before its server was killed"
    );
}
