//! Plays a possible game on, to the end of its Shift, and says what that was worth.

use std::sync::Arc;

use chefshat_agents::{AgentKind, BuiltInAgent, Network};
use chefshat_engine::{ActionId, BySeat, Event, Game, MAX_SEATS, Seat, Viewer};

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
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
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
    let mut agents = Agents::new(|_| policy, seed);
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
        action = agents.decide(&game);
    }
}

/// Lets agents, one policy for each seat, play a game that ends with its Shift to that end. `seed`
/// determines their random choices.
///
/// # Panics
/// If no decision is open, or there is not one policy for each seat.
pub fn play_on(mut game: Game, policies: &[RolloutPolicy], seed: [u8; 32]) -> BySeat<Worth> {
    let players = game.rules().players();
    assert_eq!(policies.len(), players, "there is a policy for each seat");
    let mut agents = Agents::new(|seat| &policies[seat % players], seed);
    let mut order = None;
    while order.is_none() {
        let action = agents.decide(&game);
        game.apply(action, |event| {
            if let Event::ShiftEnded(end) = event {
                order = Some(end.order);
            }
        })
        .expect("a legal action");
    }
    let order = order.expect("the Shift has ended");
    let mut worths = BySeat::filled(players, Worth::default());
    for seat in worths.seats() {
        let place = order.place_of(seat).expect("every seat has a place");
        worths[seat] = Worth {
            points: game.rules().points(place),
            place,
        };
    }
    worths
}

/// What an agent does at the open decision of a game. `seed` determines its random choices.
///
/// # Panics
/// If no decision is open.
pub fn choose(game: &Game, policy: &RolloutPolicy, seed: [u8; 32]) -> ActionId {
    Agents::new(|_| policy, seed).decide(game)
}

/// The agents of all seats.
struct Agents([BuiltInAgent; MAX_SEATS]);

impl Agents {
    fn new<'a>(policy: impl Fn(usize) -> &'a RolloutPolicy, seed: [u8; 32]) -> Agents {
        Agents(std::array::from_fn(|seat| {
            let mut own = seed;
            own[0] ^= seat as u8;
            policy(seat).agent(own)
        }))
    }

    /// What the seat that decides does.
    fn decide(&mut self, game: &Game) -> ActionId {
        let decision = game.decision().expect("the Shift is not over");
        let legal = game.legal_actions();
        match legal.len() {
            1 => legal.nth(0).expect("a legal action"),
            _ => {
                let observation = game.observe(Viewer::Seat(decision.seat));
                self.0[decision.seat.index()].decide(&observation, &legal)
            }
        }
    }
}
