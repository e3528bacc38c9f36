//! Chef's Hat offline: built-in agents, single games, batches of games on all cores with tables of metrics, comparisons of two
//! agents on duplicate deals, the paper's experiment on the game's mechanics, agents that play from a network file, and checking an engine
//! against test vectors. Nothing here knows of rooms, clocks or the protocol.
//!
//! ```
//! use chefshat_arena::{AgentKind, Batch};
//! use chefshat_engine::{RuleSetSpec, Seat};
//!
//! let rules = RuleSetSpec::default().validate()?;
//! let agents = [AgentKind::Greedy, AgentKind::Random, AgentKind::Random, AgentKind::Random];
//! let table = Batch::new(rules, &agents, 20, 7)?.run(|games| println!("{games} more games"));
//! println!("greedy takes {:.2} points a Shift", table.points_per_shift(Seat::new(0)));
//! # assert_eq!(table.games, 20);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod agents;
mod batch;
pub mod conformance;
mod duplicate;
mod fold;
pub mod mechanics;
mod network;
mod play;
pub mod ratings;
mod recorded;
mod rules_form;
mod seeds;
mod statistics;
mod table;
pub mod tournament;
pub mod vector;

pub use agents::{AgentKind, BuiltInAgent};
pub use batch::{Batch, BatchError};
pub use duplicate::{
    Comparison, Contender, Duplicate, DuplicateError, Figure, Measured, Newcomer, SameSeat,
    SeatPlan, Seating,
};
pub use network::{
    MAX_FILE_BYTES, Network, NetworkError, NetworkInfo, NetworkInput, NetworkOutput, table_features,
};
pub use play::{Listener, PlayedDecision, play};
pub use recorded::{MAX_MODELS, RecordedDecision, RecordedPlayer};
pub use rules_form::{OpeningName, PassScopeName, RulesForm, RulesFormError};
pub use seeds::{agent_seed, game_seed};
pub use statistics::{Interval, Moments, wilson95};
pub use table::{BatchTable, SeatTable};
