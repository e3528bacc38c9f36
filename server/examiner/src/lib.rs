//! The examiner of agents: plays cases with an agent over the real protocol and reports its faults.
//! It stands between the agent and a server in the same process, forwards every message, watches,
//! and interferes if a case requires it; rooms, clocks and masks are the real ones. The command is
//! in the command line's crate.

pub mod case;
pub mod exam;
mod examination;
pub mod fault;
mod process;
mod relay;

pub use examination::{Examination, ExaminationError, Outcome, Waiting};
pub use process::{AgentCommand, AgentProcess, Placeholders};
