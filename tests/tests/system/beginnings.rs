//! Games from given hands, recorded players in unfamiliar games, and invalid starts.

use chefshat_proto::v1::{self, create_room_request::Start, game_event::Kind};
use chefshat_record::convert::{script_from_proto, script_to_proto};
use chefshat_tests::TestServer;

use crate::played::{all_recorded, built_in, ended, original, point, recorded};

#[tokio::test]
async fn recorded_players_play_other_games_too() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    let mut courses = Vec::new();
    for _ in 0..2 {
        let request = v1::CreateRoomRequest {
            // Another deck and number of players than in their own game.
            rules: Some(v1::RuleSet {
                players: Some(3),
                faces: Some(9),
                ..v1::RuleSet::default()
            }),
            seats: (1..4).map(|seat| recorded(first.game_id(), seat)).collect(),
            game_seed: vec![5; 32],
            ..v1::CreateRoomRequest::default()
        };
        courses.push(ended(&client, request).await.course());
    }
    assert!(courses[0].len() > 30);
    assert_eq!(
        courses[0], courses[1],
        "they depend only on their observations"
    );
}

#[tokio::test]
async fn a_game_starts_with_given_hands() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    // The hands of the second Shift start another game: once as its first Shift, once as a later
    // one with roles and points.
    let dealt = first
        .deals_and_results()
        .into_iter()
        .find_map(|kind| match kind {
            Kind::ShiftStarted(started) if started.shift == 2 => Some(started.hands),
            _ => None,
        });
    let hands = dealt.expect("a second Shift");
    let scripts = [
        v1::ScriptedShift {
            hands: hands.clone(),
            ..v1::ScriptedShift::default()
        },
        v1::ScriptedShift {
            shift: 3,
            hands: hands.clone(),
            last_order: vec![2, 0, 3, 1],
            points: vec![6, 0, 10, 2],
            drawn_seat: None,
        },
    ];
    for script in scripts {
        let request = v1::CreateRoomRequest {
            seats: vec![built_in("greedy"); 4],
            start: Some(Start::Scripted(script.clone())),
            ..v1::CreateRoomRequest::default()
        };
        let game = ended(&client, request).await;
        let Some(Kind::ShiftStarted(started)) = game.deals_and_results().into_iter().next() else {
            panic!("a game starts with a deal");
        };
        assert_eq!(started.hands, hands);
        assert_eq!(started.shift, script.shift.max(1));
        let roles = game
            .deals_and_results()
            .into_iter()
            .find_map(|kind| match kind {
                Kind::RolesAssigned(assigned) => Some(assigned.roles().collect::<Vec<_>>()),
                _ => None,
            });
        if script.shift == 3 {
            use v1::Role::{Chef, Dishwasher, SousChef, Waiter};
            assert_eq!(roles, Some(vec![SousChef, Dishwasher, Chef, Waiter]));
        }
        assert_eq!(game.room.origin(), v1::GameOrigin::Scripted);
        let rules = *game.positions()[0].rules();
        let given = script_from_proto(&script, &rules).expect("an accepted script");
        let start = game.header().start.clone().expect("a start");
        assert_eq!(start.scripted, Some(script_to_proto(&given, rules.faces())));

        // A branch of it has the same hands.
        let branch = ended(
            &client,
            v1::CreateRoomRequest {
                seats: all_recorded(game.game_id()),
                start: point(game.game_id(), 7, true),
                ..v1::CreateRoomRequest::default()
            },
        )
        .await;
        assert_eq!(branch.course(), game.course());
        assert_eq!(branch.deals_and_results(), game.deals_and_results());
    }
}

#[tokio::test]
async fn invalid_starts_are_refused_with_a_reason() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    let (id, length) = (first.game_id(), first.course().len());
    let waiting = client
        .create_room(v1::CreateRoomRequest::default())
        .await
        .expect("a new room");
    let running = waiting.room.expect("a room").game_id;
    let unknown = "00".repeat(16);
    let branch = |start| v1::CreateRoomRequest {
        start,
        ..v1::CreateRoomRequest::default()
    };
    let seats = |seat| v1::CreateRoomRequest {
        seats: vec![
            seat,
            built_in("greedy"),
            built_in("greedy"),
            built_in("greedy"),
        ],
        ..v1::CreateRoomRequest::default()
    };
    let script = |hands: Vec<v1::SeatCards>| {
        branch(Some(Start::Scripted(v1::ScriptedShift {
            hands,
            ..v1::ScriptedShift::default()
        })))
    };
    let cases = [
        (
            branch(point(id, length, false)),
            "BRANCH_REFUSED",
            "decisions",
        ),
        (
            branch(point(id, length + 9, true)),
            "BRANCH_REFUSED",
            "decisions",
        ),
        (branch(point(&unknown, 0, false)), "GAME_UNKNOWN", "game_id"),
        (branch(point("friday", 0, false)), "GAME_UNKNOWN", "game_id"),
        (branch(point(&running, 0, false)), "GAME_RUNNING", "game_id"),
        (
            v1::CreateRoomRequest {
                rules: Some(v1::RuleSet {
                    preset: "rulebook".into(),
                    ..v1::RuleSet::default()
                }),
                ..branch(point(id, 3, false))
            },
            "BRANCH_REFUSED",
            "rules",
        ),
        (
            v1::CreateRoomRequest {
                game_seed: vec![1; 32],
                ..branch(point(id, 3, true))
            },
            "BRANCH_REFUSED",
            "game_seed",
        ),
        (seats(recorded(id, 4)), "SEATS_REFUSED", "seats"),
        (seats(recorded(id, 77)), "SEATS_REFUSED", "seats"),
        (seats(recorded(&unknown, 0)), "GAME_UNKNOWN", "game_id"),
        (seats(recorded(&running, 0)), "GAME_RUNNING", "game_id"),
        (script(Vec::new()), "SCRIPT_REFUSED", "hands"),
        (
            script(vec![v1::SeatCards {
                seat: 9,
                ..v1::SeatCards::default()
            }]),
            "SCRIPT_REFUSED",
            "hands",
        ),
    ];
    for (request, reason, field) in cases {
        let refused = client.create_room(request.clone()).await;
        let error = refused.expect_err("an invalid start");
        assert_eq!(error.reason(), Some(reason), "{request:?}");
        let named = error.metadata().get("field").map(String::as_str);
        assert_eq!(named, Some(field), "{request:?}");
        assert!(error.message().len() > 10, "{error}");
    }
    let info = client.server_info().await.expect("the server answers");
    assert_eq!(
        info.open_rooms, 1,
        "nothing was created except the waiting room"
    );
}
