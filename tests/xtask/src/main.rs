//! `cargo xtask`: sets up and runs the tests of all languages, runs the linters, builds the
//! page, the book, wheels and releases.
//!
//! The command line is here; [`lint`], [`test`], [`book`], [`web`], [`wheels`] and [`dist`] are the tasks, [`setup`] prepares them.
//! It depends on no crate of the project: it only starts other programs, and builds even if they do
//! not.

mod arrows;
mod book;
mod circles;
mod command;
mod dist;
mod failure;
mod lint;
mod notices;
mod places;
mod setup;
mod steps;
mod test;
mod web;
mod wheels;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::places::Places;
use crate::steps::Steps;

/// Set up, test and lint everything in every language.
#[derive(Parser)]
#[command(
    name = "cargo xtask",
    after_help = "Example: cargo xtask test --only python"
)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run all tests; sets up what they need, inside the build folder.
    Test(test::Options),
    /// Check format, lints, protocol, licences and images.
    Lint,
    /// Build the book of `docs/` into `target/book`, and check its links.
    Book,
    /// Build the page for people, which the server serves on its port.
    Web,
    /// Build the wheels of the Python packages, into `target/wheels`.
    Wheels {
        /// Cargo's profile for the program and the native module; `release` builds faster.
        #[arg(long, default_value = "dist")]
        profile: String,
        /// Install them in an empty environment, without Rust and this repository, and use them.
        #[arg(long = "try")]
        try_them: bool,
    },
    /// Make a release of the commit that is checked out, into `target/artefacts`: archives, a Debian
    /// package, an image, wheels, crates, bills of materials, checksums.
    Dist {
        /// Sign the checksums with this SSH key, a file.
        #[arg(long, value_name = "FILE")]
        key: Option<PathBuf>,
        /// Install each part on a bare system, without Rust and this repository, and use it.
        #[arg(long = "try")]
        try_them: bool,
    },
}

#[test]
fn the_tasks_that_documents_name_exist() {
    let root = Places::find().unwrap().root;
    let mut tasks = 0;
    for file in book::documents(&root).unwrap() {
        let text = std::fs::read_to_string(root.join(&file)).unwrap();
        for line in text.lines().filter(|line| line.starts_with("cargo xtask ")) {
            let line = line.split('#').next().unwrap_or_default();
            let arguments = line.split_whitespace().skip(1);
            if let Err(error) = Cli::try_parse_from(arguments) {
                panic!("{file}: {line}: {error}");
            }
            tasks += 1;
        }
    }
    assert!(tasks > 5, "only {tasks} were found");
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut steps = Steps::default();
    let outcome = Places::find().and_then(|places| match cli.task {
        Task::Test(options) => test::run(&places, &mut steps, &options),
        Task::Lint => lint::run(&places, &mut steps),
        Task::Book => book::run(&places, &mut steps),
        Task::Web => web::run(&places, &mut steps),
        Task::Wheels { profile, try_them } => {
            wheels::run(&places, &mut steps, &wheels::HOST, &profile, try_them)
        }
        Task::Dist { key, try_them } => dist::run(&places, &mut steps, key.as_deref(), try_them),
    });
    print!("{}", steps.summary());
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("\nxtask: {failure}");
            ExitCode::FAILURE
        }
    }
}
