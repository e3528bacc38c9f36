//! The built-in agents: greedy's choices in a table of positions, uniformity of the random ones,
//! and dependence on observation and generator alone.

use chefshat_agents::{AgentKind, BuiltInAgent, MonteCarlo, NamedAgent};
use chefshat_engine::{
    ActionId, ActionSpace, BySeat, Decision, DecisionKind, Game, Mask, Observation, Role,
    RuleSetSpec, Seat, Seed, Viewer,
};

const FACES: u8 = 11;

fn space() -> ActionSpace {
    ActionSpace::new(FACES).unwrap()
}

fn actions(texts: &str) -> Mask {
    texts
        .split(", ")
        .map(|text| space().parse(text).unwrap_or_else(|| panic!("{text}")))
        .collect()
}

/// The parts of seat 0's observation that agents use.
fn observation(kind: DecisionKind, role: Option<Role>) -> Observation {
    let rules = RuleSetSpec::default().validate().unwrap();
    let mut observation =
        Game::new(rules, Seed([1; 32]), |_| {}).observe(Viewer::Seat(Seat::new(0)));
    observation.kind = Some(kind);
    observation.roles = BySeat::from_fn(4, |seat| role.filter(|_| seat == Seat::new(0)));
    observation
}

#[test]
fn greedy_follows_its_documented_order() {
    use DecisionKind::{Exchange, SpecialAction, Turn};
    let table = [
        // The highest face, with as many cards of it as possible.
        (Turn, None, "C9;Q1;J0, C9;Q2;J0, C8;Q4;J0, pass", "C9;Q2;J0"),
        (Turn, None, "C1;Q1;J0, C2;Q1;J0, pass", "C2;Q1;J0"),
        // Without jokers while anything else can be played …
        (
            Turn,
            None,
            "C11;Q3;J0, C11;Q3;J1, C11;Q3;J2, C0;Q0;J1, pass",
            "C11;Q3;J0",
        ),
        (Turn, None, "C3;Q1;J0, C9;Q2;J1, pass", "C3;Q1;J0"),
        // … otherwise with as few as possible, and a lone joker last.
        (Turn, None, "C4;Q2;J1, C9;Q1;J2, C5;Q2;J1, pass", "C5;Q2;J1"),
        (Turn, None, "C2;Q1;J1, C0;Q0;J1, pass", "C2;Q1;J1"),
        (Turn, None, "C0;Q0;J1, pass", "C0;Q0;J1"),
        (Turn, None, "pass", "pass"),
        // Gives the highest face, a joker only without other cards.
        (
            Exchange,
            Some(Role::Chef),
            "give C2, give C10, give C11, give J",
            "give C11",
        ),
        (Exchange, Some(Role::SousChef), "give C1, give J", "give C1"),
        (Exchange, Some(Role::Chef), "give J", "give J"),
        // Declares only where the exchange would cost cards.
        (
            SpecialAction,
            Some(Role::Dishwasher),
            "decline, declare",
            "declare",
        ),
        (
            SpecialAction,
            Some(Role::Waiter),
            "decline, declare",
            "declare",
        ),
        (
            SpecialAction,
            Some(Role::Cook),
            "decline, declare",
            "decline",
        ),
        (
            SpecialAction,
            Some(Role::SousChef),
            "decline, declare",
            "decline",
        ),
        (
            SpecialAction,
            Some(Role::Chef),
            "decline, declare",
            "decline",
        ),
    ];
    for (kind, role, legal, expected) in table {
        let mut agent = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
        let chosen = agent.decide(&observation(kind, role), &actions(legal));
        assert_eq!(
            space().text(chosen).as_deref(),
            Some(expected),
            "{role:?}: {legal}"
        );
    }
}

/// How often an agent with a fixed seed takes each action.
fn counts(kind: AgentKind, decision: DecisionKind, legal: &Mask, draws: usize) -> Vec<usize> {
    let mut agent = BuiltInAgent::new(kind, [3; 32]);
    let observation = observation(decision, None);
    let mut counts = vec![0; usize::from(space().size())];
    for _ in 0..draws {
        counts[usize::from(agent.decide(&observation, legal).index())] += 1;
    }
    counts
}

#[test]
fn random_is_even_over_the_legal_actions() {
    let legal =
        actions("C1;Q1;J0, C2;Q1;J0, C3;Q1;J0, C9;Q4;J1, C11;Q11;J2, C0;Q0;J1, pass, give C1");
    for kind in [AgentKind::Random, AgentKind::RandomUnmasked] {
        // At an exchange both choose among the legal actions.
        let counts = counts(kind, DecisionKind::Exchange, &legal, 8_000);
        for action in space().iter() {
            let count = counts[usize::from(action.index())];
            let expected = if legal.contains(action) {
                850..1150
            } else {
                0..1
            };
            assert!(
                expected.contains(&count),
                "{kind:?} took {action} {count} times"
            );
        }
    }
}

#[test]
fn random_unmasked_is_even_over_all_actions_of_a_turn() {
    let legal = actions("C1;Q1;J0, pass");
    let counts = counts(
        AgentKind::RandomUnmasked,
        DecisionKind::Turn,
        &legal,
        200_000,
    );
    let turn_actions = usize::from(space().turn_actions());
    assert!(
        counts[..turn_actions]
            .iter()
            .all(|count| (800..1200).contains(count)),
        "{counts:?}"
    );
    assert!(
        counts[turn_actions..].iter().all(|&count| count == 0),
        "{counts:?}"
    );
    let masked = self::counts(AgentKind::Random, DecisionKind::Turn, &legal, 1_000);
    assert_eq!(masked.iter().filter(|&&count| count > 0).count(), 2);
}

#[test]
fn an_agent_is_a_function_of_observation_and_generator() {
    let rules = RuleSetSpec::default().validate().unwrap();
    for kind in AgentKind::ALL {
        let mut game = Game::new(rules, Seed([5; 32]), |_| {});
        let mut agent = BuiltInAgent::new(kind, [6; 32]);
        let mut decisions = 0;
        while let Some(Decision { seat, .. }) = game.decision() {
            let (observation, legal) = (game.observe(Viewer::Seat(seat)), game.legal_actions());
            let mut twin = agent.clone();
            let action = agent.decide(&observation, &legal);
            assert_eq!(twin.decide(&observation, &legal), action, "{kind:?}");
            if legal.contains(action) {
                game.apply(action, |_| {}).unwrap();
                decisions += 1;
            }
        }
        assert!(decisions > 100, "{kind:?} took {decisions} decisions");
    }
}

#[test]
fn names_round_trip() {
    for kind in AgentKind::ALL {
        assert_eq!(AgentKind::from_name(kind.name()), Some(kind));
    }
    assert_eq!(AgentKind::from_name("Greedy"), None);
}

#[test]
fn agents_that_search_are_named_with_their_budget() {
    let check = |text: &str, expected: Option<&str>| {
        let named = text.parse::<NamedAgent>().map(NamedAgent::name);
        assert_eq!(named.ok().as_deref(), expected, "{text}");
    };
    for name in NamedAgent::NAMES {
        let expected = match name {
            MonteCarlo::NAME => "monte_carlo:50ms",
            kind => kind,
        };
        check(name, Some(expected));
    }
    check("monte_carlo:20ms", Some("monte_carlo:20ms"));
    check("monte_carlo:300:trained", Some("monte_carlo:300"));
    check("monte_carlo:300:random", Some("monte_carlo:300:random"));
    check("monte_carlo:belief", Some("monte_carlo:50ms:belief"));
    check("monte_carlo:300:belief", Some("monte_carlo:300:belief"));
    check(
        "monte_carlo:300:trained:belief",
        Some("monte_carlo:300:belief"),
    );
    check(
        "monte_carlo:9:greedy:belief",
        Some("monte_carlo:9:greedy:belief"),
    );
    for wrong in [
        "",
        "greedy:50ms",
        "monte_carlo:",
        "monte_carlo:0",
        "monte_carlo:0ms",
        "monte_carlo:61000ms",
        "monte_carlo:5:random_unmasked",
        "monte_carlo:5:greedy:",
        "monte_carlo:5:belief:greedy",
        "monte_carlo::belief",
        "monte_carlobelief",
        "belief",
    ] {
        check(wrong, None);
    }
}

#[test]
#[should_panic(expected = "a decision has a legal action")]
fn deciding_without_a_legal_action_panics() {
    let observation = observation(DecisionKind::Turn, None);
    let _: ActionId =
        BuiltInAgent::new(AgentKind::Random, [0; 32]).decide(&observation, &Mask::EMPTY);
}
