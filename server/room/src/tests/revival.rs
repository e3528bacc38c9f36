//! Restarts of the server: the game resumes where its journal ended, clients get time to return,
//! and built-in agents decide as they would have done without the restart.

use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::AgentKind;
use chefshat_engine::{ActionId, Event, Game, Seat, Seed, TakenOver};

use super::{Answer, Core, OPEN, Table, Verdict, ms, one_shift};
use crate::journal::{Branch, Change, Entry, Fill, GameHeader, ParticipantKind, Source};
use crate::log::RoomEvent;
use crate::policy::Policy;
use crate::testing::{first_connection, id, shifts};
use crate::{BUILT_IN_BUDGET, BadJournal, JOIN_HOLD, MAX_EVENTS_KEPT, RECALL_TIME, State};

impl Table {
    /// Simulates a crash and a restart after `downtime`.
    pub(super) fn restart(&mut self, downtime: Duration) {
        self.now += downtime;
        let header = Arc::clone(self.core.header());
        self.core = Core::revived(header, &self.journal, self.now).expect("a consistent journal");
        self.commit();
    }
}

fn policy() -> Policy {
    Policy {
        decision_time: ms(1_000),
        bank: ms(500),
        ..Policy::default()
    }
}

#[test]
fn the_open_decision_stays_open_and_its_clock_waits_for_the_seat() {
    let mut table = Table::playing(policy());
    for _ in 0..20 {
        table.play_one();
    }
    let (seat, id) = table.open();
    let legal = table.core.legal_actions();
    // Its time is nearly up when the server crashes.
    table.pass_time(ms(1_400));
    table.restart(Duration::from_secs(3_600));
    assert_eq!(table.open(), (seat, id));
    assert_eq!(table.core.legal_actions(), legal);
    assert_eq!(
        table.happened(|it| matches!(it, RoomEvent::ServerRestarted)),
        1
    );
    table.assert_replays();
    // It returns late, but within the recall time, and has its full time again.
    table.pass_time(RECALL_TIME - ms(10));
    assert_eq!(table.open(), (seat, id), "the clock waited for it");
    table.attach(seat);
    assert_eq!(table.happened(|it| matches!(it, RoomEvent::Returned(_))), 1);
    let (left, bank) = table.core.time_left(table.now);
    assert_eq!((left, bank), (ms(1_000), ms(500)));
    table.pass_time(ms(1_499));
    assert_eq!(table.open(), (seat, id), "a millisecond is left");
    let action = table.legal(0);
    assert_eq!(table.answer(seat, id, action).verdict, Verdict::Accepted);
    assert_eq!(table.last_decision().source, Source::Agent);
    table.assert_replays();
}

#[test]
fn a_long_game_is_restored_with_its_last_events_alone() {
    let delayed = Policy {
        spectator_delay_decisions: 3,
        ..policy()
    };
    let mut table = Table::with_rules(delayed, vec![OPEN; 4], shifts(1_000));
    table.fill();
    let mut lengths = Vec::new();
    while table.core.log().len() < 2 * MAX_EVENTS_KEPT {
        table.play_one();
        lengths.push(table.core.log().len());
    }
    // The Shift in progress stays, whatever is dropped.
    let length = table.core.log().len();
    table.core.drop_log_before(length);
    let starts = |event: &RoomEvent| match event {
        RoomEvent::Game(game) => matches!(game.event, Event::ShiftStarted { .. }),
        _ => false,
    };
    assert_eq!(table.happened(starts), 1);
    let shown = lengths[lengths.len() - 4];
    assert_eq!(table.core.visible_to_spectators(), shown);
    table.restart(ms(1));
    let log = table.core.log();
    let (kept, length) = (log.kept(), log.len());
    assert!((MAX_EVENTS_KEPT..2 * MAX_EVENTS_KEPT).contains(&kept));
    // The restart is one more event.
    assert_eq!(length, lengths[lengths.len() - 1] + 1);
    assert!(log.get(length - MAX_EVENTS_KEPT).is_some() && log.get(0).is_none());
    assert_eq!(table.core.visible_to_spectators(), shown);
}

#[test]
fn what_delayed_spectators_have_not_seen_stays_also_after_a_restart() {
    let delayed = Policy {
        spectator_delay_decisions: 10_000,
        ..policy()
    };
    let mut table = Table::with_rules(delayed, vec![OPEN; 4], shifts(1_000));
    table.fill();
    while table.core.log().len() < 2 * MAX_EVENTS_KEPT {
        table.play_one();
    }
    table.restart(ms(1));
    assert!(table.core.log().first() <= table.core.visible_to_spectators());
}

#[test]
fn a_seat_that_does_not_return_times_out_as_usual() {
    let mut table = Table::playing(policy());
    table.play_one();
    let (seat, id) = table.open();
    table.restart(ms(10));
    table.pass_time(RECALL_TIME + ms(1_499));
    assert_eq!(table.open(), (seat, id));
    table.pass_time(ms(1));
    assert_ne!(table.open(), (seat, id));
    assert_eq!(table.last_decision().source, Source::Disconnected);
}

#[test]
fn the_clock_waits_for_the_next_seat_too() {
    let mut table = Table::playing(policy());
    let (first, _) = table.open();
    table.restart(ms(10));
    table.attach(first);
    let first = table.play_one();
    let (second, id) = table.open();
    assert_ne!(first, second);
    table.pass_time(RECALL_TIME - ms(10));
    assert_eq!(table.open(), (second, id), "the clock waited for it");
    table.attach(second);
    table.play_one();
}

#[test]
fn an_acknowledged_answer_is_acknowledged_again() {
    let mut table = Table::playing(policy());
    let (seat, decision_id) = table.open();
    let action = table.legal(0);
    let answered = table.answer(seat, decision_id, action);
    table.restart(ms(10));
    table.attach(seat);
    let again = table.core.answer(
        table.now,
        seat,
        Answer::new(decision_id, action),
        table.now,
        None,
    );
    assert_eq!(again, answered);
    assert!(table.core.pending().is_empty(), "it counts only once");
}

#[test]
fn built_in_agents_decide_the_same_after_a_restart() {
    let fills = [
        Fill::BuiltIn(AgentKind::Random.into()),
        Fill::BuiltIn(AgentKind::RandomUnmasked.into()),
        Fill::BuiltIn(AgentKind::Greedy.into()),
        Fill::BuiltIn(AgentKind::Random.into()),
    ];
    let paced = Policy {
        pace: Some(ms(10)),
        ..Policy::default()
    };
    let play = |restarts: &[u64]| {
        let mut table = Table::with_rules(paced.clone(), fills.to_vec(), one_shift());
        table.core.begin_if_all_built_in(table.now);
        table.commit();
        for decisions in restarts {
            table.pass_time(ms(10 * decisions));
            table.restart(ms(5));
        }
        table.pass_time(Duration::from_secs(60));
        assert_eq!(table.core.state(), State::Finished);
        table.assert_replays();
        table.decided()
    };
    let undisturbed = play(&[]);
    assert!(undisturbed.len() > 30);
    assert_eq!(play(&[1]), undisturbed);
    assert_eq!(play(&[7, 0, 13, 8]), undisturbed);
}

#[test]
fn commit_time_counts_for_no_seat() {
    let mut table = Table::playing(policy());
    // The commit takes three seconds; the next seat is notified only afterwards.
    table.store_takes = ms(3_000);
    table.play_one();
    let (seat, id) = table.open();
    table.pass_time(ms(1_499));
    assert_eq!(table.open(), (seat, id), "a millisecond is left");
    // Another commit meanwhile does not extend its time.
    table.core.released(table.now);
    table.pass_time(ms(1));
    assert_ne!(table.open(), (seat, id));
    assert_eq!(table.last_decision().time_us, 1_500_000);
}

#[test]
fn a_seat_that_waits_for_the_store_gets_the_time_back() {
    // Its answer is refused after half a second, and the commit takes three.
    let mut table = Table::playing(policy());
    let (seat, id) = table.open();
    table.pass_time(ms(500));
    let wrong = table.illegal();
    table.store_takes = ms(3_000);
    assert_ne!(table.answer(seat, id, wrong).verdict, Verdict::Accepted);
    table.pass_time(ms(999));
    let action = table.legal(0);
    let answered = table.answer(seat, id, action);
    assert_eq!(answered.verdict, Verdict::Accepted);
    assert_eq!(answered.time, ms(1_499), "only the time of the agent");

    // It loses its connection and returns after half a second; that commit takes three.
    let (seat, id) = table.open();
    table.lost(seat, first_connection(seat));
    let lost = table.now;
    table.pass_time(ms(500));
    table.store_takes = ms(3_000);
    table.attach(seat);
    table.pass_time(ms(999));
    assert_eq!(table.open(), (seat, id));
    table.pass_time(ms(1));
    assert_eq!(table.last_decision().seat, seat);
    assert_eq!(table.last_decision().time_us, 1_500_000);
    assert_eq!(table.now, lost + ms(4_500));
}

#[test]
fn the_timer_does_not_fire_for_a_seat_that_waits_for_the_store() {
    let mut table = Table::playing(policy());
    let (seat, id) = table.open();
    table.pass_time(ms(500));
    // The room was waiting for the store, and finds the answer and the deadline at the same time.
    let (answer, arrived) = (Answer::new(id, table.illegal()), table.now);
    table.now += ms(3_000);
    let handed = Some(Duration::ZERO);
    (table.core).answer(table.now, seat, answer, arrived, handed);
    table.core.tick(table.now, Some(Duration::ZERO));
    table.commit();
    assert_eq!(table.open(), (seat, id));
    table.pass_time(ms(1_000));
    assert_eq!(table.last_decision().source, Source::Timeout);
    assert_eq!(table.last_decision().time_us, 1_500_000);
}

#[test]
fn invalid_answers_gain_no_time_from_a_fast_store() {
    let mut table = Table::playing(policy());
    let (seat, id) = table.open();
    let opened = table.now;
    for _ in 0..5 {
        table.pass_time(ms(100));
        let wrong = table.illegal();
        table.store_takes = ms(20);
        table.answer(seat, id, wrong);
    }
    table.pass_time(opened + ms(1_500) - table.now);
    assert_eq!(table.last_decision().source, Source::Timeout);
    assert_eq!(table.last_decision().seat, seat);
}

#[test]
fn a_substitute_plays_until_the_agent_returns() {
    let mut table = Table::playing(policy());
    while table.substituted() == 0 {
        let (seat, _) = table.open();
        if seat == Seat::new(2) {
            // Exactly as long as it takes to time out.
            table.pass_time(ms(10));
        } else {
            table.play_one();
        }
    }
    table.restart(ms(10));
    assert!(table.core.standing(Seat::new(2)).substituted);
    table.attach(Seat::new(2));
    assert!(!table.core.standing(Seat::new(2)).substituted);
    table.assert_replays();
}

#[test]
fn a_waiting_room_keeps_its_seats_for_returning_clients() {
    let mut table = Table::empty(
        Policy {
            waiting_time: ms(10_000),
            ..policy()
        },
        vec![OPEN; 4],
    );
    table.join_all(ParticipantKind::Agent);
    table.attach(Seat::new(0));
    // The waiting time is long over when the server is restarted.
    table.restart(Duration::from_secs(86_400));
    assert_eq!(table.core.state(), State::Waiting);
    table.pass_time(JOIN_HOLD - ms(1));
    assert_eq!(table.core.state(), State::Waiting);
    table.attach_all();
    assert_eq!(table.core.state(), State::Playing);
    table.assert_replays();

    let mut abandoned = Table::empty(policy(), vec![OPEN; 4]);
    abandoned.join(ParticipantKind::Agent).expect("free");
    abandoned.attach(Seat::new(0));
    abandoned.restart(ms(10));
    abandoned.pass_time(JOIN_HOLD);
    assert_eq!(
        abandoned.happened(|it| matches!(it, RoomEvent::Vacated(_))),
        1
    );
}

#[test]
fn a_finished_game_stays_finished() {
    let mut table = Table::with_rules(policy(), vec![OPEN; 4], one_shift());
    table.fill();
    while table.core.state() == State::Playing {
        table.play_one();
    }
    let entries = table.journal.len();
    table.restart(ms(10));
    assert_eq!(table.core.state(), State::Finished);
    assert_eq!(table.journal.len(), entries);
    // A server that took the room over said so before it knew that the game was over.
    let log = table.core.log().len();
    table.journal.push(Entry {
        at: table.now,
        change: Change::ServerRestarted,
    });
    table.restart(ms(10));
    assert_eq!(table.core.state(), State::Finished);
    assert_eq!(table.core.log().len(), log);
}

#[test]
fn a_takeover_is_one_restart() {
    let mut table = Table::playing(policy());
    table.play_one();
    let restarts = |table: &Table| table.happened(|it| matches!(it, RoomEvent::ServerRestarted));
    // The server that took the room over has said so before it read the journal.
    table.journal.push(Entry {
        at: table.now,
        change: Change::ServerRestarted,
    });
    table.restart(ms(10));
    assert_eq!(restarts(&table), 1);
    table.assert_replays();
    table.restart(ms(1_000));
    assert_eq!(restarts(&table), 2);
    table.assert_replays();
}

#[test]
fn an_inconsistent_journal_is_refused() {
    let mut table = Table::playing(policy());
    for _ in 0..5 {
        table.play_one();
    }
    let header = table.core.header();
    let last = table.journal.len() - 1;
    type Damage = fn(&mut Change);
    let damages: [(&str, Damage); 4] = [
        ("not legal", |change| {
            if let Change::Decided(decided) = change {
                decided.action = ActionId::new(9_999);
            }
        }),
        ("no open decision", |change| {
            if let Change::Decided(decided) = change {
                decided.seat = Seat::new((decided.seat.index() + 1) % 4);
            }
        }),
        ("twice", |change| {
            *change = Change::Started {
                entropy: vec![Vec::new(); 4],
            };
        }),
        ("does not exist", |change| {
            *change = Change::Disconnected {
                seat: Seat::new(5),
                with_node: false,
            }
        }),
    ];
    for (words, damage) in damages {
        let mut journal = table.journal.clone();
        damage(&mut journal[last].change);
        let refused = Core::revived(Arc::clone(header), &journal, table.now);
        let BadJournal { entry, problem } = refused.expect_err(words);
        assert_eq!(entry, last + 1);
        assert!(problem.contains(words), "{problem}");
    }
}

#[test]
fn a_long_branch_is_taken_over_in_pieces_and_across_a_restart() {
    // A recorded game of six Shifts, by first legal actions.
    let seed = Seed([5; 32]);
    let rules = shifts(6).validate().expect("a valid rule set");
    let mut game = Game::new(rules, seed, |_| {});
    let mut actions = Vec::new();
    while !game.is_over() {
        let action = game.legal_actions().nth(0).expect("a legal action");
        game.apply(action, |_| {}).expect("it is legal");
        actions.push(action);
    }
    actions.truncate(actions.len() - 3);
    let count = u64::try_from(actions.len()).expect("small");
    assert!(actions.len() > 3 * BUILT_IN_BUDGET, "{count}");
    let mut table = Table::with_rules(Policy::default(), vec![OPEN; 4], shifts(6));
    let mut header = GameHeader::clone(table.core.header());
    header.start.branch = Some(Branch {
        game: id(9),
        same_deals: true,
        taken_over: vec![TakenOver { seed, actions }],
    });
    table.core = Core::new(Arc::new(header));
    table.fill();
    let mut ticks = 0;
    while table.core.decisions() < count {
        assert!(table.core.awaited().is_none(), "no seat is asked");
        let deadline = table.core.deadline().expect("there is more to do");
        assert!(deadline <= table.now, "at once");
        table.core.tick(table.now, None);
        assert!(table.core.pending().len() <= BUILT_IN_BUDGET);
        table.commit();
        ticks += 1;
        if ticks == 2 {
            table.restart(ms(1_000));
        }
    }
    assert!(ticks >= 3);
    assert_eq!(table.core.decisions(), count);
    assert!(table.core.awaited().is_some(), "a seat is asked");
    let recorded = (table.journal.iter()).filter(|entry| {
        matches!(&entry.change, Change::Decided(decided) if decided.source == Source::Recorded)
    });
    assert_eq!(recorded.count() as u64, count);
    table.assert_replays();
}
