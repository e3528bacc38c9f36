//! Search in games with hidden hands: deals that are consistent with what a seat knows, games played
//! on from them, and what its actions are worth. `docs/search.md` says how it works and what is
//! exact.

mod agent;
mod belief;
mod evaluate;
mod history;
mod holders;
mod knowledge;
mod own_time;
mod rollout;
mod sampler;
mod table;

pub use agent::{Choice, Decisions, MARGIN, Searchers, named_agent, show_nothing, suggested};
pub use belief::Belief;
pub use evaluate::{
    Allocation, Estimate, Evaluation, LikelyHands, Method, evaluate, likely_hands, outcomes,
};
pub use history::ShiftHistory;
pub use knowledge::{Knowledge, KnowledgeError, World};
pub use own_time::OwnTime;
pub use rollout::{RolloutPolicy, Worth, choose, play_on, rollouts};
pub use sampler::{Chance, Sampler};
