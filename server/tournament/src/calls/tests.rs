//! The scheduler gives the same changes as checking every due game each time, with few checks.

use std::collections::BTreeMap;

use super::super::chance::Chance;
use super::super::{Entrant, Format, Leaving, Settings, testing};
use super::*;
use chefshat_agents::AgentKind;

fn settings() -> Settings {
    Settings {
        rounds: Some(50),
        max_participants: 400,
        max_parallel: 256,
        ..testing::settings(Format::RoundRobin)
    }
}

fn join(tournament: &mut Tournament, max_games: usize, built_in: Option<AgentKind>) {
    add(
        tournament,
        Entrant {
            built_in: built_in.map(Into::into),
            max_games,
            ..testing::entrant("")
        },
    );
}

/// Adds an entrant, with a name of its own.
fn add(tournament: &mut Tournament, entrant: Entrant) {
    let name = format!("agent {}", tournament.participants().len());
    let change = tournament.join(Entrant { name, ..entrant });
    tournament.fold(&change.expect("a free place"));
}

fn end_one(tournament: &mut Tournament, game: usize, ended: Ended) {
    let change = tournament.ended(game, ended).expect("it is being played");
    tournament.fold(&change);
}

fn played() -> Ended {
    let seats = (1..=4).map(|place| SeatStatistics {
        place,
        substituted: place == 2,
        ..SeatStatistics::default()
    });
    Ended::Played {
        shifts: 3,
        seats: seats.collect(),
    }
}

/// Starts with `rounds` rounds of random pairings.
fn draw(tournament: &mut Tournament, rounds: u32, chance: &mut Chance) {
    tournament.fold(&Change::Begun { rounds });
    let mut order: Vec<usize> = (0..tournament.participants().len()).collect();
    for round in 1..=rounds {
        chance.shuffle(&mut order);
        let tables = order.chunks_exact(4);
        tournament.fold(&Change::Drawn {
            round,
            byes: tables.remainder().to_vec(),
            tables: tables.map(<[usize]>::to_vec).collect(),
        });
    }
}

/// Checks every due game, in order.
#[derive(Default)]
struct Scan {
    waits: BTreeMap<usize, u64>,
    full: bool,
    open_since: u64,
}

impl Scan {
    fn next(
        &mut self,
        state: &TournamentState,
        scheduler: &Scheduler,
        now_ms: u64,
    ) -> Option<Change> {
        let settings = &state.settings;
        if state.phase != State::Playing {
            return None;
        }
        if state.is_round_over() && !state.paused {
            return Some(Change::Finished);
        }
        let was_full = self.full;
        self.full = state.paused || state.playing.len() >= settings.max_parallel;
        if self.full {
            return None;
        }
        if was_full {
            self.open_since = now_ms;
            (self.waits.values_mut()).for_each(|since| *since = (*since).max(now_ms));
        }
        for &(_, index) in &state.due {
            let game = &state.games[index];
            match readiness(state, scheduler, game) {
                Readiness::Busy(_) | Readiness::NoTable => drop(self.waits.remove(&index)),
                Readiness::Ready(forfeited) => return Some(called(index, game, forfeited)),
                Readiness::Missing(missing) => {
                    let from = scheduler.awaits_from(state, game, now_ms);
                    let from = from.max(self.open_since);
                    let since = *self.waits.entry(index).or_insert(from);
                    if now_ms.saturating_sub(since) < settings.no_show_ms {
                        continue;
                    }
                    let game = index;
                    return Some(if state.games[game].calls + 1 < settings.max_calls {
                        Change::Rescheduled {
                            game,
                            missing,
                            never_started: false,
                        }
                    } else {
                        called(game, &state.games[game], missing)
                    });
                }
            }
        }
        None
    }

    /// After the state has folded the change.
    fn fold(&mut self, state: &TournamentState, change: &Change) {
        match change {
            Change::Called { game, .. }
            | Change::Rescheduled { game, .. }
            | Change::Postponed { game, .. }
            | Change::Recalled { game }
            | Change::Voided { game } => drop(self.waits.remove(game)),
            Change::Withdrawn { participant, .. } | Change::Replaced { participant, .. } => {
                (self.waits).retain(|&game, _| !state.games[game].seats.contains(participant));
            }
            _ => {}
        }
        // Something else than absence blocks these now.
        self.waits.retain(|&game, _| {
            let game = &state.games[game];
            let has_table = !game.physical || state.has_free_table();
            let may_play = |&who: &usize| state.forfeits(game, who) || state.has_capacity(who);
            has_table && game.seats.iter().all(may_play)
        });
    }

    fn wake_at(&self, state: &TournamentState) -> Option<u64> {
        if self.full {
            return None;
        }
        let since = self.waits.values().min()?;
        Some(since + state.settings.no_show_ms)
    }
}

/// A change by hand, now and then.
fn by_hand(tournament: &Tournament, chance: &mut Chance) -> Option<(&'static str, Change)> {
    let who = chance.below(tournament.participants().len());
    let game = chance.below(tournament.games().len());
    let (what, change) = match chance.below(if tournament.is_paused() { 8 } else { 60 }) {
        0 => (
            "paused or resumed",
            tournament.set_paused(!tournament.is_paused()).ok()?,
        ),
        1 => ("withdrawn", tournament.withdraw(who, Leaving::Itself).ok()?),
        2 | 3 => {
            let by = Entrant {
                built_in: (chance.below(3) == 0).then_some(AgentKind::Random.into()),
                max_games: 1 + chance.below(2),
                ..testing::entrant(&format!("other {}", chance.below(1 << 30)))
            };
            ("replaced", tournament.replace(who, by).ok())
        }
        4 => ("postponed", tournament.postpone(game, None).ok()),
        5 | 6 => ("recalled", tournament.recall(game).ok()),
        _ => return None,
    };
    Some((what, change?))
}

/// Plays a random tournament. Returns the number of changes requested, and how often each happened.
fn compare(seed: u8) -> (usize, BTreeMap<&'static str, usize>) {
    let mut chance = Chance::of_round([seed; 32], 1);
    let mut tournament = Tournament::new(Settings {
        games_per_pairing: 1 + chance.below(3) as u32,
        max_calls: 1 + chance.below(3) as u32,
        max_parallel: [1, 2, 256][chance.below(3)],
        physical_tables: 1 + chance.below(2),
        ..settings()
    })
    .expect("valid settings");
    let participants = 4 + chance.below(9);
    for _ in 0..participants {
        let built_in = (chance.below(8) == 0).then_some(AgentKind::Random);
        join(&mut tournament, 1 + chance.below(2), built_in);
    }
    // Of every second tournament all games are virtual.
    for _ in 0..[0, 1 + chance.below(3)][usize::from(seed % 2)] {
        let at_table = Entrant {
            at_table: true,
            ..testing::entrant("")
        };
        add(&mut tournament, at_table);
    }
    draw(&mut tournament, 6, &mut chance);
    let mut scan = Scan::default();
    let (mut now_ms, mut asked) = (0, 0);
    let mut happened = BTreeMap::new();
    while tournament.state() == State::Playing {
        loop {
            let expected = scan.next(&tournament.state, &tournament.scheduler, now_ms);
            let next = tournament.next(now_ms);
            assert_eq!(next, expected, "seed {seed}, {now_ms} ms");
            asked += 1;
            let Some(change) = next else { break };
            let what = match &change {
                Change::Called { game, .. } if tournament.games()[*game].physical => "at a table",
                Change::Called { forfeited, .. } if forfeited.is_empty() => "called",
                Change::Called { .. } => "forfeited",
                Change::Rescheduled { .. } => "rescheduled",
                Change::Voided { .. } => "voided",
                _ => "other",
            };
            *happened.entry(what).or_default() += 1;
            tournament.fold(&change);
            scan.fold(&tournament.state, &change);
        }
        let wake_at = tournament.wake_at();
        assert_eq!(wake_at, scan.wake_at(&tournament.state), "seed {seed}");
        now_ms += chance.below(700) as u64;
        for _ in 0..chance.below(4) {
            let who = chance.below(participants);
            // Mostly present, except the first participant.
            let present = chance.below(8) >= if who == 0 { 7 } else { 2 };
            tournament.set_present(who, present);
            let Tournament {
                state, scheduler, ..
            } = &tournament;
            let is_there = |who: &usize| scheduler.is_present(state, *who);
            (scan.waits).retain(|&game, _| !state.games[game].seats.iter().all(is_there));
        }
        if let Some((what, change)) = by_hand(&tournament, &mut chance) {
            *happened.entry(what).or_default() += 1;
            tournament.fold(&change);
            scan.fold(&tournament.state, &change);
        }
        let playing: Vec<usize> = tournament.playing().collect();
        for game in playing {
            let ended = match chance.below(10) {
                0 => Ended::Aborted,
                1 => Ended::NeverStarted {
                    missing: vec![tournament.games()[game].seats[chance.below(4)]],
                },
                2..5 => played(),
                _ => continue,
            };
            end_one(&mut tournament, game, ended);
        }
    }
    (asked, happened)
}

#[test]
fn changes_equal_those_of_checking_every_game() {
    let mut happened: BTreeMap<&str, usize> = BTreeMap::new();
    for seed in 0..200 {
        let (asked, tally) = compare(seed);
        assert!(asked > 10);
        for (what, times) in tally {
            *happened.entry(what).or_default() += times;
        }
    }
    for what in [
        "called",
        "forfeited",
        "at a table",
        "rescheduled",
        "voided",
        "paused or resumed",
        "withdrawn",
        "replaced",
        "postponed",
        "recalled",
    ] {
        assert!(happened[what] > 50, "{happened:?}");
    }
}

/// A tournament with all of its rounds paired.
fn drawn(participants: usize, rounds: u32) -> Tournament {
    let mut tournament = Tournament::new(settings()).expect("valid settings");
    (0..participants).for_each(|_| join(&mut tournament, 1, None));
    draw(&mut tournament, rounds, &mut Chance::of_round([1; 32], 1));
    tournament
}

fn follow(tournament: &mut Tournament, now_ms: u64) -> usize {
    let mut changes = 0;
    while let Some(change) = tournament.next(now_ms) {
        tournament.fold(&change);
        changes += 1;
    }
    changes
}

#[test]
fn few_games_are_checked_after_one_has_ended() {
    let mut tournament = drawn(400, 50);
    (0..400).for_each(|who| tournament.set_present(who, true));
    follow(&mut tournament, 0);
    let games = tournament.games().len() as u64;
    assert_eq!(games, 5000);
    assert!(tournament.scheduler.checks < 2 * games);
    // Games end in the order of their calls.
    loop {
        let Some(game) = tournament.playing().next() else {
            break;
        };
        end_one(&mut tournament, game, played());
        follow(&mut tournament, 0);
    }
    assert_eq!(tournament.state(), State::Finished);
    let checks = tournament.scheduler.checks;
    assert!(checks < 40 * games, "{checks}");
}

#[test]
fn few_games_are_checked_while_everyone_is_absent() {
    let mut tournament = drawn(400, 50);
    let games = tournament.games().len() as u64;
    assert_eq!(follow(&mut tournament, 0), 0);
    assert_eq!(tournament.scheduler.checks, games);
    for now_ms in 1..100 {
        assert_eq!(follow(&mut tournament, now_ms), 0);
    }
    assert_eq!(tournament.scheduler.checks, games, "nothing has happened");
    tournament.set_present(0, true);
    assert_eq!(follow(&mut tournament, 100), 0);
    assert_eq!(tournament.scheduler.checks, games + 50, "only its own");
    // Called again, then voided.
    assert_eq!(follow(&mut tournament, 1000) as u64, games);
    assert_eq!(follow(&mut tournament, 2000) as u64, games - 49);
    let checks = tournament.scheduler.checks;
    assert!(checks < 8 * games, "{checks}");
}

/// A draw takes a while, so it is known beforehand when one comes.
#[test]
fn rounds_are_drawn_exactly_when_they_are_due() {
    for format in [Format::RoundRobin, Format::Swiss, Format::Knockout] {
        let settings = Settings {
            start_when_joined: Some(8),
            ..testing::settings(format)
        };
        let mut tournament = testing::joined(settings, [None; 8]);
        while !tournament.state().is_over() {
            let is_due = tournament.is_draw_due();
            let mut paused = tournament.clone();
            if let Ok(Some(pause)) = paused.set_paused(true) {
                paused.fold(&pause);
                assert!(!paused.is_draw_due(), "{format:?}");
            }
            if let Some(change) = tournament.next(0) {
                let draws = matches!(
                    change,
                    Change::Joined(_) | Change::Begun { .. } | Change::Drawn { .. }
                );
                assert_eq!(draws, is_due, "{format:?}: {change:?}");
                tournament.fold(&change);
            } else {
                let game = tournament.playing().next().expect("it is not over");
                end_one(&mut tournament, game, played());
            }
        }
    }
}
