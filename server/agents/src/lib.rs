//! The built-in agents (random, greedy, trained, replay), their names, network files, and playing one game
//! offline. Batches of games are in `chefshat-simulation`.

mod built_in;
mod greedy;
mod named;
mod network;
mod participant;
mod play;
mod recorded;
mod seeds;
mod text;

pub use built_in::{AgentKind, AgentMaker, BuiltInAgent, Following};
pub use named::{AgentNameError, Budget, MonteCarlo, MonteCarloError, NamedAgent};
pub use network::{
    MAX_FILE_BYTES, Network, NetworkBatch, NetworkError, NetworkId, NetworkInfo, NetworkInput,
    NetworkOutput, table_features,
};
pub use participant::ParticipantKind;
pub use play::{Answer, DecisionNotes, Listener, ask, is_wrong_action, play, play_agents};
pub use recorded::{MAX_MODELS, RecordedPlayer};
pub use seeds::{agent_seed, game_seed, seating_agent_seed};
pub use text::shortened;
