//! What the decisions of others say about their hands.

use chefshat_agents::{AgentMaker as _, Network};
use chefshat_engine::{Game, RuleSetSpec, Seed, Viewer};
use chefshat_search::{Belief, Chance, Sampler, Searchers, World};

use crate::scenario::{Scenario, busiest};

/// The sampler of a late decision of a Shift that was played at random.
fn late() -> Sampler {
    let rules = RuleSetSpec::default().validate();
    let scenario = Scenario::random(rules.expect("the default rules"), 5, Some(&[1, 3, 0, 2]));
    let knowledge = scenario.knowledge(scenario.moments.len() * 2 / 3);
    Sampler::new(knowledge, 10_000_000).expect("a deal")
}

/// The logarithm of the likelihood of what the others did if this is the deal, by the softmax of the
/// network's outputs, each probability at least 0.01.
fn log_likelihood(sampler: &Sampler, world: &World) -> f64 {
    let network = Network::trained();
    let knowledge = sampler.knowledge();
    let (script, actions) = knowledge.start(world).expect("a possible deal");
    let game = Game::scripted(*knowledge.rules(), Seed([0; 32]), &script, |_| {});
    let mut game = game.expect("a script");
    let mut sum = 0.0;
    for action in actions {
        let decider = game.decision().expect("a decision").seat;
        let legal = game.legal_actions();
        if decider != knowledge.seat() && legal.len() > 1 {
            let observation = game.observe(Viewer::Seat(decider));
            let outputs = network.outputs(&network.features(&observation, &legal));
            let exp = |index: u16| f64::from(outputs[usize::from(index)]).exp();
            let all: f64 = legal.iter().map(|legal| exp(legal.index())).sum();
            sum += (0.01 + 0.99 * exp(action.index()) / all).ln();
        }
        game.apply(action, |_| {}).expect("a legal action");
    }
    sum
}

#[test]
fn likelihoods_are_those_of_the_networks_outputs() {
    let sampler = late();
    let rules = sampler.knowledge().rules();
    let belief = Belief::of(Network::trained(), rules).expect("it fits");
    let found = belief.log_likelihoods(&sampler, [3; 32], 10..30);
    for (deal, found) in (10..30).zip(&found) {
        let world = sampler.world(&mut Chance::stream([3; 32], deal));
        let expected = log_likelihood(&sampler, &world);
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }
    assert!(found.iter().any(|log| (log - found[0]).abs() > 0.1));
}

#[test]
fn likelier_deals_are_drawn_more_often() {
    let sampler = late();
    let rules = sampler.knowledge().rules();
    let belief = Belief::of(Network::trained(), rules).expect("it fits");
    // Means over the hands that are drawn, of the likelihood of the same hands.
    let (mut drawn, mut all) = (0.0, 0.0);
    for number in 0..200 {
        let mut same = Chance::stream([8; 32], number);
        let candidates: Vec<_> = (0..8)
            .map(|_| {
                let world = sampler.world(&mut same);
                let game = sampler.knowledge().game(&world, Seed(same.seed()));
                let hands = *game.expect("a possible deal").hands();
                (hands, log_likelihood(&sampler, &world))
            })
            .collect();
        let game = belief.game(&sampler, &mut Chance::stream([8; 32], number));
        let chosen = candidates.iter().find(|(hands, _)| hands == game.hands());
        drawn += chosen.expect("it is one of the candidates").1;
        all += candidates.iter().map(|(_, log)| log / 8.0).sum::<f64>();
    }
    assert!(drawn > all + 200.0 * 0.3, "{drawn} {all}");
}

#[test]
fn a_network_for_other_games_believes_nothing() {
    let small = RuleSetSpec {
        faces: 6,
        ..RuleSetSpec::default()
    };
    let rules = small.validate().expect("a rule set");
    assert!(Belief::of(Network::trained(), &rules).is_none());
    let scenario = Scenario::random(rules, 3, Some(&[2, 0, 3, 1]));
    let moment = &scenario.moments[busiest(&scenario)];
    let decide = |name: &str| {
        let plays = name.parse().expect("an agent that searches");
        let mut agent = Searchers::new(plays).agent(&rules, [1; 32]);
        (moment.history.events().iter()).for_each(|event| agent.on_event(moment.seat, event));
        agent.decide(&moment.observation, &moment.legal)
    };
    assert_eq!(decide("monte_carlo:40"), decide("monte_carlo:40:belief"));
}
