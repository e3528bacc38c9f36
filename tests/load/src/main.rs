//! The load program: plays many rooms on a server and on a bare tonic room, in turns, and reports
//! the cost of a decision. This file only parses and wires; the crate's README explains the
//! measurements.

mod bare;
mod disk;
mod error;
mod gauge;
mod host;
mod options;
mod ping;
mod play;
mod pulse;
mod report;
mod restart;
mod scenario;
mod server;
mod tally;
mod vector;
mod wire;

use std::process::ExitCode;

use clap::Parser as _;
use tokio::runtime::{Builder, Runtime};

use error::LoadError;
use options::{Load, Options, Place, Role};
use report::Report;

fn main() -> ExitCode {
    let mut options = Options::parse();
    options.load.place.pin |= options.load.scale;
    let result = match &options.role {
        Some(Role::Serve(options)) => runtime(options.place, options.place.core)
            .and_then(|runtime| runtime.block_on(server::serve(options))),
        None => {
            let place = options.load.place;
            runtime(place, place.client_core.unwrap_or(place.core))
                .and_then(|runtime| runtime.block_on(measure(&options.load)))
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("chefshat-load: {error}");
            ExitCode::FAILURE
        }
    }
}

async fn measure(load: &Load) -> Result<(), LoadError> {
    if let Some(rooms) = load.restart {
        return restart::measure(load, rooms).await;
    }
    if load.vector {
        return vector::measure(load).await;
    }
    let disk_syncs = (load.durability.then(|| disk::syncs_per_second(load))).transpose()?;
    let mut outcomes = Vec::new();
    let mut failures = Vec::new();
    for scenario in scenario::scenarios(load) {
        let name = scenario.name();
        eprintln!("{name} ...");
        let (outcome, failed) = scenario::run(load, scenario).await;
        // What was measured before is reported; hours of work may be in it.
        outcomes.extend((!outcome.rounds.is_empty()).then_some(outcome));
        failures.extend(failed.map(|error| format!("{name}: {error}")));
    }
    let report = Report::new(load, &outcomes, disk_syncs, &failures);
    if load.json {
        let json = serde_json::to_string_pretty(&report).expect("a report is plain data");
        println!("{json}");
    } else {
        print!("{}", report.to_text());
    }
    match failures.is_empty() {
        true => Ok(()),
        false => Err(LoadError::Scenarios(failures.join("; "))),
    }
}

/// The runtime of one side. With `--pin`, binds the process to its core before the first thread
/// starts.
fn runtime(place: Place, core: usize) -> Result<Runtime, LoadError> {
    let mut builder = if place.pin {
        gauge::bind_to_core(core).map_err(LoadError::io("binding to a core"))?;
        Builder::new_current_thread()
    } else {
        let mut builder = Builder::new_multi_thread();
        if place.threads > 0 {
            builder.worker_threads(place.threads.into());
        }
        builder
    };
    builder
        .enable_all()
        .build()
        .map_err(LoadError::io("starting a runtime"))
}
