//! Chef's Hat offline: built-in agents, single games, batches of games on all cores with tables of metrics, and checking an engine
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
mod play;
mod recorded;
mod rules_form;
mod seeds;
mod table;

pub use agents::{AgentKind, BuiltInAgent};
pub use batch::{Batch, BatchError};
pub use play::{Listener, play};
pub use recorded::{MAX_MODELS, RecordedDecision, RecordedPlayer};
pub use rules_form::{OpeningName, PassScopeName, RulesForm, RulesFormError};
pub use seeds::{agent_seed, game_seed};
pub use table::{BatchTable, SeatTable};
