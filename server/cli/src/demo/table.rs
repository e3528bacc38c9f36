//! The room of a demo and its agents, each with a connection of its own.

use std::net::SocketAddr;
use std::time::Duration;

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_client::{Client, Outcome, PlayError, v1};
use tokio::task::JoinHandle;

use super::super::CommandError;
use super::super::remote::{RemoteAgent, seed_for};

/// An agent while it plays.
pub(super) type Player = JoinHandle<Result<Outcome, PlayError>>;

/// A room with its agents.
pub(super) struct Table {
    /// Connection of the room's creator and spectator.
    pub(super) client: Client,
    /// The room as created.
    pub(super) room: v1::Room,
    /// The agents.
    pub(super) agents: Agents,
}

/// The agents of a room; the index of each list is the seat.
pub(super) struct Agents {
    pub(super) kinds: Vec<NamedAgent>,
    pub(super) names: Vec<String>,
    pub(super) players: Vec<Player>,
}

impl Table {
    /// Creates the room, seats the agents in order and starts them.
    pub(super) async fn set(
        address: SocketAddr,
        kinds: Vec<NamedAgent>,
        rules: v1::RuleSet,
        seed: Option<u64>,
        pace: Duration,
    ) -> Result<Self, CommandError> {
        let server = format!("http://{address}");
        let client = Client::connect(&server).await?;
        let made = client
            .create_room(v1::CreateRoomRequest {
                name: "demo".into(),
                rules: Some(rules),
                game_seed: seed.map_or_else(Vec::new, |seed| game_seed(seed).to_vec()),
                ..v1::CreateRoomRequest::default()
            })
            .await?;
        let room = made
            .room
            .ok_or("the server did not return the created room")?;
        let names = names(&kinds);
        // All take their seats before the first plays, so that seats do not depend on timing.
        let mut seated = Vec::with_capacity(kinds.len());
        for name in &names {
            let own = Client::connect(&server).await?;
            let joined = own
                .join_with_code(made.join_code.as_str(), name.as_str())
                .await?;
            seated.push((own, joined.ticket));
        }
        let players = seated
            .into_iter()
            .zip(&kinds)
            .enumerate()
            .map(|(seat, ((own, ticket), kind))| {
                let seed = seed_for(&format!("chefshat demo agent {seat}"), seed);
                let agent = RemoteAgent::named(*kind, seed, pace);
                tokio::spawn(async move { own.play(ticket, agent).await })
            })
            .collect();
        Ok(Self {
            client,
            room,
            agents: Agents {
                kinds,
                names,
                players,
            },
        })
    }
}

/// The agents' results at the end of the game, by seat.
pub(super) async fn outcomes(players: Vec<Player>) -> Result<Vec<Outcome>, CommandError> {
    let mut outcomes = Vec::with_capacity(players.len());
    for player in players {
        outcomes.push(player.await??);
    }
    Ok(outcomes)
}

/// The game seed for the user's seed.
pub(super) fn game_seed(seed: u64) -> [u8; 32] {
    seed_for("chefshat demo game", Some(seed))
}

/// Unique names for the agents; the first letter shows the kind of agent.
fn names(kinds: &[NamedAgent]) -> Vec<String> {
    let mut used = [0; NamedAgent::NAMES.len()];
    kinds
        .iter()
        .map(|kind| {
            let (number, names) = match kind {
                NamedAgent::Kind(AgentKind::Greedy) => {
                    (0, ["Greta", "Gustav", "Gina", "Georg", "Gloria", "Gil"])
                }
                NamedAgent::Kind(AgentKind::Random) => {
                    (1, ["Rosa", "Rolf", "Rita", "Remi", "Ruth", "Ravi"])
                }
                NamedAgent::Kind(AgentKind::RandomUnmasked) => {
                    (2, ["Uma", "Udo", "Ulla", "Ugo", "Ursa", "Ulf"])
                }
                NamedAgent::Kind(AgentKind::Trained) => {
                    (3, ["Tara", "Timo", "Thea", "Theo", "Tilda", "Tom"])
                }
                NamedAgent::MonteCarlo(_) => (4, ["Mona", "Max", "Mia", "Moritz", "Maya", "Milo"]),
            };
            let name = names[used[number] % names.len()];
            used[number] += 1;
            name.to_owned()
        })
        .collect()
}
