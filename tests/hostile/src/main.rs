//! The hostile suite: attacks a server while an honest room plays on it, and reports what the
//! honest room notices and what the server pays. This file only parses and wires; the crate's
//! README explains the figures.

mod attacks;
mod error;
mod gauge;
mod honest;
mod options;
mod probe;
mod raw;
mod report;
mod run;
mod tally;

use std::process::ExitCode;

use clap::Parser as _;

use error::HostileError;
use options::Options;
use report::Report;

fn main() -> ExitCode {
    let options = Options::parse();
    match measure(&options) {
        Ok(report) => {
            match options.json {
                true => println!("{}", report.to_json()),
                false => print!("{}", report.to_markdown()),
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("chefshat-hostile: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the attacks one after another, each on a server of its own.
fn measure(options: &Options) -> Result<Report, HostileError> {
    gauge::raise_descriptor_limit();
    let server = options.server()?;
    let runtimes = run::Runtimes::new()?;
    let mut rows = Vec::new();
    for attack in options.attacks() {
        eprintln!("{} ...", attack.name);
        rows.push(run::run(&runtimes, &server, attack, options)?);
    }
    Ok(Report::new(rows))
}
