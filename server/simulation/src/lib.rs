//! Plays Chef's Hat offline: batches of games on all cores with tables of metrics, comparisons of
//! two agents on duplicate deals, vector environments, offline tournaments, the paper's experiment
//! on the mechanics of the game, the power of studies, and checks of the engine against test
//! vectors. Rooms, clocks and the protocol are not involved.
//!
//! ```
//! use chefshat_agents::AgentKind;
//! use chefshat_simulation::Batch;
//! use chefshat_engine::{RuleSetSpec, Seat};
//!
//! let rules = RuleSetSpec::default().validate()?;
//! let agents = [AgentKind::Greedy, AgentKind::Random, AgentKind::Random, AgentKind::Random];
//! let table = Batch::new(rules, &agents, 20, 7)?.run(&|games| println!("{games} more games"));
//! println!("greedy takes {:.2} points a Shift", table.points_per_shift(Seat::new(0)));
//! # assert_eq!(table.games, 20);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod batch;
pub mod calibration;
mod chance;
pub mod conformance;
mod duplicate;
mod fold;
pub mod mechanics;
pub mod power;
mod rules_form;
mod table;
pub mod tournament;
pub mod vector;

pub use batch::{Batch, BatchError};
pub use duplicate::{
    Candidate, Comparison, Contender, Duplicate, DuplicateError, Figure, Measured, SameSeat,
    SeatPlan, Seating, Tally,
};
pub use fold::Progress;
pub use rules_form::{RulesForm, RulesFormError};
pub use table::{BatchTable, SeatTable};
