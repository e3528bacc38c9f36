//! The hostile suite: attacks a server while an honest room plays on it, and reports what the
//! honest room notices and what the server pays. This file only parses and wires; the crate's
//! README explains the figures.

mod acts;
mod attacks;
mod bodies;
mod error;
mod gauge;
mod honest;
mod largest;
mod options;
mod probe;
mod raw;
mod report;
mod run;
mod scenarios;
mod server;
mod tally;
mod target;
mod webhooks;

use std::process::ExitCode;

use clap::Parser as _;

use error::HostileError;
use options::Options;
use report::Report;
use scenarios::Scenario;

fn main() -> ExitCode {
    let options = Options::parse();
    let measured = match options.scenario {
        Some(scenario) => measure_scenario(scenario, &options).map(|text| (text, true)),
        None => measure(&options).map(|report| match options.json {
            true => (report.to_json(), report.is_complete()),
            false => (report.to_markdown(), report.is_complete()),
        }),
    };
    match measured {
        Ok((text, is_complete)) => {
            println!("{}", text.trim_end());
            match is_complete {
                true => ExitCode::SUCCESS,
                false => ExitCode::FAILURE,
            }
        }
        Err(error) => {
            eprintln!("chefshat-hostile: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs a scenario and returns its report: JSON, or a line for each figure.
fn measure_scenario(scenario: Scenario, options: &Options) -> Result<String, HostileError> {
    gauge::raise_descriptor_limit();
    let server = options.server()?;
    let report = run::Runtimes::new()?.honest(scenario.run(&server))?;
    if options.json {
        return Ok(format!("{report:#}"));
    }
    let figures = report.as_object().into_iter().flatten();
    let figures = figures.filter(|(_, value)| !value.is_array());
    Ok(figures
        .map(|(name, value)| format!("{name:20} {value}\n"))
        .collect())
}

/// Runs the attacks one after another, each on a server of its own.
fn measure(options: &Options) -> Result<Report, HostileError> {
    gauge::raise_descriptor_limit();
    let server = options.server()?;
    let runtimes = run::Runtimes::new()?;
    let mut report = Report::default();
    let attacks = options.attacks();
    for (number, attack) in (1..).zip(&attacks) {
        eprintln!("[{number}/{}] {} ...", attacks.len(), attack.name);
        match run::run(&runtimes, &server, attack, options) {
            Ok(row) => {
                eprintln!("    {}", row.verdict());
                report.add(row);
            }
            // The others still run: together they take many minutes.
            Err(error) => {
                eprintln!("    NOT MEASURED: {error}");
                report.miss(attack, &error);
            }
        }
    }
    Ok(report)
}
