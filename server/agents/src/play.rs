//! One offline game from its deal to its end: who is asked, what counts as an answer, and who hears of it. Which games are played,
//! and what is made of them, is decided in `batch` and `table`.

use std::num::NonZeroU32;

use chefshat_engine::{
    ActionId, Decision, DecisionKind, Event, Game, Mask, Observation, RuleSet, Seat, Seed,
    Standings, Viewer,
};

/// Somebody who hears everything that happens in a game, private things included. Each method does nothing unless it is written.
pub trait Listener {
    /// Something happened.
    fn on_event(&mut self, event: &Event) {
        let _ = event;
    }

    /// A decision is about to be taken with this legal action, whose events follow.
    fn on_decision(&mut self, decision: Decision, action: ActionId) {
        let _ = (decision, action);
    }

    /// A seat answered a decision with an action that is not legal.
    fn on_invalid(&mut self, decision: Decision, action: ActionId) {
        let _ = (decision, action);
    }
}

/// Plays a game to its end. `decide` answers for every seat; an illegal answer is reported and the decision asked again, without limit
/// unless `max_invalid_attempts` says after how many of them the default decision is taken.
///
/// Never returns if there is no limit and `decide` never gives a legal action.
pub fn play(
    rules: RuleSet,
    seed: Seed,
    max_invalid_attempts: Option<NonZeroU32>,
    mut decide: impl FnMut(Seat, &Observation, &Mask) -> ActionId,
    listener: &mut impl Listener,
) -> Standings {
    let mut game = Game::new(rules, seed, |event| listener.on_event(&event));
    while let Some(decision) = game.decision() {
        let legal = game.legal_actions();
        let observation = game.observe(Viewer::Seat(decision.seat));
        let mut left = max_invalid_attempts.map(NonZeroU32::get);
        let action = loop {
            let action = decide(decision.seat, &observation, &legal);
            if legal.contains(action) {
                break action;
            }
            listener.on_invalid(decision, action);
            if let Some(left) = &mut left {
                *left -= 1;
                if *left == 0 {
                    break game
                        .default_action()
                        .expect("an open decision has a default");
                }
            }
        };
        listener.on_decision(decision, action);
        game.apply(action, |event| listener.on_event(&event))
            .expect("an action of the mask is legal");
    }
    game.standings().expect("the game has ended")
}

/// Whether an invalid attempt at this decision is a wrong action: only those at turns are counted and rewarded.
pub fn is_wrong_action(decision: Decision) -> bool {
    decision.kind == DecisionKind::Turn
}
