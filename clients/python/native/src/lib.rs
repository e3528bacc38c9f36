//! The Python module `chefshat_native`: vector environments in the process of the client, on the
//! same columns as `VectorService`. Setups, resets and records are the protocol's messages, so that
//! there is one contract for every way to the games.
//!
//! `games` has the class that steps games, `tables` their batches as numpy arrays, `search` what a
//! seat knows at a decision and search from there, `threads` the pools of threads.

mod games;
mod search;
mod tables;
mod threads;

use pyo3::prelude::*;

/// The engine of Chef's Hat: vector environments and search in the process of the client.
#[pymodule]
mod chefshat_native {
    #[pymodule_export]
    use crate::games::{Games, Refused, action_texts, trained_network};
    #[pymodule_export]
    use crate::search::{Position, choose_actions, play_states};
    #[pymodule_export]
    use crate::tables::Batch;

    /// The version of the module.
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
