//! Creating and finding rooms; seeds, rewards and records.

use chefshat_client::Client;
use chefshat_engine::RuleSetSpec;
use chefshat_proto::v1::{
    self, game_event::Kind, record_line::Line, record_service_client::RecordServiceClient,
    room_service_client::RoomServiceClient,
};
use chefshat_record::{jsonl, replay};
use chefshat_tests::{
    StreamSeat, TestServer, attach_all, one_shift, patiently, play_on, random_agents, room_of_four,
};

use crate::played::{built_in, ended};
use crate::records::reason;

async fn until_over(client: &Client, room_id: &str) -> v1::Room {
    let mut watching = client.spectate(room_id, 0);
    while watching.next().await.expect("a watched room").is_some() {}
    client.get_room(room_id).await.expect("still listed")
}

#[tokio::test]
async fn invalid_requests_are_refused_with_the_field() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let rules = |rules| v1::CreateRoomRequest {
        rules: Some(rules),
        ..v1::CreateRoomRequest::default()
    };
    let policy = |policy| v1::CreateRoomRequest {
        policy: Some(policy),
        ..v1::CreateRoomRequest::default()
    };
    let cases = [
        (
            rules(v1::RuleSet {
                preset: "house".into(),
                ..v1::RuleSet::default()
            }),
            "RULE_SET_REFUSED",
            "preset",
        ),
        (
            rules(v1::RuleSet {
                players: Some(7),
                ..v1::RuleSet::default()
            }),
            "RULE_SET_REFUSED",
            "players",
        ),
        (
            rules(v1::RuleSet {
                players: Some(300),
                ..v1::RuleSet::default()
            }),
            "RULE_SET_REFUSED",
            "players",
        ),
        (
            rules(v1::RuleSet {
                points: vec![1, 2, 3, 4],
                ..v1::RuleSet::default()
            }),
            "RULE_SET_REFUSED",
            "points",
        ),
        (
            rules(v1::RuleSet {
                stop: Some(v1::rule_set::Stop::TargetShifts(1_000_000)),
                ..v1::RuleSet::default()
            }),
            "RULE_SET_REFUSED",
            "target_shifts",
        ),
        (
            policy(v1::RoomPolicy {
                decision_time_ms: Some(1),
                ..v1::RoomPolicy::default()
            }),
            "POLICY_REFUSED",
            "decision_time_ms",
        ),
        (
            policy(v1::RoomPolicy {
                substitute: "genius".into(),
                ..v1::RoomPolicy::default()
            }),
            "POLICY_REFUSED",
            "substitute",
        ),
        (
            policy(v1::RoomPolicy {
                spectators_see_hands: Some(true),
                ..v1::RoomPolicy::default()
            }),
            "POLICY_REFUSED",
            "spectators_see_hands",
        ),
        (
            v1::CreateRoomRequest {
                seats: vec![built_in("greedy")],
                ..v1::CreateRoomRequest::default()
            },
            "SEATS_REFUSED",
            "seats",
        ),
        (
            v1::CreateRoomRequest {
                game_seed: vec![1, 2, 3],
                ..v1::CreateRoomRequest::default()
            },
            "SEED_REFUSED",
            "game_seed",
        ),
    ];
    for (request, reason, field) in cases {
        let error = client
            .create_room(request.clone())
            .await
            .expect_err("an invalid request");
        assert_eq!(error.reason(), Some(reason), "{request:?}");
        assert_eq!(
            error.metadata().get("field").map(String::as_str),
            Some(field),
            "{request:?}"
        );
    }
    let info = client.server_info().await.expect("the server answers");
    assert_eq!(info.open_rooms, 0, "no room was created");
    assert_eq!(info.presets.len(), RuleSetSpec::PRESETS.len());
}

#[tokio::test]
async fn a_room_of_built_in_agents_plays_on_its_own_and_a_fixed_seed_repeats() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut ends = Vec::new();
    for _ in 0..2 {
        let created = client
            .create_room(v1::CreateRoomRequest {
                seats: ["greedy", "random", "random_unmasked", "greedy"]
                    .map(built_in)
                    .into(),
                game_seed: vec![9; 32],
                ..v1::CreateRoomRequest::default()
            })
            .await
            .expect("a new room");
        let room = created.room.expect("a room");
        assert!(room.seed_fixed && room.seed_commitment.is_empty());
        let over = until_over(&client, &room.room_id).await;
        assert_eq!(over.state(), v1::RoomState::Finished);
        let record = client.record(&room.game_id).await.expect("a record");
        ends.push(
            record
                .into_iter()
                .filter_map(|line| match line.line? {
                    Line::Decision(decision) => Some((decision.seat, decision.action)),
                    _ => None,
                })
                .collect::<Vec<_>>(),
        );
    }
    assert!(ends[0].len() > 50);
    assert_eq!(ends[0], ends[1]);
}

#[tokio::test]
async fn the_record_file_equals_the_served_record_and_is_valid() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(
        &client,
        v1::RuleSet::default(),
        v1::RoomPolicy {
            reward_scheme: v1::RewardScheme::Paper.into(),
            ..v1::RoomPolicy::default()
        },
    )
    .await;
    let room = created.room.expect("a room");
    assert_eq!(room.seed_commitment.len(), 32);
    let early = client.record(&room.game_id).await.expect_err("not yet");
    assert_eq!(early.reason(), Some("GAME_RUNNING"));
    let unknown = client
        .record("00".repeat(16))
        .await
        .expect_err("an unknown game");
    assert_eq!(unknown.reason(), Some("GAME_UNKNOWN"));
    let playing = client.play_many(random_agents(tickets));
    let outcomes = patiently("the game to end", playing).await;
    for outcome in outcomes {
        assert_eq!(outcome.expect("it ended").standings().len(), 4);
    }
    let served = client.record(&room.game_id).await.expect("a record");
    let data = server.stop().await;
    let stored = jsonl::read(&jsonl::path_of(data.path(), &room.game_id)).expect("a record file");
    assert_eq!(stored, served);
    let replayed = replay::replay(&stored).expect("a valid record");
    assert_eq!(replayed.state, v1::RoomState::Finished);
    assert!(replayed.decisions > 50);

    // A changed record is invalid.
    let mut tampered = stored.clone();
    let decision = tampered
        .iter_mut()
        .find_map(|line| match line.line.as_mut() {
            Some(Line::Decision(decision)) if decision.action != 199 => Some(decision),
            _ => None,
        })
        .expect("a decision");
    decision.action = 199;
    assert!(replay::replay(&tampered).is_err());
}

#[tokio::test]
async fn rewards_are_only_sent_to_their_own_seat() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (created, tickets) = room_of_four(
        &client,
        one_shift(),
        v1::RoomPolicy {
            reward_scheme: v1::RewardScheme::Points.into(),
            ..v1::RoomPolicy::default()
        },
    )
    .await;
    let mut seats = attach_all(&server, &tickets).await;
    let room_id = created.room.expect("a room").room_id;
    // A spectator from the start sees no hands while the game runs.
    let mut watching = client.spectate(&room_id, 0);
    let mut watched = Vec::new();
    while !matches!(
        watched.last(),
        Some(v1::GameEvent {
            kind: Some(Kind::ShiftStarted(_)),
            ..
        })
    ) {
        watched.extend(watching.next().await.expect("a watched room"));
    }
    futures::future::join_all(seats.iter_mut().map(play_on)).await;
    for (seat, number) in seats.iter().zip(0..) {
        let mut turns = 0;
        let mut points = None;
        for event in &seat.events {
            assert!(event.rewards.iter().all(|reward| reward.seat == number));
            match &event.kind {
                Some(Kind::Play(_) | Kind::Pass(_)) => turns += event.rewards.len(),
                Some(Kind::ShiftEnded(ended)) => {
                    let own = usize::try_from(number).expect("small");
                    points = Some((event.rewards[0].value, ended.shift_points[own]));
                }
                Some(Kind::ShiftStarted(started)) => {
                    assert_eq!(started.hands.len(), 1);
                    assert_eq!(started.hands[0].seat, number);
                }
                _ => assert!(event.rewards.is_empty()),
            }
        }
        assert!(turns > 0);
        let (reward, points) = points.expect("the Shift ended");
        assert!((f64::from(reward) - f64::from(points)).abs() < 1e-6);
    }
    while let Some(event) = watching.next().await.expect("a watched room") {
        watched.push(event);
    }
    let hands = |events: &[v1::GameEvent]| -> usize {
        let started = events.iter().filter_map(|event| match &event.kind {
            Some(Kind::ShiftStarted(started)) => Some(started.hands.len()),
            _ => None,
        });
        started.sum()
    };
    assert_eq!(hands(&watched), 0);
    assert!(watched.iter().all(|event| event.rewards.is_empty()));
    // A spectator that starts after the end sees the rewards of all seats.
    let mut late = client.spectate(&room_id, 0);
    let mut served = Vec::new();
    while let Some(event) = late.next().await.expect("a watched room") {
        served.push(event);
    }
    assert_eq!(hands(&served), 4);
    assert!(served.iter().all(|event| event.rewards.is_empty()));
}

#[tokio::test]
async fn built_in_agents_use_their_display_names() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let named = |agent: &str, name: &str| v1::SeatConfig {
        name: name.into(),
        ..built_in(agent)
    };
    let open = v1::SeatConfig {
        name: "Ada".into(),
        ..v1::SeatConfig::default()
    };
    for refused in [open, named("greedy", "Gre\u{200b}ta")] {
        let request = v1::CreateRoomRequest {
            seats: vec![
                refused,
                built_in("random"),
                built_in("random"),
                built_in("random"),
            ],
            ..v1::CreateRoomRequest::default()
        };
        let error = client
            .create_room(request)
            .await
            .expect_err("an unknown seat");
        assert_eq!(error.reason(), Some("SEATS_REFUSED"));
    }
    let seats = vec![
        named("greedy", " Greta "),
        named("random", "Rolf"),
        built_in("random"),
        built_in("trained"),
    ];
    let game = ended(
        &client,
        v1::CreateRoomRequest {
            rules: Some(one_shift()),
            seats,
            ..v1::CreateRoomRequest::default()
        },
    )
    .await;
    let names = |seats: &[v1::Participant]| -> Vec<[String; 2]> {
        let names = seats
            .iter()
            .map(|it| [it.name.clone(), it.built_in_agent.clone()]);
        names.collect()
    };
    let expected = [
        ["Greta", "greedy"],
        ["Rolf", "random"],
        ["random", "random"],
        ["trained", "trained"],
    ];
    assert_eq!(names(&game.room.seats), expected);
    assert_eq!(names(&game.header().seats), expected);
    let mut records = RecordServiceClient::new(server.channel().await);
    for (participant, count) in [("greedy", 1), ("Greta", 0), ("random", 1)] {
        let request = v1::ListRecordsRequest {
            filter: Some(v1::RecordFilter {
                participant: participant.into(),
                ..v1::RecordFilter::default()
            }),
            ..v1::ListRecordsRequest::default()
        };
        let page = records.list_records(request).await.expect("a page");
        assert_eq!(page.into_inner().records.len(), count, "{participant}");
    }
}

#[tokio::test]
async fn built_in_agents_slow_down_for_people() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for (kind, time_ms, bank_ms, pace_ms) in [
        (v1::ParticipantKind::Human, 60_000, 300_000, 1000),
        (v1::ParticipantKind::Robot, 10_000, 60_000, 0),
    ] {
        let request = v1::CreateRoomRequest {
            seats: ["", "greedy", "greedy", "greedy"]
                .map(|agent| match agent {
                    "" => v1::SeatConfig::default(),
                    agent => built_in(agent),
                })
                .into(),
            ..v1::CreateRoomRequest::default()
        };
        let created = client.create_room(request).await.expect("a new room");
        let room = created.room.expect("a room");
        assert_eq!(room.policy.expect("a policy").pace_ms, None, "not yet set");
        let joined = client
            .join(v1::JoinRoomRequest {
                join_code: created.join_code,
                name: "Ada".into(),
                kind: kind.into(),
                ..v1::JoinRoomRequest::default()
            })
            .await
            .expect("a free seat");
        let mut seat = StreamSeat::attached(server.channel().await, &joined.ticket).await;
        let decision = patiently("a decision", seat.decision()).await;
        assert_eq!(decision.bank_left_ms, bank_ms);
        assert!(decision.time_left_ms <= time_ms);
        let room = client.get_room(&room.room_id).await.expect("it exists");
        assert_eq!(room.policy.expect("a policy").pace_ms, Some(pace_ms));
    }
}

#[tokio::test]
async fn only_the_participants_of_a_room_learn_where_they_play_again() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let create = async || {
        let request = v1::CreateRoomRequest::default();
        client.create_room(request).await.expect("a new room")
    };
    let (made, next) = (create().await, create().await);
    let room_id = made.room.expect("a room").room_id;
    let joined = client.join_with_code(made.join_code.as_str(), "Ada").await;
    let ticket = joined.expect("a free seat").ticket;
    let mut rooms = RoomServiceClient::new(client.channel());
    let set = |owner_token: &str, join_code: &str| v1::SetNextRoomRequest {
        room_id: room_id.clone(),
        owner_token: owner_token.into(),
        join_code: join_code.into(),
        ticket: String::new(),
    };
    let offer = |ticket: &str, join_code: &str| v1::SetNextRoomRequest {
        owner_token: String::new(),
        ticket: ticket.into(),
        ..set("", join_code)
    };
    for (token, code, expected) in [
        (
            ticket.as_str(),
            next.join_code.as_str(),
            "OWNER_TOKEN_WRONG",
        ),
        (&next.owner_token, &next.join_code, "OWNER_TOKEN_WRONG"),
        (&made.owner_token, "BCDF234", "JOIN_CODE_WRONG"),
    ] {
        let refused = rooms.set_next_room(set(token, code)).await;
        assert_eq!(reason(&refused.expect_err("refused")), expected);
    }
    let shown = async |secret: &str| {
        let client = client.with_secrets([secret]).expect("a secret");
        let room = client.get_room(&room_id).await.expect("it is public");
        room.next_join_code
    };
    assert_eq!(shown(&ticket).await, "");
    let said = next.join_code.to_lowercase();
    let told = rooms.set_next_room(set(&made.owner_token, &said)).await;
    told.expect("its owner");
    assert_eq!(shown(&ticket).await, next.join_code);
    assert_eq!(shown(&made.owner_token).await, next.join_code);
    assert_eq!(shown(&next.owner_token).await, "", "of another room");
    let listed = client.list_rooms(v1::ListRoomsRequest::default()).await;
    let listed = listed.expect("a page").rooms;
    assert!(listed.iter().all(|room| room.next_join_code.is_empty()));

    // A participant's offer counts if there is none that can be joined; the owner's always.
    let refused = rooms.set_next_room(offer(&next.owner_token, "BCDF2345"));
    assert_eq!(
        reason(&refused.await.expect_err("no ticket")),
        "TICKET_UNKNOWN"
    );
    let other = create().await;
    let refused = rooms.set_next_room(offer(&ticket, &other.join_code)).await;
    assert_eq!(reason(&refused.expect_err("there is one")), "NEXT_ROOM_SET");
    let again = rooms.set_next_room(offer(&ticket, &next.join_code)).await;
    again.expect("the same");
    let closed = rooms.close_room(v1::CloseRoomRequest {
        room_id: next.room.expect("a room").room_id,
        owner_token: next.owner_token,
    });
    closed.await.expect("its owner");
    let offered = rooms.set_next_room(offer(&ticket, &other.join_code)).await;
    offered.expect("the first one is closed");
    assert_eq!(shown(&ticket).await, other.join_code);
    let third = create().await;
    let told = rooms.set_next_room(set(&made.owner_token, &third.join_code));
    told.await.expect("its owner");
    assert_eq!(shown(&ticket).await, third.join_code);
}
