//! Seats whose connections are lost while the game waits for them: substituted after the absence
//! time with their banks untouched, awaited in public, and theirs again when they return.

use chefshat_client::{Client, Spectator, Watched};
use chefshat_proto::v1::{
    self, create_room_request::Start, game_event::Kind, record_line::Line, seat_update::Update,
};
use chefshat_record::convert::script_to_proto;
use chefshat_record::replay;
use chefshat_room::testing::{dealt, second_shift};
use chefshat_tests::{
    StreamSeat, TestServer, first_legal, first_update, one_shift, patiently, play_on,
};

use crate::played::built_in;

const BANK_MS: u32 = 5_000;
const ABSENCE_TIME_MS: u32 = 300;
const PERSON: u32 = 0;
const AGENT: u32 = 1;

/// Nobody who is connected is ever late.
fn policy() -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(600_000),
        bank_ms: Some(BANK_MS),
        absence_time_ms: Some(ABSENCE_TIME_MS),
        pace_ms: Some(0),
        abort: v1::AbortPolicy::Never.into(),
        ..v1::RoomPolicy::default()
    }
}

/// Takes a seat; returns its ticket.
async fn join(client: &Client, join_code: &str, seat: u32, kind: v1::ParticipantKind) -> String {
    let request = v1::JoinRoomRequest {
        join_code: join_code.to_owned(),
        name: format!("player {seat}"),
        kind: kind.into(),
        seat: Some(seat),
        ..v1::JoinRoomRequest::default()
    };
    client.join(request).await.expect("a free seat").ticket
}

/// A stream with a seat that receives events at once.
async fn attached_at_once(server: &TestServer, ticket: &str, from_sequence: u64) -> StreamSeat {
    let mut seat = StreamSeat::open(server.channel().await).await;
    seat.last_event = from_sequence.saturating_sub(1);
    seat.attach(v1::Attach {
        ticket: ticket.to_owned(),
        from_sequence,
        delivery: v1::EventDelivery::AtOnce.into(),
        ..v1::Attach::default()
    })
    .await;
    match seat.next().await {
        Update::Attached(_) => seat,
        other => panic!("not attached, but {other:?}"),
    }
}

/// Whom a spectator sees awaited until an event that is wanted.
async fn watch_until(watching: &mut Spectator, wanted: impl Fn(&Kind) -> bool) -> Vec<v1::Awaited> {
    let mut awaited = Vec::new();
    loop {
        let next = patiently("the next event", watching.next_watched()).await;
        match next.expect("a watched room").expect("the game runs") {
            Watched::Awaited(it) => awaited.push(it),
            Watched::Event(event) if event.kind.as_ref().is_some_and(&wanted) => return awaited,
            Watched::Event(_) | Watched::Snapshot(_) => {}
        }
    }
}

/// The decisions of a game, in order, after its record has been verified.
async fn decisions(client: &Client, game_id: &str) -> Vec<v1::DecisionRecord> {
    let record = client.record(game_id).await.expect("a stored record");
    replay::replay(&record).unwrap_or_else(|error| panic!("{error}"));
    let lines = record.into_iter().filter_map(|line| match line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    });
    lines.collect()
}

#[tokio::test]
async fn a_person_who_closes_the_tab_is_substituted_and_gets_the_seat_back() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(one_shift()),
            policy: Some(policy()),
            seats: vec![
                v1::SeatConfig::default(),
                v1::SeatConfig::default(),
                built_in("greedy"),
                built_in("greedy"),
            ],
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let room = created.room.clone().unwrap_or_default();
    let code = &created.join_code;
    let persons = join(&client, code, PERSON, v1::ParticipantKind::Human).await;
    let agents = join(&client, code, AGENT, v1::ParticipantKind::Agent).await;
    let mut watching = client.spectate(&room.room_id, 0);
    let mut seats = vec![
        attached_at_once(&server, &persons, 0).await,
        StreamSeat::attached(server.channel().await, &agents).await,
    ];
    // The person closes the tab at the first decision.
    loop {
        match first_update(&mut seats).await {
            (Update::Decision(_), 0) => break,
            (Update::Decision(decision), _) => {
                let action = first_legal(&decision);
                seats[1].answer(decision.decision_id, action).await;
            }
            (Update::Result(_), _) => {}
            (other, _) => panic!("unexpected {other:?}"),
        }
    }
    let person = seats.remove(0);
    let seen = person.last_event;
    drop(person);

    let is_substituted = |kind: &Kind| matches!(kind, Kind::Substituted(it) if it.seat == PERSON);
    let awaited = watch_until(&mut watching, is_substituted).await;
    let away: Vec<_> = awaited.iter().filter(|it| it.away).collect();
    assert_eq!(away.len(), 1, "{awaited:?}");
    assert_eq!(away[0].seat, Some(PERSON));
    let left_ms = away[0].left_ms.expect("no special action is possible");
    assert!(left_ms <= ABSENCE_TIME_MS, "{awaited:?}");
    // The substitute plays; then the agent thinks until the person is back.
    let agent = &mut seats[0];
    let substitute_plays = |event: &v1::GameEvent| {
        let (seat, source) = match &event.kind {
            Some(Kind::Play(play)) => (play.seat, play.source()),
            Some(Kind::Pass(pass)) => (pass.seat, pass.source()),
            _ => return false,
        };
        seat == PERSON && source == v1::DecisionSource::Substitute
    };
    let open = loop {
        let decision = agent.decision().await;
        if agent.events.iter().any(substitute_plays) {
            break decision;
        }
        agent
            .answer(decision.decision_id, first_legal(&decision))
            .await;
    };
    let mut person = attached_at_once(&server, &persons, seen + 1).await;
    let is_back = |kind: &Kind| matches!(kind, Kind::Returned(it) if it.seat == PERSON);
    watch_until(&mut watching, is_back).await;
    agent.answer(open.decision_id, first_legal(&open)).await;
    let next = loop {
        seats.push(person);
        let (update, index) = first_update(&mut seats).await;
        person = seats.remove(1);
        match update {
            Update::Decision(decision) if index == 1 => break decision,
            Update::Decision(decision) => {
                let action = first_legal(&decision);
                seats[0].answer(decision.decision_id, action).await;
            }
            Update::Result(_) => {}
            other => panic!("unexpected {other:?}"),
        }
    };
    assert_eq!(next.bank_left_ms, BANK_MS, "the bank is untouched");
    person.answer(next.decision_id, first_legal(&next)).await;
    seats.push(person);
    let reasons = futures::future::join_all(seats.iter_mut().map(play_on)).await;
    assert_eq!(reasons, [v1::DetachReason::GameOver; 2]);

    let all = decisions(&client, &room.game_id).await;
    let mut of_person = all.iter().filter(|it| it.seat == PERSON);
    let by_default: Vec<_> = of_person
        .clone()
        .filter(|it| it.source() == v1::DecisionSource::Disconnected)
        .collect();
    assert_eq!(by_default.len(), 1);
    assert!(by_default[0].decision_time_us >= u64::from(ABSENCE_TIME_MS) * 1000);
    assert!(of_person.clone().all(|it| it.bank_left_ms == BANK_MS));
    let last = of_person.next_back().expect("the person decided");
    assert_eq!(last.source(), v1::DecisionSource::Agent);
}

#[tokio::test]
async fn a_silent_decision_does_not_show_that_its_seat_is_away() {
    const HOLDER: u32 = 2;
    const DECISION_TIME_MS: u32 = 1_500;
    let server = TestServer::start().await;
    let client = server.client().await;
    let rules = v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(2)),
        ..v1::RuleSet::default()
    };
    let valid = chefshat_record::convert::rules_from_proto(&rules).expect("a valid rule set");
    let holder = chefshat_engine::Seat::new(2);
    let hands = dealt(&valid, 3, [holder; 2]).expect("every seat has cards to swap");
    let script = script_to_proto(&second_shift(hands), valid.faces());
    let mut seats = vec![built_in("greedy"); 4];
    // The Chef, who gives first in the exchange, and the holder of both jokers.
    let chef = 0;
    for seat in [chef, 2] {
        seats[seat] = v1::SeatConfig::default();
    }
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(rules),
            policy: Some(v1::RoomPolicy {
                decision_time_ms: Some(DECISION_TIME_MS),
                bank_ms: Some(600_000),
                ..policy()
            }),
            seats,
            start: Some(Start::Scripted(script)),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let room = created.room.clone().unwrap_or_default();
    let code = &created.join_code;
    let holders = join(&client, code, HOLDER, v1::ParticipantKind::Human).await;
    let chefs = join(&client, code, 0, v1::ParticipantKind::Agent).await;
    let mut watching = client.spectate(&room.room_id, 0);
    let mut holder = StreamSeat::attached(server.channel().await, &holders).await;
    let mut chef = attached_at_once(&server, &chefs, 0).await;
    let special = holder.decision().await;
    assert_eq!(special.kind(), v1::DecisionKind::SpecialAction);
    drop(holder);
    let is_lost = |kind: &Kind| matches!(kind, Kind::Disconnected(it) if it.seat == HOLDER);
    let before = watch_until(&mut watching, is_lost).await;
    // The Chef is asked only when the special action has run out, and gives.
    for _ in 0..2 {
        let gift = chef.decision().await;
        assert_eq!(gift.kind(), v1::DecisionKind::Exchange);
        chef.answer(gift.decision_id, first_legal(&gift)).await;
    }
    let is_exchanged = |kind: &Kind| matches!(kind, Kind::CardsExchanged(_));
    let during = watch_until(&mut watching, is_exchanged).await;
    let awaited = before.iter().chain(&during);
    assert!(
        awaited.clone().all(|it| it.seat != Some(HOLDER)),
        "{before:?} {during:?}"
    );
    assert!(awaited.count() > 0);
    assert!(
        chef.awaited.iter().all(|it| it.seat != Some(HOLDER)),
        "{:?}",
        chef.awaited
    );
    // At its first public decision it is awaited and substituted.
    let is_substituted = |kind: &Kind| matches!(kind, Kind::Substituted(it) if it.seat == HOLDER);
    let (awaited, reason) = tokio::join!(
        watch_until(&mut watching, is_substituted),
        play_on(&mut chef)
    );
    assert!(awaited.iter().any(|it| it.seat == Some(HOLDER) && it.away));
    assert_eq!(reason, v1::DetachReason::GameOver);
    let all = decisions(&client, &room.game_id).await;
    let offered = &all[0];
    assert_eq!(offered.kind(), v1::DecisionKind::SpecialAction);
    assert!(
        offered.decision_time_us >= u64::from(DECISION_TIME_MS) * 1000,
        "it took as long as if its seat were connected"
    );
}
