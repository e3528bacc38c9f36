//! Comparison in the same seats: duplicate deals need fewer games, and the stated errors are right.

use std::sync::Arc;

use chefshat_agents::{AgentKind, AgentMaker, BuiltInAgent, Following};
use chefshat_engine::{ActionId, Event, Mask, Observation, RuleSet, RuleSetSpec, Seat, Stop};
use chefshat_simulation::{Candidate, Contender, Measured, SameSeat};

fn measured(random_percent: [u8; 2], seed: u64, games: &[u64]) -> Vec<Measured> {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let candidate = |percent: u8| Candidate {
        plays: Contender::Kind(AgentKind::Greedy),
        epsilon: f64::from(percent) / 100.0,
    };
    let same_seat = SameSeat {
        rules: spec.validate().unwrap(),
        candidates: random_percent.map(candidate),
        others: Contender::Kind(AgentKind::Greedy),
        seed,
    };
    same_seat.measure(games, &|_| {})
}

#[test]
fn identical_agents_do_not_differ_on_the_same_deals() {
    let [same] = measured([0, 0], 1, &[200])[..] else {
        panic!("one result was requested")
    };
    assert_eq!(
        (same.games, same.difference, same.duplicate_error),
        (200, 0.0, 0.0)
    );
    assert!(same.independent_error > 0.05, "{same:?}");
    assert_eq!(same.gain(), None);
}

#[test]
fn more_games_reduce_the_error() {
    let steps = measured([0, 20], 2, &[100, 400, 1600]);
    let games: Vec<u64> = steps.iter().map(|step| step.games).collect();
    assert_eq!(games, [100, 400, 1600]);
    for step in &steps {
        assert!(step.duplicate_error < step.independent_error, "{step:?}");
    }
    assert!(steps[2].gain().unwrap() > 1.5, "{steps:?}");
    // Four times as many games halve the error.
    for two in steps.windows(2) {
        let ratio = two[0].duplicate_error / two[1].duplicate_error;
        assert!((1.5..2.7).contains(&ratio), "{ratio}");
    }
    // Intermediate results do not affect the final one.
    let at_once = measured([0, 20], 2, &[400]);
    assert!((at_once[0].difference - steps[1].difference).abs() < 1e-12);
}

#[test]
fn the_stated_error_matches_many_repetitions() {
    let repetitions: Vec<Measured> = (0..60)
        .map(|seed| measured([0, 20], 100 + seed, &[50])[0])
        .collect();
    let count = repetitions.len() as f64;
    let mean = repetitions.iter().map(|one| one.difference).sum::<f64>() / count;
    let squares = repetitions
        .iter()
        .map(|one| (one.difference - mean).powi(2));
    let found = (squares.sum::<f64>() / (count - 1.0)).sqrt();
    let stated = repetitions
        .iter()
        .map(|one| one.duplicate_error)
        .sum::<f64>()
        / count;
    assert!((0.7..1.4).contains(&(found / stated)), "{found} {stated}");
}

/// Makes agents that need the events of the game.
#[derive(Debug)]
struct Followers;

impl AgentMaker for Followers {
    fn agent(&self, _: &RuleSet, seed: [u8; 32]) -> BuiltInAgent {
        BuiltInAgent::following(Box::new(Follower {
            agent: BuiltInAgent::new(AgentKind::Random, seed),
            pizzas: 0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Follower {
    agent: BuiltInAgent,
    pizzas: u32,
}

impl Following for Follower {
    fn name(&self) -> &'static str {
        "follower"
    }

    fn on_event(&mut self, _: Seat, event: &Event) {
        self.pizzas += u32::from(matches!(event, Event::PizzaDone { .. }));
    }

    fn decide(&mut self, observation: &Observation, legal: &Mask) -> ActionId {
        assert_eq!(self.pizzas + 1, observation.pizza, "it sees every pizza");
        self.agent.decide(observation, legal)
    }

    fn boxed_clone(&self) -> Box<dyn Following> {
        Box::new(self.clone())
    }
}

#[test]
fn agents_see_the_events_of_the_game() {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let candidate = |epsilon| Candidate {
        plays: Contender::Made(Arc::new(Followers)),
        epsilon,
    };
    let same_seat = SameSeat {
        rules: spec.validate().unwrap(),
        candidates: [candidate(0.0), candidate(0.5)],
        others: Contender::Made(Arc::new(Followers)),
        seed: 3,
    };
    let measured = same_seat.measure(&[8], &|_| {});
    assert!(measured[0].duplicate_error > 0.0, "{measured:?}");
}
