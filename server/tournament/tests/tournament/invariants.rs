//! Invariants under arbitrary arrivals, departures and results: a tournament ends, limits of
//! parallel games hold, every game counts once, and the same changes give the same tournament, also
//! after an interruption.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_agents::AgentKind;
use chefshat_tournament::{
    Change, Deals, Ended, Entrant, Format, GameState, Leaving, ParticipantKind, Settings, State,
    Tournament,
};
use proptest::prelude::*;

use super::support::{begun, entrant, play_through, played, settings};

/// The participants of a run and their behaviour.
#[derive(Debug, Clone)]
struct Plan {
    settings: Settings,
    entrants: Vec<Entrant>,
    /// Random choices, repeated cyclically.
    dice: Vec<u8>,
    /// Maximum number of changes by hand.
    by_hand: usize,
}

fn entrants() -> impl Strategy<Value = Vec<Entrant>> {
    // Built-in, at a physical table, or a client.
    let place = prop::sample::select(vec![0, 1, 2, 2, 2]);
    let kind = (1..=3usize, place);
    let sizes = prop_oneof![2..=12usize, 13..=64usize];
    sizes
        .prop_flat_map(move |count| prop::collection::vec(kind.clone(), count))
        .prop_map(|kinds| {
            let numbered = kinds.into_iter().enumerate();
            let numbered_entrant = |(number, (max_games, place)): (usize, (usize, u8))| Entrant {
                kind: ParticipantKind::Robot,
                built_in: (place == 0).then_some(AgentKind::Greedy.into()),
                max_games: if place == 1 { 1 } else { max_games },
                at_table: place == 1,
                ..entrant(&format!("entrant {number}"))
            };
            numbered.map(numbered_entrant).collect()
        })
}

fn plans() -> impl Strategy<Value = Plan> {
    let what = (
        prop::sample::select(Format::ALL.to_vec()),
        prop::sample::select(Deals::ALL.to_vec()),
        2..=6usize,
        1..=3u32,
        1..=5u32,
    );
    let how = (
        1..=3u32,
        1..=8usize,
        0..=3usize,
        any::<[u8; 32]>(),
        prop::sample::select(vec![0, 5, 50]),
    );
    let dice = prop::collection::vec(any::<u8>(), 16..200);
    (what, how, entrants(), dice).prop_map(|(what, how, mut entrants, dice)| {
        let (format, mut deals, players, games_per_pairing, rounds) = what;
        let (max_calls, max_parallel, physical_tables, draw_seed, by_hand) = how;
        if physical_tables == 0 {
            entrants.iter_mut().for_each(|it| it.at_table = false);
        } else {
            deals = Deals::Independent;
        }
        let is_knockout = format == Format::Knockout;
        let players = if is_knockout { 4 } else { players };
        let settings = Settings {
            players,
            points: (0..players as u32).rev().collect(),
            rounds: (!is_knockout).then_some(rounds),
            games_per_pairing,
            deals,
            max_calls,
            max_parallel,
            physical_tables,
            draw_seed,
            ..settings(format)
        };
        Plan {
            settings,
            entrants,
            dice,
            by_hand,
        }
    })
}

/// A run of a plan: the tournament, its changes so far, and who is present.
struct Run {
    tournament: Tournament,
    changes: Vec<Change>,
    present: BTreeMap<usize, bool>,
    dice: Vec<u8>,
    rolls: usize,
    now_ms: u64,
    by_hand: usize,
    /// By void game, how often it was called again.
    revived: BTreeMap<usize, usize>,
}

impl Run {
    fn die(&mut self, sides: u8) -> u8 {
        // Each repetition adds one to the choices, so that a run cannot repeat itself forever.
        let (turn, roll) = (self.rolls / self.dice.len(), self.rolls % self.dice.len());
        self.rolls += 1;
        self.dice[roll].wrapping_add(turn as u8) % sides
    }

    fn fold(&mut self, change: Change) {
        let games = self.tournament.games();
        if let Change::Called { game, forfeited } = &change {
            assert_eq!(games[*game].state, GameState::Due);
            for who in &games[*game].seats {
                let comes = !forfeited.contains(who);
                assert!(!comes || self.tournament.is_present(*who));
            }
        }
        self.tournament.fold(&change);
        self.changes.push(change);
        self.check();
    }

    /// Checks the limits of parallel games: for each participant, at physical tables and in total.
    fn check(&self) {
        let games = self.tournament.games();
        let mut sits = vec![0; self.tournament.participants().len()];
        for game in self.tournament.playing() {
            for &who in &games[game].seats {
                sits[who] += usize::from(games[game].is_played_by(who));
            }
        }
        for (entrant, tables) in self.tournament.participants().iter().zip(sits) {
            assert!(entrant.built_in.is_some() || tables <= entrant.max_games);
        }
        let at_tables = self.tournament.playing().filter(|game| {
            let mut seats = games[*game].seats.iter();
            seats.any(|who| {
                self.tournament.participants()[*who].at_table && games[*game].is_played_by(*who)
            })
        });
        assert!(at_tables.count() <= self.tournament.settings().physical_tables);
        let parallel = self.tournament.playing().count();
        assert!(parallel <= self.tournament.settings().max_parallel);
    }

    fn follow(&mut self) {
        while let Some(change) = self.tournament.next(self.now_ms) {
            self.fold(change);
        }
    }

    /// A participant arrives or leaves.
    fn wander(&mut self) {
        let participants = self.tournament.participants().len();
        let who = (usize::from(self.die(255)) * 7 + usize::from(self.die(255))) % participants;
        let is_present = self.die(3) > 0;
        self.present.insert(who, is_present);
        self.tournament.set_present(who, is_present);
    }

    /// A participant or the organiser changes something by hand, if it can.
    fn change_by_hand(&mut self) {
        let participants = self.tournament.participants().len();
        let games = self.tournament.games().len();
        let who = (usize::from(self.die(255)) * 7 + usize::from(self.die(255))) % participants;
        let game = (usize::from(self.die(255)) * 7 + usize::from(self.die(255))) % games;
        let (built_in, max_games) = (self.die(2) == 0, usize::from(self.die(3)) + 1);
        let change = match self.die(10) {
            0..3 => {
                let leaving = if built_in {
                    Leaving::Removed
                } else {
                    Leaving::Itself
                };
                self.tournament.withdraw(who, leaving).ok().flatten()
            }
            3..5 => {
                let name = format!("other {}", self.rolls);
                let by = Entrant {
                    built_in: built_in.then_some(AgentKind::Random.into()),
                    max_games,
                    ..entrant(&name)
                };
                self.tournament.replace(who, by).ok()
            }
            5 => self.tournament.set_paused(true).ok().flatten(),
            6 => self.tournament.set_paused(false).ok().flatten(),
            7 => self.tournament.postpone(game, None).ok(),
            8 => self.tournament.postpone(game, Some(who)).ok(),
            _ => self.tournament.recall(game).ok(),
        };
        if let Some(change) = change {
            self.by_hand += 1;
            if let Change::Recalled { game } = &change
                && self.tournament.games()[*game].is_over()
            {
                *self.revived.entry(*game).or_default() += 1;
            }
            self.fold(change);
        }
    }

    /// A game ends, one way or another.
    fn end_one(&mut self) {
        let playing: Vec<usize> = self.tournament.playing().collect();
        if playing.is_empty() {
            return;
        }
        let game = playing[usize::from(self.die(255)) % playing.len()];
        let seats = self.tournament.games()[game].seats.clone();
        let ended = match self.die(8) {
            0 => Ended::Aborted,
            1 => Ended::NeverStarted {
                missing: vec![seats[usize::from(self.die(6)) % seats.len()]],
            },
            turn => {
                let mut places: Vec<usize> = (1..=seats.len()).collect();
                places.rotate_left(usize::from(turn) % seats.len());
                played(&places)
            }
        };
        let change = self.tournament.ended(game, ended).unwrap();
        self.fold(change);
    }

    /// The server restarts: nobody is present, and running games are lost.
    fn restart(&mut self) {
        let mut tournament = Tournament::new(self.tournament.settings().clone()).unwrap();
        self.changes
            .iter()
            .for_each(|change| tournament.fold(change));
        assert!(tournament == self.tournament);
        self.tournament = tournament;
        let playing: Vec<usize> = self.tournament.playing().collect();
        for game in playing {
            let change = self.tournament.ended(game, Ended::Aborted).unwrap();
            self.fold(change);
        }
        for (&who, &is_present) in &self.present {
            self.tournament.set_present(who, is_present);
        }
    }

    fn games_left(&self) -> usize {
        self.tournament.games_expected() - self.tournament.games_over()
    }
}

fn run(plan: Plan) -> Run {
    let plan_by_hand = plan.by_hand;
    let mut run = Run {
        tournament: Tournament::new(plan.settings).unwrap(),
        changes: Vec::new(),
        present: BTreeMap::new(),
        dice: plan.dice,
        rolls: 0,
        now_ms: 0,
        by_hand: 0,
        revived: BTreeMap::new(),
    };
    for (number, entrant) in plan.entrants.into_iter().enumerate() {
        let change = run.tournament.join(entrant).unwrap();
        run.fold(change);
        run.tournament.set_present(number, true);
        run.present.insert(number, true);
    }
    run.tournament
        .begin()
        .unwrap()
        .into_iter()
        .for_each(|change| run.fold(change));
    // A game ends at most once for each call and participant; half of the steps below end one, or
    // let time pass.
    let calls = run.tournament.settings().max_calls as usize;
    let players = run.tournament.settings().players;
    let most = 40 * (run.games_left() + 1) * (calls + players);
    for step in 0.. {
        // Each change by hand may prolong a few games.
        let most = most + 40 * run.by_hand * (calls + players);
        assert!(step < most, "no end after {step} steps");
        run.follow();
        if run.tournament.state() != State::Playing {
            break;
        }
        match run.die(16) {
            0 | 1 => run.wander(),
            2 if run.die(8) == 0 => run.restart(),
            3 if run.by_hand < plan_by_hand => run.change_by_hand(),
            _ if run.tournament.is_paused() && run.tournament.playing().next().is_none() => {
                let resumed = run.tournament.set_paused(false).unwrap().unwrap();
                run.fold(resumed);
            }
            _ if run.tournament.playing().next().is_some() => run.end_one(),
            _ => match run.tournament.wake_at() {
                Some(at_ms) => run.now_ms = run.now_ms.max(at_ms),
                // Only an absent participant can block it.
                None => panic!("the tournament is stuck, and no participant is awaited"),
            },
        }
    }
    run
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn it_always_ends_and_adds_up(plan in plans()) {
        let run = run(plan);
        let tournament = &run.tournament;
        prop_assert_eq!(tournament.state(), State::Finished);
        prop_assert_eq!(tournament.games().len(), tournament.games_expected());
        prop_assert!(tournament.games().iter().all(|game| game.is_over()));

        // Every game was counted once, or voided once more than it was called again.
        let mut over = vec![0; tournament.games().len()];
        for change in &run.changes {
            if let Change::Counted { game, .. } | Change::Voided { game } = change {
                over[*game] += 1;
            }
        }
        for (game, times) in over.into_iter().enumerate() {
            let revived = run.revived.get(&game).copied().unwrap_or(0);
            prop_assert_eq!(times, 1 + revived, "game {}", game);
        }
        let mut counted = BTreeSet::new();
        for change in &run.changes {
            if let Change::Counted { game, .. } = change {
                prop_assert!(counted.insert(game), "game {}", game);
            }
        }

        // The standings agree with the games.
        let standings = tournament.standings();
        let places: Vec<u32> = standings.iter().map(|line| line.place).collect();
        let expected: Vec<u32> = match tournament.has_counted() {
            true => (1..=standings.len() as u32).collect(),
            false => vec![0; standings.len()],
        };
        prop_assert_eq!(places, expected);
        for line in &standings {
            prop_assert!(line.forfeited <= line.games);
            let seats: Vec<_> = tournament
                .games()
                .iter()
                .filter_map(|game| game.result())
                .flat_map(|result| &result.seats)
                .filter(|seat| seat.participant == line.participant)
                .collect();
            prop_assert_eq!(line.games as usize, seats.len());
            prop_assert_eq!(line.score, seats.iter().map(|seat| u64::from(seat.score)).sum::<u64>());
            prop_assert_eq!(line.places.iter().sum::<u32>(), line.games);
        }
        if tournament.settings().format != Format::Knockout {
            let mean = standings.iter().map(|line| line.mean_score());
            prop_assert!(mean.is_sorted_by(|better, worse| better >= worse));
        }

        // The same changes lead to the same tournament.
        let mut again = Tournament::new(tournament.settings().clone()).unwrap();
        run.changes.iter().for_each(|change| again.fold(change));
        prop_assert!(&again == tournament);
        prop_assert_eq!(again.standings(), standings);
    }
}

#[test]
fn it_resumes_after_any_interruption() {
    for format in Format::ALL {
        let plan = Plan {
            settings: settings(format),
            entrants: (0..9)
                .map(|number| Entrant {
                    kind: ParticipantKind::Human,
                    built_in: Some(AgentKind::Random.into()),
                    stateless: false,
                    ..entrant(&format!("entrant {number}"))
                })
                .collect(),
            dice: vec![3, 9, 5],
            by_hand: 0,
        };
        let whole = run(plan);
        let standings = whole.tournament.standings();
        for cut in 0..=whole.changes.len() {
            let mut resumed = Tournament::new(whole.tournament.settings().clone()).unwrap();
            let (before, after) = whole.changes.split_at(cut);
            before.iter().for_each(|change| resumed.fold(change));
            for change in after {
                // The tournament's own decisions are the same as before.
                if resumed.state() == State::Playing
                    && !matches!(
                        change,
                        Change::Counted { .. } | Change::Rescheduled { .. } | Change::Voided { .. }
                    )
                {
                    assert_eq!(
                        resumed.next(0).as_ref(),
                        Some(change),
                        "{format:?}, cut at {cut}"
                    );
                }
                resumed.fold(change);
            }
            assert!(resumed == whole.tournament);
            assert_eq!(resumed.standings(), standings);
        }
    }
}

#[test]
fn every_size_ends_in_every_format() {
    for format in Format::ALL {
        for participants in 2..=33 {
            let mut settings = settings(format);
            settings.rounds = (format != Format::Knockout).then_some(4);
            let mut tournament = begun(settings, participants);
            play_through(&mut tournament);
            assert_eq!(tournament.state(), State::Finished);
            assert_eq!(tournament.games().len(), tournament.games_expected());
        }
    }
}
