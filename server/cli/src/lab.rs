//! Where `chefshat-lab` is, and what it does: a second program for what needs datasets, pictures or
//! simulations, which nobody needs to host or play.

use std::env;
use std::path::{Path, PathBuf};

/// The program.
pub const PROGRAM: &str = "chefshat-lab";

/// Its commands, as `chefshat --help` lists them. `chefshat-lab` tests that these are all.
pub const COMMANDS: [(&str, &str); 10] = [
    (
        "export",
        "Export records as a dataset: Parquet, CSV or JSON Lines, with a dataset card",
    ),
    (
        "render",
        "Draw a record: a picture, an animation, or the action table of a decision",
    ),
    ("simulate", "Play many games offline and print statistics"),
    (
        "compare",
        "Compare two agents on duplicate deals: the same deals for both, in all seats",
    ),
    (
        "bench",
        "Play the benchmark ChefsHat-v1, check submissions, print tables of results",
    ),
    ("ratings", "Recompute the leaderboard from records"),
    ("experiment", "Run an experiment of the paper"),
    (
        "check-agent",
        "Test whether an agent, in any language, plays correctly",
    ),
    ("conformance", "Check the rule engine against test vectors"),
    (
        "mcp",
        "Let language models play: a Model Context Protocol server",
    ),
];

/// The program, beside this one or on the PATH.
#[must_use]
pub fn program() -> Option<PathBuf> {
    let name = format!("{PROGRAM}{}", env::consts::EXE_SUFFIX);
    let own = env::current_exe().ok()?;
    // A link in another folder points to a folder that has both.
    let real = own.canonicalize().ok();
    let path = env::var_os("PATH").unwrap_or_default();
    ([Some(own), real].into_iter().flatten())
        .filter_map(|own| own.parent().map(Path::to_owned))
        .chain(env::split_paths(&path))
        .map(|folder| folder.join(&name))
        .find(|program| program.is_file())
}
