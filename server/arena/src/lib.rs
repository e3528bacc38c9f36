//! Chef's Hat offline: built-in agents, batches of games on all cores, tables of metrics. Nothing here knows of rooms, clocks or the
//! protocol.

mod agents;

pub use agents::{AgentKind, BuiltInAgent};
