//! `chefshat`: a server, what plays on it, and what operates it. The commands that need pictures,
//! datasets or simulations are those of `chefshat-lab`, which this program starts.

use std::process::ExitCode;

use chefshat_cli::{WithLab, program};

/// The allocators of C libraries keep the memory that a flood of clients took; this one gives it
/// back within seconds.
#[cfg(all(target_os = "linux", feature = "dist"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

fn main() -> ExitCode {
    program::run::<WithLab>()
}
