//! Seats that are not connected while the game waits for them: the absence time, their banks,
//! substitutes, and whom everybody sees awaited.

use chefshat_agents::AgentKind;
use proptest::prelude::*;

use super::*;
use crate::journal::AbortReason;
use crate::policy::AbortPolicy;
use crate::testing::first_connection;
use crate::{Awaited, RECALL_TIME};

const SEATS: usize = 4;

fn policy() -> Policy {
    Policy {
        decision_time: ms(1000),
        bank: ms(500),
        absence_time: Some(ms(400)),
        ..Policy::default()
    }
}

fn lose(table: &mut Table, seat: Seat) {
    table.lost(seat, first_connection(seat));
}

#[test]
fn a_seat_that_is_away_is_substituted_when_its_absence_time_is_over() {
    let mut table = Table::playing(policy());
    let (seat, id) = table.open();
    table.pass_time(ms(300));
    lose(&mut table, seat);
    assert_eq!(table.core.deadline(), Some(ms(700)));
    table.pass_time(ms(399));
    assert_eq!(table.open(), (seat, id), "a millisecond is left");
    table.pass_time(ms(1));
    let decided = table.last_decision();
    assert_eq!((decided.seat, decided.source), (seat, Source::Disconnected));
    assert_eq!((decided.time_us, decided.bank_left_ms), (700_000, 500));
    assert_eq!(table.substituted(), 1, "at once, not after max_timeouts");
    // The substitute plays until the seat returns.
    for _ in 0..6 {
        assert_ne!(table.play_one(), seat);
    }
    table.attach(seat);
    assert!(!table.core.standing(seat).substituted);
    table.play_until(seat);
    table.play_one();
    assert_eq!(table.last_decision().source, Source::Agent);
    assert_eq!(table.last_decision().bank_left_ms, 500);
    table.assert_replays();
}

#[test]
fn the_absence_time_runs_from_the_start_of_a_decision_at_the_earliest() {
    let mut table = Table::playing(policy());
    let (first, _) = table.open();
    let seat = Seat::new((first.index() + 1) % SEATS);
    lose(&mut table, seat);
    table.pass_time(ms(600));
    table.play_until(seat);
    assert_eq!(table.core.deadline(), Some(table.now + ms(400)));
    table.pass_time(ms(400));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    assert_eq!(table.last_decision().time_us, 400_000);
}

#[test]
fn the_bank_does_not_pay_for_an_absence() {
    let long = Policy {
        absence_time: Some(ms(1000)),
        ..policy()
    };
    let mut table = Table::playing(long);
    let (seat, id) = table.open();
    table.pass_time(ms(1100));
    lose(&mut table, seat);
    assert_eq!(
        table.core.deadline(),
        Some(ms(1500)),
        "the end that it has anyway"
    );
    table.pass_time(ms(300));
    table.attach(seat);
    // 100 of its 1400 milliseconds were beyond the decision time while it was connected.
    assert_eq!(table.core.time_left(table.now), (ms(0), ms(400)));
    assert_eq!(table.core.deadline(), Some(ms(1800)));
    table.pass_time(ms(399));
    let action = table.legal(0);
    let answered = table.answer(seat, id, action);
    assert_eq!(
        (answered.verdict, answered.time),
        (Verdict::Accepted, ms(1799))
    );
    assert_eq!(table.last_decision().bank_left_ms, 1);
    table.assert_replays();
}

#[test]
fn absences_during_one_decision_share_the_absence_time() {
    let mut table = Table::playing(policy());
    let (seat, id) = table.open();
    lose(&mut table, seat);
    table.pass_time(ms(150));
    let second = table.attach(seat);
    table.pass_time(ms(200));
    table.lost(seat, second);
    table.pass_time(ms(249));
    assert_eq!(table.open(), (seat, id), "a millisecond is left");
    table.pass_time(ms(1));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    assert_eq!(table.substituted(), 1);
}

#[test]
fn nobody_is_held_up_by_a_seat_that_nobody_waits_for() {
    let built_in = Fill::BuiltIn(AgentKind::Greedy.into());
    for (fills, others) in [
        (vec![OPEN, built_in, built_in, built_in], 0),
        (vec![OPEN; 4], 3),
    ] {
        let mut table = Table::empty(policy(), fills);
        table.fill();
        for seat in table.core.all_seats().skip(1).take(others) {
            lose(&mut table, seat);
        }
        let seat = Seat::new(0);
        // Those who are away are substituted while somebody is here.
        while table.open().0 != seat {
            table.pass_time(ms(400));
        }
        lose(&mut table, seat);
        let (lost, decisions) = (table.now, table.core.decisions());
        table.pass_time(ms(1499));
        assert_eq!(table.core.decisions(), decisions, "it has all its time");
        if others > 0 {
            // Somebody returns, and does not wait any longer.
            table.attach(Seat::new(1));
            table.pass_time(ms(0));
            assert!(table.core.standing(seat).substituted);
        } else {
            table.pass_time(ms(1));
            assert_eq!(table.last_decision().source, Source::Disconnected);
            assert_eq!(table.last_decision().bank_left_ms, 500);
            let reason = AbortReason::ParticipantsLost;
            assert_eq!(table.core.state(), State::Aborted(reason));
            assert_eq!(table.now, lost + ms(1500));
        }
        table.assert_replays();
    }
}

#[test]
fn a_connection_lost_just_before_the_end_of_a_decision_costs_the_decision_alone() {
    let mut table = Table::playing(Policy {
        abort: AbortPolicy::AnyLost,
        ..policy()
    });
    let (seat, _) = table.open();
    table.pass_time(ms(1499));
    lose(&mut table, seat);
    table.pass_time(ms(1));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    assert_eq!(table.core.state(), State::Playing);
    // It is still away at its next decision.
    table.play_until(seat);
    table.pass_time(ms(399));
    assert_eq!(table.core.state(), State::Playing);
    table.pass_time(ms(1));
    let reason = AbortReason::ParticipantsLost;
    assert_eq!(table.core.state(), State::Aborted(reason));
    table.assert_replays();
}

#[test]
fn the_policy_may_abort_the_game_instead() {
    let mut table = Table::playing(Policy {
        abort: AbortPolicy::AnyLost,
        ..policy()
    });
    let (seat, _) = table.open();
    lose(&mut table, seat);
    table.pass_time(ms(400));
    let reason = AbortReason::ParticipantsLost;
    assert_eq!(table.core.state(), State::Aborted(reason));
    assert_eq!(table.substituted(), 0);
    table.assert_replays();
}

#[test]
fn a_special_action_ends_as_if_its_seat_were_connected() {
    let holder = Seat::new(2);
    let mut shown = Vec::new();
    for away in [false, true] {
        let mut table = Table::with_jokers_at(policy(), vec![OPEN; SEATS], [holder; 2]);
        assert_eq!(table.open().0, holder);
        let awaited = table.core.awaited_in_public().expect("somebody is awaited");
        assert_ne!(awaited.seat, holder, "nobody may know of its decision");
        if away {
            lose(&mut table, holder);
        }
        assert_eq!(table.core.awaited_in_public(), Some(awaited));
        assert_eq!(table.core.deadline(), Some(ms(1000)));
        table.pass_time(ms(999));
        assert_eq!(table.core.decisions(), 0);
        table.pass_time(ms(1));
        assert_eq!(table.last_decision().seat, holder);
        assert_eq!(table.substituted(), 0);
        let next = table.core.awaited_in_public();
        assert_eq!(next, Some(awaited), "the decision that follows was shown");
        assert_eq!((awaited.since, awaited.until), (ms(0), None));
        shown.push(awaited);
        // From the second gift on, nothing is silent.
        table.pass_time(ms(10));
        table.play_one();
        let next = table.core.awaited_in_public().expect("somebody is awaited");
        assert_eq!(next.since, table.now);
        assert!(next.until.is_some());
    }
    assert_eq!(shown[0], shown[1]);
}

#[test]
fn everybody_is_told_when_an_absence_begins_to_count() {
    let mut table = Table::playing(policy());
    let (seat, _) = table.open();
    let others: Vec<Seat> = (table.core.all_seats()).filter(|it| *it != seat).collect();
    for other in &others {
        lose(&mut table, *other);
    }
    lose(&mut table, seat);
    let alone = table.core.awaited_in_public().expect("it is awaited");
    assert_eq!(alone.until, Some(ms(1500)), "nobody waits");
    table.attach(others[0]);
    let waited_for = table.core.awaited_in_public().expect("it is awaited");
    assert_eq!(waited_for.until, Some(ms(400)));
    assert_ne!(alone.key(), waited_for.key());
}

#[test]
fn everybody_sees_whom_the_game_waits_for() {
    let mut fills = vec![OPEN; SEATS];
    fills[3] = Fill::BuiltIn(AgentKind::Greedy.into());
    let paced = Policy {
        pace: Some(ms(50)),
        ..policy()
    };
    let mut table = Table::empty(paced, fills);
    assert_eq!(table.core.awaited_in_public(), None);
    table.fill();
    while table.open().0 == Seat::new(3) {
        assert_eq!(table.core.awaited_in_public(), None, "a built-in agent");
        table.pass_time(ms(50));
    }
    let (seat, decision) = table.open();
    let since = table.now;
    let mut awaited = Awaited {
        seat,
        decision,
        away: false,
        absence_counts: false,
        since,
        until: Some(since + ms(1500)),
    };
    assert_eq!(table.core.awaited_in_public(), Some(awaited));
    table.pass_time(ms(100));
    lose(&mut table, seat);
    (awaited.away, awaited.absence_counts) = (true, true);
    awaited.until = Some(since + ms(500));
    assert_eq!(table.core.awaited_in_public(), Some(awaited));
    table.pass_time(ms(400));
    assert_ne!(table.core.awaited_in_public().map(|it| it.seat), Some(seat));
}

#[test]
fn the_absence_time_runs_after_the_time_to_return_from_a_restart() {
    let mut table = Table::playing(policy());
    table.play_one();
    let (seat, id) = table.open();
    table.restart(ms(10));
    for other in table.core.all_seats().filter(|other| *other != seat) {
        table.attach(other);
    }
    let awaited = table.core.awaited_in_public().expect("it is awaited");
    assert!(awaited.away);
    assert_eq!(awaited.until, Some(table.now + RECALL_TIME + ms(400)));
    table.pass_time(RECALL_TIME + ms(399));
    assert_eq!(table.open(), (seat, id), "a millisecond is left");
    table.pass_time(ms(1));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    assert_eq!(table.substituted(), 1);
    table.assert_replays();
}

#[test]
fn games_of_earlier_servers_do_not_mind_absences() {
    let mut table = Table::playing(Policy {
        absence_time: None,
        ..policy()
    });
    let (seat, _) = table.open();
    lose(&mut table, seat);
    table.pass_time(ms(1499));
    assert_eq!(table.core.decisions(), 0);
    table.pass_time(ms(1));
    assert_eq!(table.last_decision().source, Source::Disconnected);
    assert_eq!(table.last_decision().bank_left_ms, 0);
    assert_eq!(table.substituted(), 0);
}

/// What happens next at the table of a random game.
#[derive(Debug, Clone)]
enum Step {
    Answer,
    Lose(usize),
    Attach(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => Just(Step::Answer),
        3 => (0..3usize).prop_map(Step::Lose),
        2 => (0..3usize).prop_map(Step::Attach),
        8 => (1..40u64).prop_map(Step::Wait),
    ]
}

/// The time of an open decision, counted in ticks.
#[derive(Debug, Default)]
struct Counted {
    decision: Option<(Seat, u64)>,
    passed: Duration,
    /// While the seat was not connected.
    absent: Duration,
    /// Beyond the decision time, while the seat was connected.
    banked: Duration,
}

const TICK: Duration = Duration::from_millis(10);

/// A random game with a seat, the last, that is always here and answers at once.
struct RandomGame {
    table: Table,
    connections: Vec<Option<ConnectionId>>,
    counted: Counted,
    banks: Vec<Duration>,
    read: usize,
}

impl RandomGame {
    fn take(&mut self, step: &Step) {
        match *step {
            Step::Answer => {
                let seat = self.table.core.open().map(|open| open.decision.seat);
                if seat.is_some_and(|seat| self.connections[seat.index()].is_some()) {
                    self.table.play_one();
                }
            }
            Step::Lose(seat) => {
                if let Some(connection) = self.connections[seat].take() {
                    self.table.lost(Seat::new(seat), connection);
                }
            }
            Step::Attach(seat) => {
                if self.connections[seat].is_none() {
                    self.connections[seat] = Some(self.table.attach(Seat::new(seat)));
                }
            }
            Step::Wait(ticks) => (0..ticks).for_each(|_| self.tick()),
        }
        self.settle();
    }

    fn tick(&mut self) {
        self.settle();
        if let Some((seat, _)) = self.counted.decision {
            self.counted.passed += TICK;
            if self.connections[seat.index()].is_none() {
                self.counted.absent += TICK;
            } else if self.counted.passed > policy().decision_time {
                self.counted.banked += TICK;
            }
        }
        self.table.pass_time(TICK);
        self.settle();
    }

    /// Checks what was decided, and starts to count for the decision that is open now.
    fn settle(&mut self) {
        loop {
            self.check_decided();
            let last = Seat::new(SEATS - 1);
            match self.table.core.awaited() {
                Some(open) if open.decision.seat == last => {
                    self.table.play_one();
                }
                _ => break,
            }
        }
        let open = self.table.core.awaited();
        let open = open.map(|open| (open.decision.seat, open.id));
        if open != self.counted.decision {
            self.counted = Counted {
                decision: open,
                ..Counted::default()
            };
        }
    }

    fn check_decided(&mut self) {
        let policy = policy();
        let absence_time = policy.absence_time.expect("it has one");
        let entries = &self.table.journal[self.read..];
        for (index, entry) in entries.iter().enumerate() {
            let Change::Decided(decided) = &entry.change else {
                continue;
            };
            let bank = &mut self.banks[decided.seat.index()];
            let counts = self.counted.decision.take();
            if counts.is_some_and(|(seat, _)| seat == decided.seat) {
                *bank -= self.counted.banked;
            }
            assert_eq!(Duration::from_millis(decided.bank_left_ms.into()), *bank);
            let most = policy.decision_time + policy.bank + absence_time;
            assert!(Duration::from_micros(decided.time_us) <= most);
            if decided.source == Source::Disconnected {
                let own = policy.decision_time + self.counted.banked + *bank;
                let away = self.counted.absent == absence_time;
                assert!(away || self.counted.passed >= own, "{:?}", self.counted);
                let next = entries.get(index + 1).map(|entry| &entry.change);
                let over = self.table.core.state().is_over();
                let given =
                    matches!(next, Some(Change::Substituted(seat)) if *seat == decided.seat);
                assert!(given == away || over, "{next:?}");
            }
        }
        self.read = self.table.journal.len();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn absences_are_bounded_and_use_no_bank(steps in proptest::collection::vec(step(), 1..150)) {
        let rules = one_shift();
        let forgiving = Policy { max_timeouts: 1000, ..policy() };
        let mut table = Table::with_rules(forgiving, vec![OPEN; SEATS], rules);
        table.fill();
        let connections = table.core.all_seats().map(|seat| Some(first_connection(seat)));
        let mut game = RandomGame {
            connections: connections.collect(),
            counted: Counted::default(),
            banks: vec![policy().bank; SEATS],
            read: table.journal.len(),
            table,
        };
        game.settle();
        for step in &steps {
            if game.table.core.state().is_over() {
                break;
            }
            game.take(step);
        }
        game.table.assert_replays();
    }
}
