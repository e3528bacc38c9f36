//! The sampler draws exactly the deals that enumeration finds, each as often as it should.

use std::collections::HashMap;

use chefshat_engine::{Cards, DecisionKind, Observation, Opening, PassScope, RuleSet, RuleSetSpec};
use chefshat_search::{Chance, Knowledge, KnowledgeError, Sampler};

use crate::enumeration::{Outcome, enumerate};
use crate::scenario::Scenario;

const MAX_STEPS: u64 = 10_000_000;
/// Samples of each decision tested.
const SAMPLES: usize = 20_000;
/// The chi-square statistic, turned into a normal deviate, stays below this. A right sampler
/// exceeds it once in 30,000 tests; the seeds are fixed.
const DEVIATE: f64 = 4.0;

fn rules(change: impl FnOnce(&mut RuleSetSpec)) -> RuleSet {
    let mut spec = RuleSetSpec::default();
    change(&mut spec);
    spec.validate().expect("a rule set")
}

/// Compares the sampler with enumeration at every decision of random Shifts: the number of deals
/// always, their frequencies where `frequencies` says. Returns the number of decisions of each kind.
fn check(
    rules: RuleSet,
    places: Option<&[usize]>,
    shifts: impl IntoIterator<Item = u64>,
) -> [usize; 3] {
    let mut tested = [0; 3];
    for number in shifts {
        let scenario = Scenario::random(rules, number, places);
        for moment in 0..scenario.moments.len() {
            let expected = enumerate(&scenario, moment);
            let all: f64 = expected.values().sum();
            let sampler = Sampler::new(scenario.knowledge(moment), MAX_STEPS).expect("a deal");
            let ways = sampler.ways() * pending_gifts(&scenario, moment);
            let what = format!("Shift {number}, decision {moment}");
            assert!(
                (ways / all - 1.0).abs() < 1e-9,
                "{what}: {ways} ways, {all} by enumeration"
            );
            // Frequencies of some of them: the first, and every fifth.
            if moment % 5 == 0 {
                check_frequencies(&sampler, &expected, all, &what);
            }
            tested[scenario.moments[moment].kind as usize] += 1;
        }
    }
    tested
}

/// The gifts of an open exchange are drawn after the deal, so they are not among the sampler's ways.
fn pending_gifts(scenario: &Scenario, moment: usize) -> f64 {
    let decision = &scenario.moments[moment];
    let size = scenario.rules.hand_size();
    let others: Vec<u8> = decision
        .observation
        .cards_left
        .iter()
        .filter(|(seat, _)| decision.kind == DecisionKind::Exchange && *seat != decision.seat)
        .map(|(_, left)| size - left)
        .collect();
    match others.iter().max() {
        Some(1) => f64::from(size),
        Some(2) => f64::from(size) * f64::from(size - 1) / 2.0,
        _ => 1.0,
    }
}

fn check_frequencies(sampler: &Sampler, expected: &HashMap<Outcome, f64>, all: f64, what: &str) {
    let mut chance = Chance::new([17; 32]);
    let mut drawn: HashMap<Outcome, usize> = HashMap::new();
    for _ in 0..SAMPLES {
        let game = sampler.game(&mut chance);
        *drawn.entry((*game.hands(), *game.gave())).or_default() += 1;
    }
    assert!(
        drawn.keys().all(|outcome| expected.contains_key(outcome)),
        "{what}: drew a deal that is impossible"
    );
    // Rare outcomes are counted together.
    let (mut statistic, mut cells) = (0.0, 0usize);
    let (mut rare_expected, mut rare_drawn) = (0.0, 0usize);
    for (outcome, ways) in expected {
        let mean = ways / all * SAMPLES as f64;
        let count = drawn.get(outcome).copied().unwrap_or(0);
        if mean < 5.0 {
            rare_expected += mean;
            rare_drawn += count;
        } else {
            statistic += (count as f64 - mean).powi(2) / mean;
            cells += 1;
        }
    }
    if rare_expected >= 5.0 {
        statistic += (rare_drawn as f64 - rare_expected).powi(2) / rare_expected;
        cells += 1;
    }
    if cells < 2 {
        return;
    }
    // Wilson and Hilferty: the cube root of chi-square / df is nearly normal.
    let df = (cells - 1) as f64;
    let spread = 2.0 / (9.0 * df);
    let deviate = ((statistic / df).cbrt() - (1.0 - spread)) / spread.sqrt();
    assert!(
        deviate < DEVIATE,
        "{what}: chi-square {statistic:.1} with {df} degrees of freedom"
    );
}

#[test]
fn the_owner_of_the_board_may_be_missing_but_not_wrong() {
    let scenario = Scenario::random(rules(|_| {}), 3, None);
    let owned: Vec<_> = (scenario.moments.iter())
        .filter(|moment| moment.observation.board_owner.is_some())
        .collect();
    assert!(owned.len() > 5);
    for moment in owned.into_iter().take(5) {
        let ways = |board_owner| {
            let observation = Observation {
                board_owner,
                ..moment.observation
            };
            let knowledge = Knowledge::new(scenario.rules, &observation, &moment.history)?;
            Sampler::new(knowledge, MAX_STEPS).map(|sampler| sampler.ways())
        };
        let with_owner = ways(moment.observation.board_owner);
        assert!(with_owner.is_ok());
        assert_eq!(ways(None), with_owner);
        // The seat that has the turn never played the board.
        assert_eq!(ways(Some(moment.seat)), Err(KnowledgeError::Inconsistent));
    }
}

#[test]
fn the_limit_of_steps_is_for_all_counts() {
    // Each of five seats may have been drawn for the opening.
    let rules = rules(|spec| {
        (spec.players, spec.faces) = (5, 6);
        spec.opening = Opening::AnyTopFace;
    });
    let scenario = Scenario::random(rules, 1, None);
    for moment in [0, scenario.moments.len() / 2] {
        let sampler = |steps| Sampler::new(scenario.knowledge(moment), steps);
        // The fewest steps that suffice.
        let (mut low, mut high) = (0, MAX_STEPS);
        while low < high {
            let middle = low.midpoint(high);
            match sampler(middle) {
                Ok(_) => high = middle,
                Err(_) => low = middle + 1,
            }
        }
        let states = sampler(high).expect("a deal").states() as u64;
        assert!((1..high).contains(&states), "{states} states, {high} steps");
        assert_eq!(
            sampler(high - 1).err(),
            Some(KnowledgeError::TooManySteps(high - 1))
        );
    }
}

#[test]
fn first_shift() {
    let rules = rules(|spec| spec.faces = 4);
    check(rules, None, 1..4);
}

#[test]
fn after_an_exchange_that_was_partly_seen() {
    let rules = rules(|spec| spec.faces = 4);
    // In 12 Dinner is Served is declined and in 16 declared; in 40 a Dishwasher with two jokers
    // has one card to give; in 47 it declares the Food Fight.
    let tested = check(rules, Some(&[2, 0, 3, 1]), [1, 2, 12, 16, 40, 47]);
    assert!(tested.iter().all(|&tested| tested > 0), "{tested:?}");
}

#[test]
fn cards_set_aside_and_a_cook_outside_the_exchange() {
    let rules = rules(|spec| (spec.players, spec.faces) = (3, 4));
    check(rules, Some(&[1, 2, 0]), 1..4);
}

#[test]
fn two_exchanges_between_others() {
    let rules = rules(|spec| (spec.players, spec.faces, spec.jokers) = (5, 5, 0));
    check(rules, Some(&[4, 2, 0, 1, 3]), 1..2);
}

#[test]
fn two_players() {
    let rules = rules(|spec| (spec.players, spec.faces) = (2, 5));
    check(rules, Some(&[1, 0]), 1..4);
}

#[test]
fn any_top_face_opens() {
    let rules = rules(|spec| {
        (spec.players, spec.faces) = (3, 4);
        spec.opening = Opening::AnyTopFace;
        spec.opening_pass = true;
        spec.pass_scope = PassScope::Turn;
    });
    check(rules, None, 1..3);
    check(rules, Some(&[1, 2, 0]), 1..3);
}

#[test]
fn the_opening_may_be_a_pass() {
    let rules = rules(|spec| {
        (spec.players, spec.faces) = (3, 4);
        spec.opening_pass = true;
    });
    check(rules, Some(&[0, 2, 1]), 4..7);
}

#[test]
fn without_exchange() {
    let rules = rules(|spec| {
        (spec.players, spec.faces) = (3, 4);
        spec.exchange = false;
    });
    check(rules, Some(&[0, 1, 2]), 1..4);
}

/// Two games that differ only in cards hidden from a seat give it the same samples.
#[test]
fn an_observation_need_not_tell_the_golden_card_from_other_gifts() {
    // Messages of decisions do not; the events of the exchange do.
    let rules = rules(|spec| spec.faces = 6);
    let mut tested = 0;
    for number in 0..40 {
        let scenario = Scenario::random(rules, number, Some(&[2, 0, 3, 1]));
        for (index, moment) in scenario.moments.iter().enumerate() {
            let mut seen = moment.observation;
            for gift in [&mut seen.gave, &mut seen.received] {
                let counts: Vec<u8> = gift.counts(rules.faces()).collect();
                *gift = Cards::from_counts(rules.faces(), &counts, false).expect("cards");
            }
            if seen == moment.observation {
                continue;
            }
            let described = Knowledge::new(rules, &seen, &moment.history).expect("a decision");
            let described = Sampler::new(described, MAX_STEPS).expect("a deal");
            let known = Sampler::new(scenario.knowledge(index), MAX_STEPS).expect("a deal");
            assert_eq!(described.ways(), known.ways());
            let world = |sampler: &Sampler| sampler.world(&mut Chance::new([1; 32]));
            assert_eq!(world(&described), world(&known));
            tested += 1;
        }
    }
    assert!(tested > 20, "{tested}");
}

#[test]
fn samples_depend_on_what_the_seat_knows_alone() {
    let rules = rules(|spec| spec.faces = 5);
    let mut compared = 0;
    for number in 1..6 {
        let scenario = Scenario::random(rules, number, Some(&[2, 0, 3, 1]));
        for moment in 0..scenario.moments.len() {
            let sampler = Sampler::new(scenario.knowledge(moment), MAX_STEPS).expect("a deal");
            let mut chance = Chance::new([3; 32]);
            let (seat, kind) = (scenario.moments[moment].seat, scenario.moments[moment].kind);
            if kind != DecisionKind::Turn {
                continue;
            }
            // Another game that the seat cannot tell from this one.
            let hands = sampler.world(&mut chance).dealt;
            let Some(other) = scenario.with_deal(hands, moment) else {
                continue;
            };
            if hands == scenario.script.hands {
                continue;
            }
            let last = other.moments.len() - 1;
            let again = Sampler::new(other.knowledge(last), MAX_STEPS).expect("a deal");
            assert_eq!(sampler.ways(), again.ways());
            let (mut one, mut two) = (Chance::new([9; 32]), Chance::new([9; 32]));
            for _ in 0..50 {
                assert_eq!(sampler.world(&mut one), again.world(&mut two), "{seat}");
            }
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared}");
}
