//! ChefsHat-v1, a benchmark for agents: fixed tasks as data, the games of a task offline, and the
//! result that a folder of records proves. `docs/benchmark.md` says how to cite and how to submit.

mod check;
mod offline;
mod result;
mod task;

pub use check::{GameScore, Problem, check};
pub use offline::play_offline;
pub use result::{AgentInfo, MeanWithInterval, PairedDifference, TaskResult};
pub use task::{BENCHMARK, Commitment, DealsKey, Task, tasks};
