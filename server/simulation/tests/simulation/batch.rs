//! Batches: independent of the number of threads, with correct totals and reproducible games.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_agents::{AgentKind, Listener, agent_seed, game_seed};
use chefshat_engine::{
    ActionId, Decision, Event, RewardScheme, RuleSet, RuleSetSpec, Seat, Seed, Stop,
};
use chefshat_simulation::{Batch, BatchError, BatchTable};
use rayon::ThreadPoolBuilder;

use AgentKind::{Greedy, Random, RandomUnmasked};

fn standard() -> RuleSet {
    RuleSetSpec::default().validate().unwrap()
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
        .install(work)
}

/// Asserts equality bit for bit, fractions included.
fn assert_identical(left: &BatchTable, right: &BatchTable) {
    assert_eq!(left, right);
    for (seat, sums) in left.seats.iter() {
        let other = &right.seats[seat];
        assert_eq!(sums.reward_sum.to_bits(), other.reward_sum.to_bits());
        assert_eq!(
            sums.performance_sum.to_bits(),
            other.performance_sum.to_bits()
        );
    }
}

#[test]
fn any_number_of_threads_gives_the_same_table() {
    let agents = [Greedy, Random, RandomUnmasked, Random];
    // Not a multiple of the games a thread plays at a time.
    let batch = Batch::new(standard(), &agents, 301, 7)
        .unwrap()
        .with_rewards(RewardScheme::Paper);
    let tables = [1, 2, 3].map(|threads| on_threads(threads, || batch.run(&|_| {})));
    assert_eq!(tables[0].games, 301);
    assert!(
        tables[0]
            .seats
            .values()
            .all(|sums| sums.reward_sum.fract() != 0.0)
    );
    assert_identical(&tables[0], &tables[1]);
    assert_identical(&tables[0], &tables[2]);
    let other_seed = Batch::new(standard(), &agents, 301, 8)
        .unwrap()
        .run(&|_| {});
    assert_ne!(tables[0].decisions, other_seed.decisions);
}

#[test]
fn a_fold_keeps_the_order_of_the_games() {
    // More games than one wave, and not a multiple of the chunk.
    let games = 70_001;
    let batch = Batch::new(standard(), &[Random; 4], games, 0).unwrap();
    for threads in [1, 3] {
        let order = on_threads(threads, || {
            batch.fold(
                Vec::new,
                |part, index| part.push(index),
                |all, part| all.extend(part),
            )
        });
        assert!(order.into_iter().eq(0..games), "{threads} threads");
    }
}

#[test]
fn progress_counts_every_game() {
    let finished = AtomicU64::new(0);
    let batch = Batch::new(standard(), &[Greedy; 4], 100, 3).unwrap();
    batch.run(&|games| {
        finished.fetch_add(games, Ordering::Relaxed);
    });
    assert_eq!(finished.into_inner(), 100);
}

#[test]
fn totals_are_complete() {
    for players in 2u8..=6 {
        for (preset, scheme) in [
            ("paper", RewardScheme::Validity),
            ("original2020", RewardScheme::Points),
        ] {
            let spec = RuleSetSpec {
                players,
                stop: Stop::Shifts(3),
                ..RuleSetSpec::preset(preset).unwrap()
            };
            let rules = spec.validate().unwrap();
            let mut agents = vec![Random; rules.players()];
            (agents[0], agents[1]) = (Greedy, RandomUnmasked);
            let table = Batch::new(rules, &agents, 40, 11)
                .unwrap()
                .with_rewards(scheme)
                .run(&|_| {});
            let sum = |of: fn(&chefshat_simulation::SeatTable) -> u64| {
                table.seats.values().map(of).sum::<u64>()
            };
            let n = u64::from(players);

            assert_eq!((table.games, table.shifts), (40, 120));
            assert_eq!(sum(|seat| seat.games_won), table.games);
            assert_eq!(sum(|seat| seat.shifts_won), table.shifts);
            assert_eq!(sum(|seat| seat.place_sum), table.shifts * n * (n + 1) / 2);
            let points: u64 = rules
                .points_slice()
                .iter()
                .map(|&points| u64::from(points))
                .sum();
            assert_eq!(sum(|seat| seat.points), table.shifts * points);
            assert_eq!(sum(|seat| seat.valid), table.turns);
            assert_eq!(sum(|seat| seat.plays + seat.passes), table.turns);
            assert!(
                table.decisions > table.turns,
                "the exchange brings decisions"
            );
            assert!(
                table.starter_won <= table.shifts
                    && table.pizzas >= table.shifts
                    && table.laps >= table.shifts
            );
            for (seat, sums) in table.seats.iter() {
                assert_eq!(
                    sums.wrong > 0,
                    agents[seat.index()] == RandomUnmasked,
                    "seat {seat}"
                );
                assert_eq!(sums.reward_count, sums.valid + sums.wrong);
                let expected = match scheme {
                    RewardScheme::Validity => sums.valid as f64 - sums.wrong as f64,
                    _ => sums.points as f64,
                };
                assert_eq!(sums.reward_sum, expected, "seat {seat}, {scheme:?}");
            }
        }
    }
}

/// Records what happens in a game.
#[derive(Default, PartialEq, Debug)]
struct Diary {
    decisions: Vec<(Decision, ActionId)>,
    invalid: u64,
    shifts: u64,
    turns: u64,
    wins: [u64; 4],
}

impl Listener for Diary {
    fn on_event(&mut self, event: &Event) {
        if let Event::ShiftEnded(end) = event {
            self.shifts += 1;
            self.turns += u64::from(end.turns);
            self.wins[end.order.as_slice()[0].index()] += 1;
        }
    }

    fn on_decision(&mut self, decision: Decision, action: ActionId) {
        self.decisions.push((decision, action));
    }

    fn on_invalid(&mut self, _: Decision, _: ActionId) {
        self.invalid += 1;
    }
}

#[test]
fn a_game_played_alone_is_the_game_of_the_batch() {
    let batch = Batch::new(standard(), &[RandomUnmasked, Greedy, Random, Random], 25, 2).unwrap();
    let table = batch.run(&|_| {});
    let mut diaries = Vec::new();
    for index in 0..25 {
        let (mut once, mut again) = (Diary::default(), Diary::default());
        assert_eq!(
            batch.play_game(index, &mut once),
            batch.play_game(index, &mut again)
        );
        assert_eq!(once, again);
        diaries.push(once);
    }
    assert_eq!(
        diaries
            .iter()
            .map(|diary| diary.decisions.len() as u64)
            .sum::<u64>(),
        table.decisions
    );
    assert_eq!(
        diaries.iter().map(|diary| diary.invalid).sum::<u64>(),
        table.seats[Seat::new(0)].wrong
    );
    assert_eq!(
        diaries.iter().map(|diary| diary.shifts).sum::<u64>(),
        table.shifts
    );
    assert_eq!(
        diaries.iter().map(|diary| diary.turns).sum::<u64>(),
        table.turns
    );
    for (seat, sums) in table.seats.iter() {
        assert_eq!(
            diaries
                .iter()
                .map(|diary| diary.wins[seat.index()])
                .sum::<u64>(),
            sums.shifts_won
        );
    }
    assert_ne!(diaries[0].decisions, diaries[1].decisions);
}

#[test]
fn a_limit_of_invalid_attempts_bounds_the_wrong_actions() {
    let limit = NonZeroU32::new(3).unwrap();
    let batch = Batch::new(standard(), &[RandomUnmasked; 4], 20, 4).unwrap();
    let table = batch.with_max_invalid_attempts(limit).run(&|_| {});
    let wrong: u64 = table.seats.values().map(|seat| seat.wrong).sum();
    assert!(
        wrong > 2 * table.turns && wrong <= 3 * table.turns,
        "{wrong} wrong in {} turns",
        table.turns
    );
    let unlimited: u64 = batch
        .run(&|_| {})
        .seats
        .values()
        .map(|seat| seat.wrong)
        .sum();
    assert!(
        unlimited > 10 * wrong,
        "{unlimited} without a limit, {wrong} with one"
    );
}

#[test]
fn seeds_are_distinct_and_stable() {
    // From another implementation of ChaCha20.
    assert_eq!(
        hex::encode(game_seed(7, 0).0),
        "c89111a5c2dc3d7997e9f34b9887a06c070bf5cbaf4e13f4811668bcb6f81f28"
    );
    assert_eq!(
        hex::encode(agent_seed(Seed([1; 32]), Seat::new(2))),
        "3775f6f89e4b59b64b981cfaac66f1492c6667893339ad307f935e52fc1ef5be"
    );
    let mut seeds: Vec<[u8; 32]> = Vec::new();
    for batch in [0, 1, 7] {
        for index in [0, 1, 2, 1 << 32] {
            let seed = game_seed(batch, index);
            seeds.push(seed.0);
            seeds.extend((0..4).map(|seat| agent_seed(seed, Seat::new(seat))));
        }
    }
    let count = seeds.len();
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), count);
}

#[test]
fn results_of_seed_7_are_stable() {
    let batch = Batch::new(
        standard(),
        &[Greedy, Random, RandomUnmasked, Random],
        100,
        7,
    )
    .unwrap();
    let table = batch.run(&|_| {});
    let wrong = table.seats[Seat::new(2)].wrong;
    assert_eq!(
        (
            table.shifts,
            table.decisions,
            table.turns,
            table.pizzas,
            wrong
        ),
        (308, 26_443, 25_825, 6_211, 827_850)
    );
}

#[test]
fn invalid_batches_are_refused() {
    let refused =
        |agents: &[AgentKind], games| Batch::new(standard(), agents, games, 0).unwrap_err();
    assert_eq!(
        refused(&[Random; 3], 1),
        BatchError::Agents {
            given: 3,
            players: 4
        }
    );
    assert_eq!(
        refused(&[Random; 9], 1),
        BatchError::Agents {
            given: 9,
            players: 4
        }
    );
    assert_eq!(refused(&[Random; 4], 0), BatchError::NoGames);
}

#[test]
fn greedy_beats_random_and_random_is_fair() {
    let rules = standard();
    let random = [Random; 4];
    let fair = Batch::new(rules, &random, 1_000, 1).unwrap().run(&|_| {});
    for seat in fair.seats.seats() {
        let (won, place) = (fair.seats[seat].games_won, fair.mean_place(seat));
        assert!(
            (180..320).contains(&won),
            "seat {seat} won {won} of 1000 games"
        );
        assert!(
            (2.4..2.6).contains(&place),
            "seat {seat}: mean place {place}"
        );
    }
    for favourite in fair.seats.seats() {
        let mut agents = random;
        agents[favourite.index()] = Greedy;
        let table = Batch::new(rules, &agents, 200, 1).unwrap().run(&|_| {});
        let won = table.seats[favourite].games_won;
        assert!(
            won > 180,
            "greedy on seat {favourite} won {won} of 200 games"
        );
    }
}
