//! Experiment 1: the rules of each condition, how its Shifts are played, and golden numbers of the
//! paper's size.

use std::sync::atomic::{AtomicU64, Ordering};

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSetSpec, Stop};
use chefshat_simulation::Batch;
use chefshat_simulation::mechanics::{Condition, MechanicsTable, SHIFTS_PER_GAME};
use rayon::ThreadPoolBuilder;

use Condition::{All, WithoutExchange, WithoutJokers, WithoutSpecialActions};

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap().install(work)
}

#[test]
fn a_condition_leaves_out_one_mechanic() {
    for preset in RuleSetSpec::PRESETS {
        let all = All.rules(preset).unwrap().spec();
        let expected = RuleSetSpec {
            stop: Stop::Shifts(250),
            ..RuleSetSpec::preset(preset)
                .unwrap()
                .validate()
                .unwrap()
                .spec()
        };
        assert_eq!(all, expected);
        for (condition, expected) in [
            (
                WithoutJokers,
                RuleSetSpec {
                    jokers: 0,
                    ..all.clone()
                },
            ),
            (
                WithoutExchange,
                RuleSetSpec {
                    exchange: false,
                    ..all.clone()
                },
            ),
            (
                WithoutSpecialActions,
                RuleSetSpec {
                    special_actions: false,
                    ..all.clone()
                },
            ),
        ] {
            assert_eq!(condition.rules(preset).unwrap().spec(), expected);
        }
    }
    assert_eq!(All.rules("chess"), None);
}

/// Of 250 Shifts with seed 0: wins of the starter, laps, turns, special actions.
const GOLDEN: [(&str, Condition, [u64; 4]); 8] = [
    ("paper", All, [71, 7_699, 24_723, 23]),
    ("paper", WithoutJokers, [75, 7_621, 24_437, 0]),
    ("paper", WithoutExchange, [73, 7_724, 24_791, 29]),
    ("paper", WithoutSpecialActions, [81, 7_730, 24_847, 0]),
    ("original2020", All, [69, 7_667, 27_868, 25]),
    ("original2020", WithoutJokers, [75, 7_500, 27_192, 0]),
    ("original2020", WithoutExchange, [79, 7_740, 28_193, 30]),
    (
        "original2020",
        WithoutSpecialActions,
        [75, 7_701, 27_951, 0],
    ),
];

#[test]
fn the_paper_s_number_of_shifts_is_one_game_with_these_figures() {
    for (preset, condition, golden) in GOLDEN {
        let rules = condition.rules(preset).unwrap();
        let table = MechanicsTable::play(rules, 250, 0, &|_| {});
        assert_eq!(table.shifts(), 250);
        let sum = |mean: f64| (250.0 * mean).round() as u64;
        let (laps, turns) = (sum(table.laps.mean()), sum(table.turns.mean()));
        let got = [table.starter_won, laps, turns, table.special_actions];
        assert_eq!(got, golden, "{preset}, {condition:?}");

        let game = Batch::new(rules, &[AgentKind::Random; 4], 1, 0)
            .unwrap()
            .run(&|_| {});
        assert_eq!((game.shifts, game.laps, game.turns), (250, laps, turns));
        assert_eq!(game.starter_won, table.starter_won);
        assert_eq!(sum(table.pizzas.mean()), game.pizzas);
    }
}

#[test]
fn further_shifts_come_from_further_games_of_which_the_last_counts_in_part() {
    let rules = All.rules("paper").unwrap();
    let games = Batch::new(rules, &[AgentKind::Random; 4], 3, 5)
        .unwrap()
        .run(&|_| {});
    let played = AtomicU64::new(0);
    let three = MechanicsTable::play(rules, 750, 5, &|shifts| {
        played.fetch_add(shifts, Ordering::Relaxed);
    });
    assert_eq!(played.into_inner(), 750);
    assert_eq!(
        (three.shifts(), three.starter_won),
        (750, games.starter_won)
    );
    let few = MechanicsTable::play(rules, 7, 5, &|_| {});
    let spec = RuleSetSpec {
        stop: Stop::Shifts(7),
        ..rules.spec()
    };
    let short = Batch::new(spec.validate().unwrap(), &[AgentKind::Random; 4], 1, 5).unwrap();
    let short = short.run(&|_| {});
    assert_eq!((few.shifts(), few.starter_won), (7, short.starter_won));
    assert_eq!((7.0 * few.turns.mean()).round() as u64, short.turns);
    for (shifts, more) in [(500, 250), (501, 249)] {
        let table = MechanicsTable::play(rules, shifts, 5, &|_| {});
        assert_eq!((table.shifts() + more), 750);
        assert!(table.starter_won < three.starter_won);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_table() {
    let rules = WithoutExchange.rules("original2020").unwrap();
    let tables = [1, 3].map(|n| on_threads(n, || MechanicsTable::play(rules, 9_000, 2, &|_| {})));
    assert_eq!(tables[0].shifts(), 9_000);
    assert_eq!(tables[0], tables[1]);
    let interval = tables[0].starter_wins_interval();
    assert!(interval.contains(tables[0].starter_wins()));
    assert!(
        (0.015..0.025).contains(&(interval.high - interval.low)),
        "{interval:?}"
    );
}

#[test]
fn the_stored_figures_are_those_of_the_paper() {
    let printed = Condition::ALL.map(|condition| {
        let paper = condition.paper();
        (paper.starter_wins, paper.laps)
    });
    assert_eq!(
        printed,
        [(0.28, 35.0), (0.35, 33.0), (0.60, 31.0), (0.28, 35.0)]
    );
    let names = Condition::ALL.map(Condition::name);
    assert_eq!(
        names,
        [
            "all",
            "without_jokers",
            "without_exchange",
            "without_special_actions"
        ]
    );
    let interval = All.paper().starter_wins_interval();
    assert!((interval.low - 0.228).abs() < 1e-3 && (interval.high - 0.339).abs() < 1e-3);
    assert_eq!(SHIFTS_PER_GAME, 250);
}
