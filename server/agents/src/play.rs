//! Plays one game offline, from its deal to its end. Batches of games and their metrics are in
//! `chefshat-simulation`.

use std::cell::RefCell;
use std::num::NonZeroU32;

use chefshat_engine::{
    ActionId, Decision, DecisionKind, Event, Game, Mask, Observation, PlayedDecision, RuleSet,
    Seat, Seed, Standings, Viewer,
};

use crate::BuiltInAgent;

/// Receives everything that happens in a game, private events included. Each method does nothing by
/// default.
pub trait Listener {
    /// Called for every event.
    fn on_event(&mut self, event: &Event) {
        let _ = event;
    }

    /// Called with the legal action of a decision, before its events.
    fn on_decision(&mut self, decision: Decision, action: ActionId) {
        let _ = (decision, action);
    }

    /// Called when a seat answers with an illegal action.
    fn on_invalid(&mut self, decision: Decision, action: ActionId) {
        let _ = (decision, action);
    }
}

/// The decisions of a game, each after its invalid attempts, as a record has them.
#[derive(Debug, Default)]
pub struct DecisionNotes {
    /// After how many invalid attempts the default action is taken; `None`: never.
    limit: Option<NonZeroU32>,
    decisions: Vec<PlayedDecision>,
    attempts: Vec<ActionId>,
}

impl DecisionNotes {
    /// Notes of a game with this limit of invalid attempts.
    pub fn new(limit: Option<NonZeroU32>) -> Self {
        Self {
            limit,
            ..Self::default()
        }
    }

    /// The decisions so far.
    pub fn decisions(&self) -> &[PlayedDecision] {
        &self.decisions
    }
}

impl Listener for DecisionNotes {
    fn on_invalid(&mut self, _: Decision, action: ActionId) {
        self.attempts.push(action);
    }

    fn on_decision(&mut self, _: Decision, action: ActionId) {
        let attempts = std::mem::take(&mut self.attempts);
        let by_default = |limit: NonZeroU32| attempts.len() >= limit.get() as usize;
        self.decisions.push(PlayedDecision {
            action,
            by_default: self.limit.is_some_and(by_default),
            attempts,
        });
    }
}

/// Plays a game to its end and returns the final standings. `decide` answers for every seat; for
/// agents, which may follow events, there is [`play_agents`]. An illegal action is reported and the decision asked again; after `max_invalid_attempts` of them,
/// if there is a limit, the default action is taken.
///
/// Never returns if there is no limit and `decide` never returns a legal action.
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
        let seat = decision.seat;
        let answer = ask(
            &game,
            seat,
            &legal,
            max_invalid_attempts,
            |observation| decide(seat, observation, &legal),
            |action| listener.on_invalid(decision, action),
        );
        listener.on_decision(decision, answer.action);
        game.apply(answer.action, |event| listener.on_event(&event))
            .expect("an action of the mask is legal");
    }
    game.standings().expect("the game has ended")
}

/// Plays a game of built-in agents, by seat, to its end: like [`play`], but the agents follow its
/// events.
///
/// # Panics
/// If there are fewer agents than seats.
pub fn play_agents(
    rules: RuleSet,
    seed: Seed,
    max_invalid_attempts: Option<NonZeroU32>,
    agents: &mut [BuiltInAgent],
    listener: &mut impl Listener,
) -> Standings {
    let agents = &mut agents[..rules.players()];
    let follow = agents.iter().any(BuiltInAgent::follows_events);
    let agents = RefCell::new(agents);
    let mut showing = Showing {
        agents: follow.then_some(&agents),
        listener,
    };
    play(
        rules,
        seed,
        max_invalid_attempts,
        |seat, observation, legal| agents.borrow_mut()[seat.index()].decide(observation, legal),
        &mut showing,
    )
}

/// Shows events to agents before a listener.
struct Showing<'a, 'b, L> {
    agents: Option<&'a RefCell<&'b mut [BuiltInAgent]>>,
    listener: &'a mut L,
}

impl<L: Listener> Listener for Showing<'_, '_, L> {
    fn on_event(&mut self, event: &Event) {
        if let Some(agents) = self.agents {
            for (seat, agent) in agents.borrow_mut().iter_mut().enumerate() {
                agent.on_event(Seat::new(seat), event);
            }
        }
        self.listener.on_event(event);
    }

    fn on_decision(&mut self, decision: Decision, action: ActionId) {
        self.listener.on_decision(decision, action);
    }

    fn on_invalid(&mut self, decision: Decision, action: ActionId) {
        self.listener.on_invalid(decision, action);
    }
}

/// The action taken at a decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// A legal action.
    pub action: ActionId,
    /// Whether it is the default action, taken after too many invalid attempts.
    pub by_default: bool,
}

/// Asks for the open decision of `seat` until the answer is one of the `legal` actions. After
/// `max_invalid_attempts`, if there is a limit, takes the default action. `on_invalid` receives
/// each illegal action.
///
/// # Panics
/// If no decision is open and the limit is reached.
pub fn ask(
    game: &Game,
    seat: Seat,
    legal: &Mask,
    max_invalid_attempts: Option<NonZeroU32>,
    mut decide: impl FnMut(&Observation) -> ActionId,
    mut on_invalid: impl FnMut(ActionId),
) -> Answer {
    let observation = game.observe(Viewer::Seat(seat));
    let mut attempts = 0u32;
    loop {
        let action = decide(&observation);
        if legal.contains(action) {
            return Answer {
                action,
                by_default: false,
            };
        }
        on_invalid(action);
        attempts = attempts.saturating_add(1);
        if max_invalid_attempts.is_some_and(|limit| attempts >= limit.get()) {
            return Answer {
                action: game
                    .default_action()
                    .expect("an open decision has a default"),
                by_default: true,
            };
        }
    }
}

/// Whether an invalid attempt at this decision counts as a wrong action. Only attempts at turns are
/// counted and rewarded.
pub fn is_wrong_action(decision: Decision) -> bool {
    decision.kind == DecisionKind::Turn
}
