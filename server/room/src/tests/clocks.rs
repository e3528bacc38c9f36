//! Deadlines, banks, defaults, substitution, and lost participants.

use chefshat_agents::AgentKind;
use chefshat_engine::Event;

use super::*;
use crate::journal::AbortReason;
use crate::policy::{AbortPolicy, KindClock};
use crate::testing::first_connection;

fn quick() -> Policy {
    Policy {
        decision_time: ms(1000),
        bank: ms(500),
        // Absences have their own tests.
        absence_time: None,
        ..Policy::default()
    }
}

#[test]
fn a_deadline_takes_the_default_with_source_timeout() {
    let mut table = Table::playing(quick());
    let (seat, _) = table.open();
    table.pass_time(ms(1499));
    assert_eq!(table.core.decisions(), 0, "the bank is not used up yet");
    table.pass_time(ms(1));
    assert_eq!(table.core.decisions(), 1);
    let decided = table.last_decision();
    assert_eq!((decided.seat, decided.source), (seat, Source::Timeout));
    assert_eq!(decided.bank_left_ms, 0);
    assert_eq!(decided.time_us, 1_500_000);
    table.assert_replays();
}

#[test]
fn the_bank_pays_for_time_beyond_the_decision_time() {
    let mut table = Table::playing(quick());
    let (seat, id) = table.open();
    table.pass_time(ms(1200));
    let (left, bank) = table.core.time_left(table.now);
    // The core does not know yet when the request was handed over.
    assert!(left <= ms(1000) && bank <= ms(500));
    let action = table.legal(0);
    let answered = table.answer(seat, id, action);
    assert_eq!(answered.verdict, Verdict::Accepted);
    assert_eq!(answered.time, ms(1200));
    assert_eq!(table.last_decision().bank_left_ms, 300);
    // Its next decision has 1000 + 300 milliseconds.
    table.play_until(seat);
    table.pass_time(ms(1300));
    assert_eq!(table.last_decision().seat, seat);
    assert_eq!(table.last_decision().source, Source::Timeout);
}

#[test]
fn an_answer_that_arrived_in_time_counts_even_if_it_was_queued() {
    let mut table = Table::playing(quick());
    let (seat, id) = table.open();
    let action = table.legal(0);
    let answer = |table: &mut Table, arrived| {
        let answer = Answer::new(id, action);
        (table.core).answer(ms(1600), seat, answer, arrived, Some(ms(0)))
    };
    let mut late = Table::playing(quick());
    assert_eq!(
        answer(&mut late, ms(1500)).verdict,
        Verdict::Closed,
        "arrived at the deadline"
    );
    late.commit();
    assert_eq!(late.last_decision().source, Source::Timeout);
    assert_eq!(answer(&mut table, ms(1499)).verdict, Verdict::Accepted);
}

#[test]
fn the_clock_starts_when_the_transport_receives_the_request_or_after_a_limit() {
    let mut table = Table::playing(quick());
    // If it is not handed over at all, the clock starts after MAX_HANDOVER.
    let latest = super::super::MAX_HANDOVER;
    for now in [1500, 3000, 4999] {
        table.core.tick(ms(now), None);
    }
    assert_eq!(table.core.decisions(), 0);
    table.core.tick(latest, None);
    assert_eq!(table.core.deadline(), Some(latest + ms(1500)));
    table.core.tick(latest + ms(1500), None);
    assert_eq!(table.core.decisions(), 1);

    let mut table = Table::playing(quick());
    table.core.tick(ms(1500), Some(ms(700)));
    assert_eq!(table.core.decisions(), 0);
    assert_eq!(table.core.deadline(), Some(ms(2200)));
}

#[test]
fn a_room_does_not_spin_while_a_transport_is_stalled() {
    let mut table = Table::playing(Policy {
        decision_time: ms(10),
        bank: ms(0),
        ..Policy::default()
    });
    let mut rings = 0;
    while table.core.decisions() == 0 {
        let deadline = table.core.deadline().expect("a decision is open");
        assert!(
            deadline > table.now,
            "the deadline is already in the past: the timer fires immediately"
        );
        table.now = deadline;
        table.core.tick(table.now, None);
        rings += 1;
    }
    assert!(rings < 300, "the timer fired {rings} times");
    assert_eq!(table.now, super::super::MAX_HANDOVER + ms(10));
}

#[test]
fn invalid_answers_do_not_move_the_deadline_and_lead_to_the_default() {
    let mut table = Table::playing(Policy {
        max_invalid_attempts: Some(3),
        ..quick()
    });
    let (seat, id) = table.open();
    let wrong = table.illegal();
    let deadline = table.core.deadline();
    for left in [2, 1] {
        table.now += ms(100);
        match table.answer(seat, id, wrong).verdict {
            Verdict::Invalid {
                attempts_left,
                detail,
                ..
            } => {
                assert_eq!(attempts_left, Some(left));
                assert!(!detail.is_empty());
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(table.core.deadline(), deadline);
    }
    assert!(matches!(
        table.answer(seat, id, wrong).verdict,
        Verdict::Invalid {
            attempts_left: Some(0),
            ..
        }
    ));
    assert_eq!(table.last_decision().source, Source::Invalid);
    assert_eq!(table.core.decisions(), 1);
    assert_eq!(table.answer(seat, id, wrong).verdict, Verdict::Closed);
    table.assert_replays();
}

#[test]
fn a_decision_stays_open_if_attempts_are_unlimited() {
    let mut table = Table::playing(Policy {
        max_invalid_attempts: None,
        ..Policy::default()
    });
    let (seat, id) = table.open();
    for _ in 1..super::super::MAX_ATTEMPTS {
        let wrong = table.illegal();
        assert!(matches!(
            table.answer(seat, id, wrong).verdict,
            Verdict::Invalid {
                attempts_left: None,
                ..
            }
        ));
    }
    assert_eq!(table.open(), (seat, id));
    // But records limit them.
    let wrong = table.illegal();
    table.answer(seat, id, wrong);
    assert_eq!(table.last_decision().source, Source::Invalid);
}

#[test]
fn a_silent_seat_is_substituted_and_can_return() {
    let mut table = Table::playing(Policy {
        max_timeouts: 2,
        bank: ms(0),
        abort: AbortPolicy::Never,
        ..quick()
    });
    let (silent, _) = table.open();
    let mut lost = 0;
    while !table.core.standing(silent).substituted {
        if table.open().0 == silent {
            table.pass_time(ms(1000));
            lost += 1;
        } else {
            table.play_one();
        }
    }
    assert_eq!(lost, 2);
    assert_eq!(
        table.happened(|event| matches!(event, RoomEvent::Substituted(seat) if *seat == silent)),
        1
    );
    // The substitute plays without a request.
    for _ in 0..8 {
        assert_ne!(table.open().0, silent);
        table.play_one();
    }
    let by_substitute = |event: &RoomEvent| match event {
        RoomEvent::Game(game) => {
            let seat = match game.event {
                Event::Played { seat, .. } | Event::Passed { seat, .. } => Some(seat),
                _ => None,
            };
            seat == Some(silent) && game.source == Source::Substitute
        }
        _ => false,
    };
    assert!(table.happened(by_substitute) > 0);
    table.core.resume(table.now, silent);
    table.commit();
    assert!(!table.core.standing(silent).substituted);
    table.play_until(silent);
    table.play_one();
    assert_eq!(table.last_decision().source, Source::Agent);
    table.assert_replays();
}

#[test]
fn a_seat_that_attaches_again_plays_for_itself() {
    let mut table = Table::playing(Policy {
        max_timeouts: 1,
        bank: ms(0),
        pace: Some(ms(400)),
        abort: AbortPolicy::Never,
        ..quick()
    });
    let (seat, _) = table.open();
    table.pass_time(ms(1000));
    assert!(table.core.standing(seat).substituted);
    table.play_until(seat);
    // The substitute waits for its pace; the agent returns first and gets the decision with a new
    // clock.
    table.pass_time(ms(300));
    table.attach(seat);
    assert_eq!(table.open().0, seat);
    assert!(table.core.awaited().is_some());
    assert_eq!(table.core.deadline(), Some(table.now + ms(1000)));
    table.play_one();
    table.assert_replays();
}

#[test]
fn a_lost_connection_does_not_stop_the_clock_and_has_its_own_source() {
    let mut table = Table::playing(quick());
    let (seat, id) = table.open();
    table.pass_time(ms(400));
    table.lost(seat, first_connection(seat));
    assert_eq!(
        table.happened(|event| matches!(event, RoomEvent::Disconnected { .. })),
        1
    );
    table.pass_time(ms(600));
    table.attach(seat);
    assert_eq!(
        table.happened(|event| matches!(event, RoomEvent::Returned(_))),
        1
    );
    assert_eq!(table.open(), (seat, id), "still the same decision");
    assert_eq!(
        table.core.time_left(table.now),
        (ms(0), ms(500)),
        "the actual time left"
    );
    let connection = ConnectionId(table.connections);
    table.lost(seat, connection);
    table.pass_time(ms(500));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    table.assert_replays();
}

#[test]
fn a_game_without_participants_is_aborted_as_the_policy_says() {
    for (policy, lost_seats) in [
        (AbortPolicy::AnyLost, Some(1)),
        (AbortPolicy::AllLost, Some(4)),
        (AbortPolicy::Never, None),
    ] {
        let mut table = Table::playing(Policy {
            max_timeouts: 1,
            bank: ms(0),
            abort: policy,
            ..quick()
        });
        table.pass_time(Duration::from_secs(3600));
        let substituted = table.substituted();
        match lost_seats {
            Some(lost) => {
                assert_eq!(
                    table.core.state(),
                    State::Aborted(AbortReason::ParticipantsLost)
                );
                assert_eq!(substituted, lost - 1, "{policy:?}");
            }
            None => assert_eq!(table.core.state(), State::Finished),
        }
        table.assert_replays();
    }
}

#[test]
fn built_in_agents_play_without_requests_at_their_pace() {
    let fills = vec![
        Fill::BuiltIn(AgentKind::Greedy.into()),
        Fill::BuiltIn(AgentKind::Random.into()),
        Fill::BuiltIn(AgentKind::RandomUnmasked.into()),
        Fill::BuiltIn(AgentKind::Greedy.into()),
    ];
    let mut table = Table::empty(
        Policy {
            pace: Some(ms(100)),
            max_invalid_attempts: Some(5),
            ..Policy::default()
        },
        fills,
    );
    table.core.begin_if_all_built_in(table.now);
    table.commit();
    assert_eq!(table.core.decisions(), 0);
    table.pass_time(ms(1000));
    assert_eq!(table.core.decisions(), 10);
    table.pass_time(Duration::from_secs(3600));
    assert_eq!(table.core.state(), State::Finished);
    let by_default = |source| {
        table
            .journal
            .iter()
            .filter(|entry| matches!(&entry.change, Change::Decided(decided) if decided.source == source))
            .count()
    };
    assert!(
        by_default(Source::Invalid) > 0,
        "random_unmasked sent five invalid actions in a row"
    );
    assert_eq!(by_default(Source::Timeout), 0);
    table.assert_replays();
}

#[test]
fn kinds_of_participants_can_have_separate_clocks() {
    let policy = Policy {
        clocks: vec![KindClock {
            kind: ParticipantKind::Human,
            decision_time: Some(ms(5000)),
            bank: Some(ms(2000)),
            absence_time: None,
        }],
        ..quick()
    };
    for (kind, allowed, bank_after) in [
        (ParticipantKind::Human, 7000, 1000),
        (ParticipantKind::Robot, 1500, 250),
    ] {
        let mut table = Table::empty(policy.clone(), vec![OPEN; 4]);
        table.join_all(kind);
        table.attach_all();
        let (seat, id) = table.open();
        table.pass_time(ms(allowed - bank_after));
        let action = table.legal(0);
        assert_eq!(table.answer(seat, id, action).verdict, Verdict::Accepted);
        assert_eq!(u64::from(table.last_decision().bank_left_ms), bank_after);
        let decisions = table.core.decisions();
        table.pass_time(ms(allowed - 1));
        assert_eq!(table.core.decisions(), decisions, "{kind:?} has time left");
        table.pass_time(ms(1));
        assert_eq!(table.core.decisions(), decisions + 1);
        assert_eq!(table.last_decision().source, Source::Timeout);
        table.assert_replays();
    }
}

#[test]
fn built_in_agents_wait_a_second_if_a_person_plays() {
    for (kind, pace) in [
        (ParticipantKind::Human, ms(1000)),
        (ParticipantKind::Agent, Duration::ZERO),
    ] {
        let fills = [
            OPEN,
            Fill::BuiltIn(AgentKind::Greedy.into()),
            Fill::BuiltIn(AgentKind::Random.into()),
            Fill::BuiltIn(AgentKind::Random.into()),
        ];
        let mut table = Table::empty(Policy::default(), fills.to_vec());
        let seat = table.join(kind).expect("a seat is free");
        table.attach(seat);
        if table.open().0 == seat {
            table.play_one();
        }
        match kind {
            ParticipantKind::Human => {
                assert_ne!(table.open().0, seat, "a built-in agent is waiting");
                assert_eq!(table.core.deadline(), Some(table.now + pace));
                let decisions = table.core.decisions();
                table.pass_time(pace - ms(1));
                assert_eq!(table.core.decisions(), decisions);
                table.pass_time(ms(1));
                assert!(table.core.decisions() > decisions);
            }
            _ => assert_eq!(table.open().0, seat, "the built-in agents have decided"),
        }
        table.assert_replays();
    }
}

#[test]
fn an_answer_is_closed_only_if_its_decision_is() {
    let mut table = Table::playing(quick());
    let (seat, id) = table.open();
    let (wrong, right) = (table.illegal(), table.legal(0));
    let core = &mut table.core;
    // Both were read before the room responded: one in time, one after the deadline.
    let mut answer = |action, arrived| {
        let answer = Answer::new(id, action);
        core.answer(ms(1600), seat, answer, arrived, Some(ms(0)))
    };
    let first = answer(wrong, ms(1400));
    assert!(matches!(first.verdict, Verdict::Invalid { .. }));
    let second = answer(right, ms(1550));
    assert_eq!(second.verdict, Verdict::Accepted, "the clock was paused");
    assert!(
        core.open()
            .is_none_or(|open| open.decision.seat != seat || open.id != id)
    );
}

#[test]
fn attaching_again_does_not_forgive_timeouts() {
    let mut table = Table::playing(Policy {
        max_timeouts: 3,
        bank: ms(0),
        abort: AbortPolicy::Never,
        ..quick()
    });
    let seat = table.open().0;
    let connection = |table: &Table, seat: Seat| match table.connections {
        4 => first_connection(seat),
        last => ConnectionId(last),
    };
    // It crashes whenever it is asked, and attaches again when its time is up.
    for crash in 1..=3 {
        table.play_until(seat);
        assert!(!table.core.standing(seat).substituted, "crash {crash}");
        let lost = connection(&table, seat);
        table.lost(seat, lost);
        table.pass_time(ms(1000));
        if crash < 3 {
            table.attach(seat);
        }
    }
    assert!(table.core.standing(seat).substituted);
    // It gets its seat back, but loses it at the next timeout, unless it answers in time.
    for answers in [false, true] {
        table.attach(seat);
        table.play_until(seat);
        if answers {
            table.play_one();
            table.play_until(seat);
        }
        table.pass_time(ms(1000));
        assert_eq!(table.core.standing(seat).substituted, !answers);
    }
    table.assert_replays();
}

#[test]
fn invalid_answers_do_not_forgive_timeouts() {
    let mut table = Table::playing(Policy {
        max_timeouts: 2,
        max_invalid_attempts: Some(2),
        bank: ms(0),
        abort: AbortPolicy::Never,
        ..quick()
    });
    let seat = table.open().0;
    table.pass_time(ms(1000));
    // The next decision ends with too many invalid answers, the one after that with one and a
    // timeout.
    for attempts in [2, 1] {
        assert!(!table.core.standing(seat).substituted);
        table.play_until(seat);
        let id = table.open().1;
        for _ in 0..attempts {
            let wrong = table.illegal();
            table.answer(seat, id, wrong);
        }
    }
    table.pass_time(ms(1000));
    assert_eq!(table.last_decision().source, Source::Timeout);
    assert!(table.core.standing(seat).substituted);
    table.assert_replays();
}
