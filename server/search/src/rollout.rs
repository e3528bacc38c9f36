//! Plays a possible game on, to the end of its Shift, and says what that was worth.

use std::sync::Arc;

use chefshat_agents::{AgentKind, BuiltInAgent, Network};
use chefshat_engine::{ActionId, Event, Game, MAX_SEATS, Seat, Viewer};

/// The agents that play all seats in rollouts.
#[derive(Clone, Debug)]
pub enum RolloutPolicy {
    /// Agents of a kind.
    Kind(AgentKind),
    /// Agents that play by a network, which fits the rules.
    Network(Arc<Network>),
}

impl RolloutPolicy {
    /// The agent of this name: `random`, `greedy` or `trained`.
    pub fn from_name(name: &str) -> Option<RolloutPolicy> {
        AgentKind::of_rollouts(name).map(RolloutPolicy::Kind)
    }

    fn agent(&self, seed: [u8; 32]) -> BuiltInAgent {
        match self {
            RolloutPolicy::Kind(kind) => BuiltInAgent::new(*kind, seed),
            RolloutPolicy::Network(network) => BuiltInAgent::network(Arc::clone(network)),
        }
    }
}

/// What a Shift was worth to a seat.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Worth {
    /// Points of the Shift.
    pub points: u32,
    /// Place in the Shift, from 1.
    pub place: u8,
}

/// Applies an action to a game that ends with its Shift, then lets agents play all seats
/// until the place of `seat` is known. `seed` determines their random choices.
///
/// # Panics
/// If the action is not legal.
pub fn rollout(
    mut game: Game,
    action: ActionId,
    seat: Seat,
    policy: &RolloutPolicy,
    seed: [u8; 32],
) -> Worth {
    let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
        let mut seed = seed;
        seed[0] ^= index as u8;
        policy.agent(seed)
    });
    let mut place = None;
    let mut action = action;
    loop {
        game.apply(action, |event| match event {
            Event::SeatFinished {
                seat: finished,
                place: reached,
            } if finished == seat => place = Some(reached),
            Event::ShiftEnded(end) => place = place.or(end.order.place_of(seat)),
            _ => {}
        })
        .expect("a legal action");
        if let Some(place) = place {
            return Worth {
                points: game.rules().points(place),
                place,
            };
        }
        let decision = game.decision().expect("the Shift is not over");
        let legal = game.legal_actions();
        let observation = game.observe(Viewer::Seat(decision.seat));
        action = match legal.len() {
            1 => legal.nth(0).expect("a legal action"),
            _ => agents[decision.seat.index()].decide(&observation, &legal),
        };
    }
}
