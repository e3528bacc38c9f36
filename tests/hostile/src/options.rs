//! The command line. The README of this crate explains the figures.

use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;

use crate::attacks::{ATTACKS, Attack};
use crate::error::HostileError;
use crate::scenarios::{Scenario, seconds};

/// Attack a Chef's Hat server while an honest room of four agents plays on it. Each attack gets a
/// server of its own on the loopback interface; nothing else is contacted.
#[derive(Debug, Parser)]
#[command(
    name = "chefshat-hostile",
    version,
    after_help = "Examples:\n  chefshat-hostile                          all attacks, about fifteen minutes\n  chefshat-hostile idle                     memory of 10,000 idle connections\n  chefshat-hostile spectators               1,000 spectators that do not read\n  chefshat-hostile soak --json              an hour of rooms that start and end\n  chefshat-hostile --attack ping-flood      one of them\n  chefshat-hostile --list                   their names\n  chefshat-hostile --server old/chefshat --json > before.json"
)]
pub(crate) struct Options {
    #[command(subcommand)]
    pub(crate) scenario: Option<Scenario>,
    /// Run only this attack. Repeatable.
    #[arg(long = "attack", value_name = "NAME", value_parser = attack)]
    only: Vec<&'static Attack>,
    /// The server: the binary chefshat. Default: the one beside this program.
    #[arg(long, value_name = "PROGRAM", global = true)]
    server: Option<PathBuf>,
    /// List the attacks.
    #[arg(long, exclusive = true)]
    list: bool,
    /// Seconds that the honest room plays before the attack.
    #[arg(long, default_value = "5", value_parser = seconds)]
    pub(crate) quiet: Duration,
    /// Seconds of the attack.
    #[arg(long, default_value = "12", value_parser = seconds)]
    pub(crate) seconds: Duration,
    /// Seconds after the attack in which the server may give its memory back.
    #[arg(long, default_value = "10", value_parser = seconds)]
    pub(crate) rest: Duration,
    /// Divide all counts of the attacks by this number, to test that the program works.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    pub(crate) divide: u32,
    /// Print one JSON document instead of a table.
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

impl Options {
    /// The attacks to run.
    pub(crate) fn attacks(&self) -> Vec<&'static Attack> {
        if self.list {
            for attack in ATTACKS {
                println!("{:24} {}", attack.name, attack.what);
            }
            return Vec::new();
        }
        match self.only.is_empty() {
            true => ATTACKS.iter().collect(),
            false => self.only.clone(),
        }
    }

    /// The binary of the server.
    pub(crate) fn server(&self) -> Result<PathBuf, HostileError> {
        let path = match &self.server {
            // Those on small disks are started in another folder.
            Some(path) => {
                std::path::absolute(path).map_err(HostileError::io("finding the server"))?
            }
            None => std::env::current_exe()
                .map_err(HostileError::io("finding this program"))?
                .with_file_name("chefshat"),
        };
        match path.is_file() {
            true => Ok(path),
            false => Err(HostileError::NoServer(path)),
        }
    }
}

fn attack(name: &str) -> Result<&'static Attack, String> {
    (ATTACKS.iter().find(|attack| attack.name == name))
        .ok_or_else(|| format!("there is no attack {name:?}; --list shows them"))
}
