//! Estimates of actions, and the agent that plays by them.

use chefshat_agents::{AgentKind, AgentMaker as _, Budget, BuiltInAgent, MonteCarlo};
use chefshat_engine::{ActionId, BySeat, Cards, RuleSet, RuleSetSpec, Script, Seat};
use chefshat_search::{
    Allocation, Chance, Estimate, Evaluation, Method, RolloutPolicy, Sampler, Searchers, evaluate,
    likely_hands, outcomes, play_on, rollouts,
};

use crate::scenario::{Moment, Scenario, busiest};

const MAX_STEPS: u64 = 10_000_000;
const METHOD: Method = Method {
    policy: RolloutPolicy::Kind(AgentKind::Greedy),
    allocation: Allocation::Uniform,
    belief: None,
};

fn rules(faces: u8, players: u8) -> RuleSet {
    let spec = RuleSetSpec {
        faces,
        players,
        ..RuleSetSpec::default()
    };
    spec.validate().expect("a rule set")
}

fn sampler(scenario: &Scenario, moment: usize) -> Sampler {
    Sampler::new(scenario.knowledge(moment), MAX_STEPS).expect("a deal")
}

/// Spends this many rollouts.
fn spend(all: u64) -> impl Fn(u64) -> f64 {
    move |rollouts| rollouts as f64 / all as f64
}

/// A Shift of two players: the first plays its Golden card, the other passes, and the first holds
/// two cards more.
fn nearly_won() -> Scenario {
    let rules = rules(4, 2);
    let hand = |counts: &[u8], golden| Cards::from_counts(4, counts, golden).expect("a hand");
    let hands = [hand(&[0, 0, 1, 4, 1], true), hand(&[1, 2, 2, 0, 1], false)];
    let script = Script::first_shift(BySeat::from_slice(&hands).expect("two hands"));
    let space = rules.actions();
    let mut actions = ["C4;Q4;J0", "pass"]
        .map(|text| space.parse(text).expect("an action"))
        .into_iter();
    let last = space.parse("C3;Q1;J1").expect("an action");
    Scenario::played(rules, script, |_, _| Some(actions.next().unwrap_or(last)))
}

#[test]
fn a_winning_play_is_worth_the_first_place() {
    let scenario = nearly_won();
    let moment = 2;
    let wins = scenario.moments[moment].action;
    let pass = scenario.rules.actions().pass();
    let sampler = sampler(&scenario, moment);
    let found = evaluate(&sampler, &[wins, pass], &METHOD, [1; 32], None, spend(400));
    assert_eq!((found[0].points(), found[0].standard_error()), (5.0, 0.0));
    assert_eq!(found[0].place(), 1.0);
    assert!(
        found[1].points() < 5.0 && found[1].gain() < 0.0,
        "{found:?}"
    );
    assert_eq!(found[0].rollouts, found[1].rollouts);
    assert!((400..=440).contains(&(found[0].rollouts * 2)));
}

#[test]
fn a_limit_of_rollouts_is_kept() {
    let scenario = Scenario::random(rules(6, 4), 3, Some(&[2, 0, 3, 1]));
    let moment = busiest(&scenario);
    let sampler = sampler(&scenario, moment);
    let legal: Vec<ActionId> = scenario.legal(moment).iter().collect();
    let actions = legal.len() as u64;
    for allocation in [Allocation::Uniform, Allocation::Halving] {
        let method = Method {
            allocation,
            ..METHOD
        };
        for most in [1, 4 * actions, 5 * actions - 1, 400, 2000] {
            let mut evaluation = Evaluation::new(&legal, allocation).at_most(most);
            while !evaluation.step(&sampler, &method, [5; 32], None, spend(most)) {}
            let count = |found: &Estimate| found.rollouts;
            let all: u64 = evaluation.estimates().iter().map(count).sum();
            let expected = most.max(4 * actions);
            assert!(all <= expected && all + actions > expected, "{all} {most}");
        }
    }
}

#[test]
fn rollouts_side_by_side_are_those_of_each_game_alone() {
    let scenario = Scenario::random(rules(11, 4), 5, Some(&[1, 3, 0, 2]));
    let moment = busiest(&scenario);
    let (sampler, legal) = (sampler(&scenario, moment), scenario.legal(moment));
    let seat = sampler.knowledge().seat();
    for kind in [AgentKind::Trained, AgentKind::Random] {
        let policy = RolloutPolicy::Kind(kind);
        let start = |deal| {
            let game = sampler.game(&mut Chance::stream([4; 32], deal));
            let action = legal.nth(deal as usize % legal.len());
            (
                game.closing_copy(),
                action.expect("an action"),
                [deal as u8; 32],
            )
        };
        let together = rollouts((0..60).map(start), seat, &policy);
        for (deal, together) in (0..60).zip(together) {
            let (mut game, action, seed) = start(deal);
            game.apply(action, |_| {}).expect("a legal action");
            let policies = vec![policy.clone(); 4];
            assert_eq!(
                play_on(game, &policies, seed)[seat],
                together,
                "{kind:?} {deal}"
            );
        }
    }
}

#[test]
fn the_largest_points_have_finite_estimates() {
    let mut scenario = nearly_won();
    let spec = RuleSetSpec {
        points: vec![u32::MAX, 0],
        ..scenario.rules.spec().clone()
    };
    scenario.rules = spec.validate().expect("a rule set");
    let wins = scenario.moments[2].action;
    let pass = scenario.rules.actions().pass();
    let sampler = sampler(&scenario, 2);
    let found = evaluate(&sampler, &[pass, wins], &METHOD, [1; 32], None, spend(400));
    let most = f64::from(u32::MAX);
    assert_eq!((found[1].points(), found[1].gain()), (most, most));
    assert!(found[1].gain_error() < 1e-6 * most, "{found:?}");
}

#[test]
fn every_action_is_tried_even_if_the_budget_is_spent() {
    let scenario = nearly_won();
    let sampler = sampler(&scenario, 2);
    let legal: Vec<ActionId> = scenario.legal(2).iter().collect();
    for allocation in [Allocation::Uniform, Allocation::Halving] {
        let method = Method {
            allocation,
            ..METHOD
        };
        let found = evaluate(&sampler, &legal, &method, [1; 32], None, |_| 1.0);
        assert!(
            found
                .iter()
                .all(|found| found.rollouts == 4 && found.place() >= 1.0),
            "{found:?}"
        );
    }
    let hands = likely_hands(&sampler, [2; 32], |_| 1.0);
    assert!(hands[1].iter().sum::<f64>() > 0.0, "{hands:?}");
}

#[test]
fn the_result_does_not_depend_on_threads() {
    let scenario = Scenario::random(rules(6, 4), 3, Some(&[2, 0, 3, 1]));
    let moment = busiest(&scenario);
    let sampler = sampler(&scenario, moment);
    let legal: Vec<ActionId> = scenario.legal(moment).iter().collect();
    let pool = |threads| {
        let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
        builder.build().expect("threads start")
    };
    let run = |threads: Option<usize>, allocation| {
        let pool = threads.map(pool);
        let method = Method {
            allocation,
            ..METHOD
        };
        evaluate(
            &sampler,
            &legal,
            &method,
            [5; 32],
            pool.as_ref(),
            spend(300),
        )
    };
    let count = |estimates: &[Estimate]| estimates.iter().map(|found| found.rollouts).sum::<u64>();
    for allocation in [Allocation::Uniform, Allocation::Halving] {
        assert_eq!(run(None, allocation), run(Some(3), allocation));
    }
    // Halving gives the first action and the best of the others most.
    let (uniform, halving) = (
        run(None, Allocation::Uniform),
        run(None, Allocation::Halving),
    );
    assert!(count(&uniform) >= 300 && count(&halving) >= 300);
    assert!(
        uniform
            .iter()
            .all(|found| found.rollouts == uniform[0].rollouts)
    );
    assert!(
        halving
            .iter()
            .all(|found| found.rollouts <= halving[0].rollouts)
    );
    assert!(halving[0].rollouts > uniform[0].rollouts);
}

#[test]
fn likely_hands_add_up_to_the_hidden_cards() {
    let scenario = Scenario::random(rules(6, 4), 2, Some(&[2, 0, 3, 1]));
    let moment = busiest(&scenario);
    let seen = scenario.moments[moment].observation;
    let hands = likely_hands(&sampler(&scenario, moment), [2; 32], spend(200));
    for (hand, (_, left)) in hands.iter().zip(seen.cards_left.iter()) {
        assert!(
            (hand.iter().sum::<f64>() - f64::from(*left)).abs() < 1e-9,
            "{hand:?}"
        );
    }
    let own: Vec<f64> = seen.hand.counts(6).map(f64::from).collect();
    assert_eq!(hands[scenario.moments[moment].seat.index()], own);
}

fn agent(rules: &RuleSet) -> BuiltInAgent {
    let plays = MonteCarlo {
        budget: Budget::Rollouts(200),
        prior: AgentKind::Random,
        ..MonteCarlo::default()
    };
    Searchers::new(plays).agent(rules, [4; 32])
}

/// What the agent does at a decision if it has followed the Shift.
fn decides(agent: &mut BuiltInAgent, scenario: &Scenario, moment: usize) -> ActionId {
    let Moment {
        seat,
        observation,
        history,
        ..
    } = &scenario.moments[moment];
    (history.events().iter()).for_each(|event| agent.on_event(*seat, event));
    agent.decide(observation, &scenario.legal(moment))
}

#[test]
fn the_agent_takes_the_win() {
    let scenario = nearly_won();
    let action = decides(&mut agent(&scenario.rules), &scenario, 2);
    assert_eq!(action, scenario.moments[2].action);
}

#[test]
fn the_agent_plays_by_what_its_seat_knows_alone() {
    let rules = rules(5, 4);
    let mut compared = 0;
    for number in 1..5 {
        let scenario = Scenario::random(rules, number, Some(&[2, 0, 3, 1]));
        for moment in (0..scenario.moments.len()).step_by(3) {
            let mut chance = chefshat_search::Chance::new([8; 32]);
            let hands = sampler(&scenario, moment).world(&mut chance).dealt;
            let Some(other) = scenario.with_deal(hands, moment) else {
                continue;
            };
            let again = other.moments.len() - 1;
            assert_eq!(
                decides(&mut agent(&rules), &scenario, moment),
                decides(&mut agent(&rules), &other, again)
            );
            compared += usize::from(hands != scenario.script.hands);
        }
    }
    assert!(compared > 10, "{compared}");
}

#[test]
fn without_the_history_the_agent_plays_as_its_prior() {
    let scenario = nearly_won();
    let plays = MonteCarlo {
        prior: AgentKind::Greedy,
        ..MonteCarlo::default()
    };
    let mut agent = Searchers::new(plays).agent(&scenario.rules, [0; 32]);
    let moment = &scenario.moments[1];
    let legal = scenario.legal(1);
    let mut greedy = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
    assert_eq!(
        agent.decide(&moment.observation, &legal),
        greedy.decide(&moment.observation, &legal)
    );
    assert_eq!(moment.seat, Seat::new(1));
}

#[test]
fn outcomes_are_those_of_an_evaluation() {
    let scenario = Scenario::random(rules(6, 4), 3, Some(&[2, 0, 3, 1]));
    let moment = busiest(&scenario);
    let sampler = sampler(&scenario, moment);
    let legal: Vec<ActionId> = scenario.legal(moment).iter().collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
    let pool = pool.expect("threads start");
    let seed = [5; 32];
    let found = |deals, pool| outcomes(&sampler, &legal, &METHOD, seed, deals, pool);
    let four = found(0..4, None);
    assert_eq!(four, found(0..4, Some(&pool)));
    assert_eq!(four[2..], found(2..4, None));
    let estimates = evaluate(&sampler, &legal, &METHOD, seed, None, spend(1));
    for (index, estimate) in estimates.iter().enumerate() {
        let points: u32 = four.iter().map(|worths| worths[index].points).sum();
        assert_eq!(estimate.points(), f64::from(points) / 4.0);
    }
}

#[test]
fn agents_play_a_game_on_from_where_it_stands() {
    let scenario = Scenario::random(rules(6, 3), 4, None);
    let sampler = sampler(&scenario, 0);
    let game = sampler.game(&mut Chance::stream([1; 32], 0)).closing_copy();
    let kinds = [AgentKind::Random, AgentKind::Greedy, AgentKind::Random];
    let policies = kinds.map(RolloutPolicy::Kind);
    let played = |seed| {
        let worths = play_on(game.clone(), &policies, [seed; 32]);
        let mut places: Vec<u8> = worths.values().map(|worth| worth.place).collect();
        places.sort_unstable();
        assert_eq!(places, [1, 2, 3]);
        for worth in worths.values() {
            assert_eq!(worth.points, scenario.rules.points(worth.place));
        }
        worths
    };
    assert_eq!(played(1), played(1));
    let first = played(0);
    assert!((1..20).any(|seed| played(seed) != first));
}
