//! `chefshat completions` and `chefshat man`: what a shell and `man` know about the command line,
//! generated from its definition.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command};
use clap_complete::Shell;

use crate::error::CommandError;

/// Print a completion script for a shell.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat completions bash > ~/.local/share/bash-completion/completions/chefshat"
)]
pub(super) struct Completions {
    /// Shell that reads the script.
    shell: Shell,
}

impl Completions {
    /// Prints the script for a command line.
    pub(super) fn run(&self, mut of: Command) -> Result<ExitCode, CommandError> {
        // Written at once: the generator panics if the reader of the output closes it.
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut of, "chefshat", &mut script);
        io::Write::write_all(&mut io::stdout().lock(), &script)?;
        Ok(ExitCode::SUCCESS)
    }
}

/// Write manual pages: one for each command.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  chefshat man --out-dir ~/.local/share/man/man1")]
pub(super) struct Man {
    /// Folder for the pages, created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out_dir: PathBuf,
}

impl Man {
    /// Writes the pages of a command line.
    pub(super) fn run(&self, of: Command) -> Result<ExitCode, CommandError> {
        std::fs::create_dir_all(&self.out_dir)
            .and_then(|()| clap_mangen::generate_to(of, &self.out_dir))
            .map_err(|error| {
                let folder = self.out_dir.display();
                format!("cannot write manual pages to {folder}: {error}; choose another --out-dir")
            })?;
        Ok(ExitCode::SUCCESS)
    }
}
