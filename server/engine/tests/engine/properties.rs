//! Properties of every game: for any valid rule set, seed and policy.

use chefshat_engine::{ActionId, Game, Mask, RuleSet, Seed, Stop, Viewer};
use proptest::prelude::*;

use crate::model::Model;
use crate::support::{Chance, any_rules};

/// How actions are chosen; each reaches different situations.
#[derive(Copy, Clone, Debug)]
enum Policy {
    Random,
    /// Passes if that is legal.
    Default,
    /// The lowest legal index.
    Lowest,
    /// The highest legal index: passes, but declares.
    Highest,
}

fn any_policy() -> impl Strategy<Value = Policy> {
    prop_oneof![
        3 => Just(Policy::Random),
        1 => Just(Policy::Default),
        1 => Just(Policy::Lowest),
        1 => Just(Policy::Highest),
    ]
}

fn choose(policy: Policy, game: &Game, chance: &mut Chance) -> ActionId {
    let mask = game.legal_actions();
    let choice = match policy {
        Policy::Random => return chance.legal_action(game),
        Policy::Default => game.default_action(),
        Policy::Lowest => mask.nth(0),
        Policy::Highest => mask.nth(mask.len() - 1),
    };
    choice.expect("an open decision has a legal action")
}

/// The most decisions of a game: each Shift has at most its limit of turns, a special action and
/// three gifts.
fn most_decisions(rules: &RuleSet) -> u64 {
    let shifts = match rules.stop() {
        Stop::Shifts(shifts) => u64::from(shifts),
        // Every Shift gives at least one point.
        Stop::Points(points) => (u64::from(points) - 1) * rules.players() as u64 + 1,
    };
    shifts * (u64::from(rules.max_turns()) + 4)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 192,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn games_end_with_all_cards_and_by_legal_actions(
        rules in any_rules(),
        seed in any::<[u8; 32]>(),
        policy in any_policy(),
        chance in any::<u64>(),
    ) {
        let mut chance = Chance(chance);
        let mut model = Model::new(rules);
        let space = rules.actions();
        let texts: Vec<String> = space.iter().map(|action| space.text(action).unwrap()).collect();
        let mut game = Game::new(rules, Seed(seed), |event| model.follow(&event));
        let mut decisions = 0;
        while !game.is_over() {
            let mask = game.legal_actions();
            prop_assert!(!mask.is_empty());
            let allowed = |action: &ActionId| model.allows(&game, &texts[usize::from(action.index())]);
            let plain: Mask = space.iter().filter(allowed).collect();
            prop_assert_eq!(mask, plain);
            prop_assert!(mask.contains(game.default_action().unwrap()));
            let view = game.observe(Viewer::Seat(game.decision().unwrap().seat));
            prop_assert_eq!(view.default_action(&mask), game.default_action());
            game.apply(choose(policy, &game, &mut chance), |event| model.follow(&event)).unwrap();
            if !game.is_over() {
                model.check_cards(&game);
            }
            decisions += 1;
            prop_assert!(decisions <= most_decisions(&rules));
        }
        prop_assert!(game.legal_actions().is_empty());
        prop_assert_eq!(game.default_action(), None);
        prop_assert_eq!(game.decision(), None);
    }

    #[test]
    fn apply_accepts_exactly_the_actions_of_the_mask(
        rules in any_rules(), seed in any::<[u8; 32]>(), chance in any::<u64>()
    ) {
        let mut chance = Chance(chance);
        let mut game = Game::new(rules, Seed(seed), |_| {});
        let size = rules.actions().size();
        let (mut steps, mut refused) = (0, 0);
        while !game.is_over() && steps < 150 {
            let mask = game.legal_actions();
            for index in (0..size + 3).chain([u16::MAX]) {
                let action = ActionId::new(index);
                let mut tried = game.clone();
                let mut events = 0;
                let applied = tried.apply(action, |_| events += 1);
                prop_assert_eq!(game.check(action), applied);
                match applied {
                    Ok(()) => {
                        prop_assert!(mask.contains(action), "{} was accepted", index);
                        prop_assert!(tried != game);
                    }
                    Err(error) => {
                        prop_assert!(!mask.contains(action), "{}", error);
                        prop_assert!(tried == game && events == 0);
                        prop_assert!(!error.to_string().is_empty());
                        refused += 1;
                    }
                }
            }
            game.apply(chance.legal_action(&game), |_| {}).unwrap();
            steps += 1;
        }
        prop_assert!(refused > 0);
    }

    #[test]
    fn a_game_is_a_function_of_rules_seed_and_decisions(
        rules in any_rules(), seed in any::<[u8; 32]>(), chance in any::<u64>()
    ) {
        let play = || {
            let mut chance = Chance(chance);
            let mut events = Vec::new();
            let mut game = Game::new(rules, Seed(seed), |event| events.push(event));
            while !game.is_over() {
                game.apply(chance.legal_action(&game), |event| events.push(event)).unwrap();
            }
            events
        };
        prop_assert_eq!(play(), play());
    }
}
