//! The examiner of agents: it plays cases with an agent over the real protocol and says what the agent got wrong. It stands between the
//! agent and a server in the same process, passes every message on, watches, and interferes where a case says so; rooms, clocks and masks
//! are the real ones. How the command is used and what it prints is in `cli`.

pub mod case;
pub mod exam;
mod examination;
pub mod fault;
mod process;
mod relay;

pub use examination::{Examination, ExaminationError, Outcome, Waiting};
pub use process::AgentCommand;
