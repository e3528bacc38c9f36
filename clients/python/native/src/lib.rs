//! The Python module `chefshat_native`: vector environments in the process of the client, on the
//! same columns as `VectorService`. Setups, resets and records are the protocol's messages, so that
//! there is one contract for every way to the games.
//!
//! `games` has the class that steps games, `tables` their batches as numpy arrays, `threads` the
//! pools of threads.

mod games;
mod tables;
mod threads;

use pyo3::prelude::*;

/// The engine of Chef's Hat: vector environments in the process of the client.
#[pymodule]
mod chefshat_native {
    #[pymodule_export]
    use crate::games::{Games, Refused, action_texts};
    #[pymodule_export]
    use crate::tables::Batch;

    /// The version of the module.
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
