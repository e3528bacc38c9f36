//! Joining, attaching and answering.

use chefshat_engine::RewardScheme;

use super::*;
use crate::journal::AbortReason;
use crate::{ExpressError, Expression, JOIN_HOLD, JoinError, LeaveError, MAX_SEATINGS};

#[test]
fn reserved_seats_are_only_given_to_their_kind() {
    let human = Fill::Open {
        reserved_for: Some(ParticipantKind::Human),
    };
    let mut table = Table::empty(Policy::default(), vec![OPEN, human, OPEN, human]);
    let seats: Vec<_> = [
        ParticipantKind::Human,
        ParticipantKind::Robot,
        ParticipantKind::Agent,
        ParticipantKind::Agent,
        ParticipantKind::Human,
        ParticipantKind::Human,
    ]
    .into_iter()
    .map(|kind| table.join(kind).map(Seat::index))
    .collect();
    assert_eq!(
        seats,
        [
            Ok(1),
            Ok(0),
            Ok(2),
            Err(JoinError::KindNotAdmitted),
            Ok(3),
            Err(JoinError::RoomFull)
        ]
    );
}

#[test]
fn a_seat_that_is_never_attached_is_freed() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    table.join_all(ParticipantKind::Agent);
    table.attach(Seat::new(2));
    table.pass_time(JOIN_HOLD);
    assert_eq!(
        table.happened(|event| matches!(event, RoomEvent::Vacated(_))),
        3
    );
    assert!(table.core.standing(Seat::new(2)).participant.is_some());
    assert!(table.join(ParticipantKind::Human).is_ok());
    table.pass_time(Duration::from_secs(3600));
    assert_eq!(
        table.core.state(),
        State::Aborted(AbortReason::NeverStarted)
    );
    assert_eq!(table.join(ParticipantKind::Human), Err(JoinError::GameOver));
    table.assert_replays();
}

#[test]
fn the_game_starts_when_every_seat_is_attached() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    table.join_all(ParticipantKind::Agent);
    for seat in 0..3 {
        table.attach(Seat::new(seat));
    }
    assert_eq!(table.core.state(), State::Waiting);
    table.attach(Seat::new(3));
    assert_eq!(table.core.state(), State::Playing);
}

#[test]
fn an_answer_counts_once_and_is_acknowledged_again_if_repeated() {
    let mut table = Table::playing(Policy::default());
    let (seat, id) = table.open();
    let other = table.core.all_seats().find(|other| *other != seat);
    let other = other.expect("there are four seats");
    let action = table.legal(0);
    assert_eq!(
        table.answer(other, 1, action).verdict,
        Verdict::Unknown,
        "the decision is not open yet"
    );
    assert_eq!(table.answer(seat, id + 1, action).verdict, Verdict::Unknown);
    assert_eq!(table.answer(seat, 0, action).verdict, Verdict::Unknown);
    table.now += ms(20);
    let first = table.answer(seat, id, action);
    assert_eq!(first.verdict, Verdict::Accepted);
    table.now += ms(20);
    let journal = table.journal.len();
    assert_eq!(table.answer(seat, id, action), first, "the same result");
    assert_eq!(
        table.answer(seat, id, action + 1).verdict,
        Verdict::Closed,
        "a different answer"
    );
    assert_eq!(table.journal.len(), journal, "nothing has changed");
}

#[test]
fn the_newest_connection_gets_the_seat() {
    let mut table = Table::playing(Policy::default());
    let seat = Seat::new(0);
    let newer = table.attach(seat);
    table.lost(seat, ConnectionId(1));
    assert!(
        table.core.standing(seat).connected,
        "the loss of the older connection is ignored"
    );
    table.lost(seat, newer);
    assert!(!table.core.standing(seat).connected);
}

#[test]
fn rewards_go_to_turns_and_to_invalid_attempts() {
    let mut table = Table::playing(Policy {
        reward_scheme: Some(RewardScheme::Validity),
        ..Policy::default()
    });
    let (seat, id) = table.open();
    let wrong = table.illegal();
    assert!(matches!(
        table.answer(seat, id, wrong).verdict,
        Verdict::Invalid { reward: Some(reward), .. } if reward == -1.0
    ));
    table.play_one();
    assert_eq!(
        table.happened(|event| matches!(
            event,
            RoomEvent::Game(game) if matches!(*game.rewards, [(rewarded, 1.0)] if rewarded == seat)
        )),
        1
    );
}

#[test]
fn people_write_only_where_the_policy_allows_it() {
    for chat in [false, true] {
        let policy = Policy {
            chat,
            ..Policy::default()
        };
        let mut table = Table::empty(policy, vec![OPEN; 4]);
        let [person, agent] =
            [ParticipantKind::Human, ParticipantKind::Agent].map(|kind| table.join(kind));
        let mut says = |seat: Result<Seat, JoinError>, in_words| {
            let expression = Expression {
                in_words,
                ..Expression::default()
            };
            let said = table
                .core
                .express(table.now, seat.expect("a free seat"), expression);
            table.commit();
            said
        };
        let allowed = if chat {
            Ok(())
        } else {
            Err(ExpressError::ChatOff)
        };
        assert_eq!(says(person, true), allowed);
        assert_eq!(says(person, false), Ok(()));
        assert_eq!(says(agent, true), Ok(()));
    }
}

#[test]
fn expressions_are_public_or_recorded_only_and_limited() {
    let mut table = Table::playing(Policy::default());
    let seat = Seat::new(1);
    let express = |table: &mut Table, record_only| {
        let expression = Expression {
            record_only,
            ..Expression::default()
        };
        let said = table.core.express(table.now, seat, expression);
        table.commit();
        said
    };
    let events = table.core.log().len();
    assert_eq!(express(&mut table, true), Ok(()));
    assert_eq!(table.core.log().len(), events, "nothing is published");
    assert_eq!(express(&mut table, false), Ok(()));
    assert_eq!(table.core.log().len(), events + 1);
    for _ in 2..super::super::MAX_EXPRESSIONS_PER_SEAT {
        express(&mut table, true).expect("below the limit");
    }
    assert_eq!(express(&mut table, true), Err(ExpressError::TooMany));
    table.core.abort(table.now, AbortReason::Closed);
    assert_eq!(express(&mut table, true), Err(ExpressError::GameOver));
}

#[test]
fn annotations_are_limited() {
    let mut table = Table::playing(Policy::default());
    let annotate = |table: &mut Table, bytes: usize| {
        let (seat, decision_id) = table.open();
        let action = table.legal(0);
        let answer = Answer {
            annotations: Some(vec![0; bytes].into_boxed_slice()),
            ..Answer::new(decision_id, action)
        };
        let now = table.now;
        let answered = table.core.answer(now, seat, answer, now, None);
        table.commit();
        (answered, table.answer(seat, decision_id, action))
    };
    let limit = super::super::MAX_ANNOTATION_BYTES;
    let (kept, again) = annotate(&mut table, limit);
    assert!(!kept.annotations_dropped && kept == again);
    let (dropped, again) = annotate(&mut table, limit + 1);
    assert_eq!(dropped.verdict, Verdict::Accepted);
    assert!(dropped.annotations_dropped && dropped == again);
    assert!(table.last_decision().annotations.is_none());
}

#[test]
fn delayed_spectators_see_events_after_a_number_of_decisions() {
    let mut table = Table::with_rules(
        Policy {
            spectator_delay_decisions: 3,
            ..Policy::default()
        },
        vec![OPEN; 4],
        one_shift(),
    );
    table.fill();
    // The deal itself is withheld until three decisions have been taken: it may show all hands.
    let shown = table.core.visible_to_spectators();
    let event = |position| table.core.log().get(position).map(|entry| &entry.event);
    assert!(matches!(event(shown - 1), Some(RoomEvent::GameStarted)));
    assert!(matches!(event(shown), Some(RoomEvent::Game(_))));
    let mut lengths = vec![table.core.log().len()];
    while table.core.state() == State::Playing {
        table.play_one();
        lengths.push(table.core.log().len());
        if table.core.state() == State::Playing {
            let visible = lengths
                .len()
                .checked_sub(4)
                .map_or(shown, |index| lengths[index]);
            assert_eq!(table.core.visible_to_spectators(), visible);
        }
    }
    assert_eq!(table.core.visible_to_spectators(), table.core.log().len());
}

#[test]
fn a_freed_seat_has_no_state_of_its_former_participant() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    let seats: Vec<Seat> = table.core.all_seats().collect();
    table.join_all(ParticipantKind::Agent);
    // The first is never attached, the second loses its connection, the third is attached; they
    // leave.
    let connection = table.attach(seats[1]);
    table.lost(seats[1], connection);
    table.attach(seats[2]);
    for seat in &seats[..3] {
        assert_eq!(table.core.leave(table.now, *seat), Ok(()));
        table.commit();
    }
    assert!(table.core.standing(seats[1]).participant.is_none());
    assert!(!table.core.standing(seats[2]).connected);
    table.attach(seats[3]);
    assert!(table.core.open().is_none(), "three seats are free");
    for seat in &seats[..3] {
        assert_eq!(table.join(ParticipantKind::Human), Ok(*seat));
        table.attach(*seat);
    }
    let returned = table.happened(|it| matches!(it, RoomEvent::Returned(_)));
    assert_eq!(returned, 0, "they are new participants");
    assert_eq!(
        table.core.leave(table.now, seats[0]),
        Err(LeaveError::GameStarted)
    );
    table.assert_replays();
}

#[test]
fn a_seat_cannot_be_taken_and_freed_without_limit() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    for _ in 0..MAX_SEATINGS {
        let seat = table.join(ParticipantKind::Agent).expect("a seat is free");
        assert_eq!(table.core.leave(table.now, seat), Ok(()));
    }
    let error = table.join(ParticipantKind::Agent).expect_err("too often");
    assert_eq!(error, JoinError::TooManySeatings);
}

#[test]
fn a_seat_is_given_up_for_good_when_its_participant_leaves() {
    let mut table = Table::playing(Policy::default());
    let (seat, id) = table.open();
    table.core.retire(table.now, seat, None);
    table.commit();
    assert!(table.core.standing(seat).substituted);
    assert_eq!(
        table.happened(|it| matches!(it, RoomEvent::Retired(own) if *own == seat)),
        1
    );
    assert_eq!(table.answer(seat, id, 0).verdict, Verdict::Closed);
    table.core.resume(table.now, seat);
    table.commit();
    assert!(table.core.standing(seat).substituted, "it never returns");
    let journal = table.journal.len();
    table.core.retire(table.now, seat, None);
    table.commit();
    assert_eq!(table.journal.len(), journal, "it has left already");
    table.pass_time(ms(60_000));
    assert!(table.core.decisions() > 0, "the substitute plays");
    table.assert_replays();
}

#[test]
fn the_ticket_of_a_participant_who_left_is_unknown() {
    let mut table = Table::playing(Policy::default());
    // In these tests everybody has the same ticket.
    let known = |table: &Table| table.core.seat_of_ticket(b"ticket").map(Seat::index);
    assert_eq!(known(&table), Some(0));
    table.core.retire(table.now, Seat::new(0), None);
    assert_eq!(known(&table), Some(1));
    let journal = table.core.pending().clone();
    assert_eq!(journal.len(), 2, "it loses its connection: {journal:?}");
}

#[test]
fn a_game_that_has_not_started_is_aborted_when_a_participant_leaves() {
    let mut table = Table::empty(Policy::default(), vec![OPEN; 4]);
    table.join_all(ParticipantKind::Agent);
    table.core.retire(table.now, Seat::new(2), None);
    table.commit();
    assert_eq!(
        table.core.state(),
        State::Aborted(AbortReason::NeverStarted)
    );
}
