//! Silent decisions: nothing that others can see depends on a special action that is declined or
//! that runs out. `server/wire/src/encoded/silent_tests.rs` compares the messages of many such games.

use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::AgentKind;
use chefshat_engine::{ActionId, DecisionKind, RuleSetSpec};

use super::*;
use crate::policy::{AbortPolicy, KindClock};
use crate::testing::{dealt, second_shift};

/// A table at the start of its second Shift, where seat 2 holds both jokers.
fn offered(policy: Policy) -> Table {
    Table::with_jokers_at(policy, vec![OPEN; 4], [Seat::new(2); 2])
}

fn policy() -> Policy {
    Policy {
        decision_time: ms(1000),
        bank: ms(500),
        max_timeouts: 2,
        abort: AbortPolicy::Never,
        ..Policy::default()
    }
}

/// Plays for the other seats and lets this one run out its next decision.
fn run_out(table: &mut Table, seat: Seat) {
    table.play_until(seat);
    let decisions = table.core.decisions();
    let (left, bank) = table.core.time_left(table.now);
    table.pass_time(left + bank);
    assert_eq!(table.core.decisions(), decisions + 1);
    assert_eq!(table.last_decision().source, Source::Timeout);
}

#[test]
fn a_special_action_that_runs_out_counts_for_nothing() {
    let mut table = offered(policy());
    let (seat, _) = table.open();
    assert_eq!(seat, Seat::new(2));
    assert_eq!(
        table.core.time_left(table.now),
        (ms(1000), ms(0)),
        "the bank does not pay for it"
    );
    run_out(&mut table, seat);
    assert_eq!(table.last_decision().bank_left_ms, 500);
    run_out(&mut table, seat);
    assert_eq!(
        table.substituted(),
        0,
        "only one public decision ran out so far"
    );
    run_out(&mut table, seat);
    assert_eq!(table.substituted(), 1);
    table.assert_replays();
}

#[test]
fn declining_does_not_forgive_earlier_timeouts() {
    for declares in [false, true] {
        let mut table = offered(policy());
        let seat = Seat::new(2);
        table.core.seats[2].timeouts = 1;
        let actions = table.core.header().rules.actions();
        let action = match declares {
            true => actions.declare(),
            false => actions.decline(),
        };
        let (_, id) = table.open();
        table.answer(seat, id, action.index().into());
        run_out(&mut table, seat);
        assert_eq!(table.substituted(), usize::from(!declares));
    }
}

#[test]
fn the_time_for_a_special_action_does_not_tell_the_kind_of_its_holder() {
    let with_people = Policy {
        clocks: vec![KindClock {
            kind: ParticipantKind::Human,
            decision_time: Some(ms(5000)),
            bank: None,
            absence_time: None,
        }],
        ..policy()
    };
    for holder in [ParticipantKind::Agent, ParticipantKind::Human] {
        let rules = RuleSetSpec::default();
        let valid = rules.validate().expect("a valid rule set");
        let hands = dealt(&valid, 3, [Seat::new(2); 2]).expect("every seat has cards to swap");
        let script = second_shift(hands);
        let mut table = Table::scripted(with_people.clone(), vec![OPEN; 4], rules, script);
        for seat in 0..4 {
            let other = match holder {
                ParticipantKind::Agent => ParticipantKind::Human,
                _ => ParticipantKind::Agent,
            };
            let kind = if seat == 2 { holder } else { other };
            table.join(kind).expect("a seat is free");
        }
        table.attach_all();
        assert_eq!(table.core.time_left(table.now), (ms(5000), ms(0)));
        let deadline = table.core.deadline().expect("a decision is open");
        table.pass_time(ms(5000));
        assert_eq!(deadline, table.now);
        assert_eq!(table.last_decision().seat, Seat::new(2));
    }
}

#[test]
fn a_built_in_agent_takes_no_time_for_a_special_action() {
    let mut fills = vec![OPEN; 4];
    fills[2] = Fill::BuiltIn(AgentKind::Greedy.into());
    let paced = Policy {
        pace: Some(ms(300)),
        ..policy()
    };
    let table = Table::with_jokers_at(paced, fills, [Seat::new(2); 2]);
    assert_eq!(table.core.decisions(), 1);
    let open = table.core.open().expect("a decision is open");
    assert_ne!(open.decision.kind, DecisionKind::SpecialAction);
    assert_eq!(table.now, ms(0));
    table.assert_replays();
}

#[test]
fn delayed_spectators_do_not_see_further_because_of_a_silent_decision() {
    let mut table = offered(Policy {
        spectator_delay_decisions: 1,
        ..policy()
    });
    let visible = table.core.visible_to_spectators();
    let decline: ActionId = table.core.header().rules.actions().decline();
    let (seat, id) = table.open();
    table.answer(seat, id, decline.index().into());
    assert_eq!(table.core.visible_to_spectators(), visible);
}

#[test]
fn leaving_does_not_tell_who_is_offered_a_special_action() {
    for leaver in [1, 2] {
        let mut table = offered(policy());
        let retired = |table: &Table| table.happened(|it| matches!(it, RoomEvent::Retired(_)));
        let (events, offered_at) = (table.core.log().len(), table.now);
        table.core.retire(table.now, Seat::new(leaver), None);
        table.commit();
        table.pass_time(ms(999));
        assert_eq!(
            table.core.log().len(),
            events + 1,
            "only the lost connection shows"
        );
        table.pass_time(ms(1));
        assert_eq!(table.now, offered_at + ms(1000));
        assert_eq!(retired(&table), 1);
        table.assert_replays();
    }
}

#[test]
fn the_first_gift_is_asked_for_at_the_same_time_whoever_is_offered_a_special_action() {
    let paced = Policy {
        pace: Some(ms(50)),
        ..policy()
    };
    let giver = |table: &Table| {
        let decision = table.core.awaited_in_public().expect("a participant gives");
        (decision.seat, decision.decision)
    };
    // Nobody is offered one, its holder thinks before it declines, or lets it run out.
    for (holders, thinks) in [([1, 2], 0), ([2, 2], 0), ([2, 2], 320), ([2, 2], 900)] {
        let seats = holders.map(Seat::new);
        let mut table = Table::with_jokers_at(paced.clone(), vec![OPEN; 4], seats);
        let (seat, decision) = giver(&table);
        table.pass_time(ms(thinks.min(499)));
        if holders == [2, 2] && thinks < 500 {
            let decline = table.core.header().rules.actions().decline();
            let (holder, id) = table.open();
            table.answer(holder, id, decline.index().into());
        }
        table.pass_time(ms(499) - table.now);
        assert_eq!(
            table
                .core
                .awaited()
                .filter(|open| !open.is_silent())
                .map(|_| ()),
            None
        );
        let guessed = table.answer(seat, decision, 0);
        assert_eq!(guessed.verdict, Verdict::Unknown, "{holders:?} {thinks}");
        table.pass_time(ms(1));
        let open = table.core.awaited().expect("the first gift");
        assert_eq!((open.decision.seat, open.id), (seat, decision));
        assert_eq!(table.core.time_left(table.now), (ms(1000), ms(500)));
        table.assert_replays();
    }
}

#[test]
fn after_a_restart_the_first_gift_is_asked_for_at_the_same_time_too() {
    for holders in [[1, 2], [2, 2]] {
        let paced = Policy {
            pace: Some(ms(50)),
            ..policy()
        };
        let mut table = Table::with_jokers_at(paced, vec![OPEN; 4], holders.map(Seat::new));
        table.pass_time(ms(300));
        let header = Arc::clone(table.core.header());
        let core = Core::revived(header, &table.journal, ms(2_000)).expect("a good journal");
        assert_eq!(core.deadline(), Some(ms(2_500)), "{holders:?}");
    }
}

#[test]
fn a_short_pace_leaves_a_special_action_its_whole_decision_time() {
    let paced = Policy {
        pace: Some(ms(49)),
        ..policy()
    };
    let table = offered(paced);
    assert!(table.core.awaited().expect("the holder").is_silent());
    assert_eq!(table.core.time_left(table.now), (ms(1000), Duration::ZERO));
    table.assert_replays();
}
