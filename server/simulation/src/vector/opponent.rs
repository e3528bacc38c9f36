//! Who plays the seats that the client does not.

use std::fmt;
use std::fmt::Write as _;

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
    /// The name in messages and records.
    pub fn name(self) -> &'static str {
        match self {
            Opponent::BuiltIn(kind) => kind.name(),
            Opponent::Network(_) => BuiltInAgent::NETWORK,
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

/// Unlike the name, it identifies a network.
impl fmt::Display for Opponent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        if let Opponent::Network(id) = self {
            f.write_char(':')?;
            f.write_str(&hex::encode(id.0))?;
        }
        Ok(())
    }
}
