//! Plays a possible game on, to the end of its Shift, and says what that was worth.

use std::sync::Arc;

use chefshat_agents::{AgentKind, BuiltInAgent, Network, NetworkBatch};
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

    /// The network by which all seats play, if it decides alone.
    pub fn network(&self) -> Option<&Arc<Network>> {
        match self {
            RolloutPolicy::Kind(AgentKind::Trained) => Some(Network::trained()),
            RolloutPolicy::Kind(_) => None,
            RolloutPolicy::Network(network) => Some(network),
        }
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

/// Applies its action to each game, which ends with its Shift, then lets agents play all seats until
/// the place of `seat` is known. The seed beside a game determines their random choices. The games
/// are played side by side, so that a network decides for many of them at a time; each result is that
/// of the game alone.
///
/// # Panics
/// If an action is not legal.
pub fn rollouts(
    starts: impl IntoIterator<Item = (Game, ActionId, [u8; 32])>,
    seat: Seat,
    policy: &RolloutPolicy,
) -> Vec<Worth> {
    if let Some(network) = policy.network() {
        return side_by_side(starts, seat, network);
    }
    let alone = |(mut game, mut action, seed): (Game, ActionId, [u8; 32])| {
        let mut agents = Agents::new(|_| policy, seed);
        loop {
            if let Some(worth) = worth_after(&mut game, action, seat) {
                return worth;
            }
            action = agents.decide(&game);
        }
    };
    starts.into_iter().map(alone).collect()
}

/// Plays games as [`rollouts`] says, all seats by one network.
fn side_by_side(
    starts: impl IntoIterator<Item = (Game, ActionId, [u8; 32])>,
    seat: Seat,
    network: &Network,
) -> Vec<Worth> {
    let (mut worths, mut going) = (Vec::new(), Vec::new());
    for (place, (game, action, _)) in starts.into_iter().enumerate() {
        worths.push(Worth::default());
        going.push((place, game, action));
    }
    let mut batch = NetworkBatch::default();
    while !going.is_empty() {
        going.retain_mut(|(place, game, action)| {
            loop {
                if let Some(worth) = worth_after(game, *action, seat) {
                    worths[*place] = worth;
                    return false;
                }
                let decision = game.decision().expect("the Shift is not over");
                let observation = game.observe(Viewer::Seat(decision.seat));
                match network.decide_or_wait(&observation, &game.legal_actions(), &mut batch) {
                    Some(known) => *action = known,
                    None => return true,
                }
            }
        });
        network.decide_all(&mut batch, |waited, chosen| going[waited].2 = chosen);
    }
    worths
}

/// Applies an action, and says what the Shift is worth to a seat once its place is known.
fn worth_after(game: &mut Game, action: ActionId, seat: Seat) -> Option<Worth> {
    let mut place = None;
    game.apply(action, |event| match event {
        Event::SeatFinished {
            seat: finished,
            place: reached,
        } if finished == seat => place = Some(reached),
        Event::ShiftEnded(end) => place = place.or(end.order.place_of(seat)),
        _ => {}
    })
    .expect("a legal action");
    place.map(|place| Worth {
        points: game.rules().points(place),
        place,
    })
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
