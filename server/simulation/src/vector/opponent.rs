//! Who plays the seats that the client does not.

use std::borrow::Cow;
use std::fmt;

use chefshat_agents::{AgentKind, BuiltInAgent, NetworkId};

/// The agent of a seat that the client does not play.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Opponent {
    /// A built-in agent.
    BuiltIn(AgentKind),
    /// A network that the client has supplied.
    Network(NetworkId),
}

impl Opponent {
    /// The name in messages and records; that of a network has the first 16 hexadecimal digits of
    /// its id.
    pub fn name(self) -> Cow<'static, str> {
        match self {
            Opponent::BuiltIn(kind) => kind.name().into(),
            Opponent::Network(id) => network_name(&id.0[..8]).into(),
        }
    }

    /// Reads what `to_string` writes.
    pub(super) fn from_text(text: &str) -> Option<Opponent> {
        let Some(digits) = text.strip_prefix("network:") else {
            return AgentKind::from_name(text).map(Opponent::BuiltIn);
        };
        let mut id = [0; 16];
        hex::decode_to_slice(digits, &mut id).ok()?;
        Some(Opponent::Network(NetworkId(id)))
    }
}

/// The name of a network in records, from the first 8 bytes of its id, or from all of them.
fn network_name(id: &[u8]) -> String {
    format!("{}:{}", BuiltInAgent::NETWORK, hex::encode(id))
}

/// As the name, with the complete id of a network.
impl fmt::Display for Opponent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Opponent::BuiltIn(kind) => f.write_str(kind.name()),
            Opponent::Network(id) => f.write_str(&network_name(&id.0)),
        }
    }
}
