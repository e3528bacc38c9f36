//! Vector environments as messages: what `VectorService` and the Python package in one process
//! share. `setup` reads setups, `opponents` the agents in them, `request` later requests, `batch`
//! writes batches, `record` records of finished games, `states` saves games.
//! `chefshat_simulation::vector` plays the games.

mod batch;
mod error;
mod opponents;
mod record;
mod request;
mod setup;
mod states;

pub use batch::{MAX_BATCH_BYTES, batch_to_proto};
pub use error::RequestError;
pub use record::{record_lines, record_parts, simulation_policy};
pub use request::{Request, Reset};
pub use setup::{Limits, seeds_from_setup, setup_from_proto, start_from_proto, started_to_proto};
pub use states::saved_to_proto;
