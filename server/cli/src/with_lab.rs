//! The commands of `chefshat`: its own, and those of `chefshat-lab`, which it starts for them, as git
//! does.

use std::env;
use std::ffi::OsString;
use std::path::Path;
use std::process::{self, ExitCode};

use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches, Subcommand};

use crate::commands::ServerCommand;
use crate::error::CommandError;
use crate::lab::{COMMANDS, PROGRAM, program};
use crate::program::{Commands, Invocation};

/// The commands of `chefshat`: its own, and those for which it starts `chefshat-lab`.
#[derive(Debug)]
pub enum WithLab {
    /// A command of this program.
    Own(Box<ServerCommand>),
    /// A command of `chefshat-lab`, by its name.
    Lab(&'static str),
}

impl Commands for WithLab {
    fn run(self, invocation: &Invocation) -> Result<ExitCode, CommandError> {
        match (self, program()) {
            // These describe the commands of both programs.
            (Self::Own(command), Some(lab)) if command.describes_commands() => start(&lab),
            (Self::Own(command), _) => command.run(invocation),
            (Self::Lab(_), Some(lab)) => start(&lab),
            (Self::Lab(name), None) => Err(format!(
                "`{name}` is a command of {PROGRAM}, which is neither beside this program nor on the PATH: \
                 take it from the release, or build it with `cargo build -p {PROGRAM}` (add --release where speed matters)"
            )
            .into()),
        }
    }

    fn draws(&self) -> bool {
        matches!(self, Self::Own(command) if command.draws())
    }

    fn otlp_endpoint(&self) -> Option<&str> {
        match self {
            Self::Own(command) => command.otlp_endpoint(),
            Self::Lab(_) => None,
        }
    }
}

/// Runs the program with the arguments of this process, in its place where the system can.
fn start(program: &Path) -> Result<ExitCode, CommandError> {
    let mut command = process::Command::new(program);
    command.args(env::args_os().skip(1));
    let failed = |error| format!("cannot start {}: {error}", program.display());
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt as _;
        Err(failed(command.exec()).into())
    }
    #[cfg(not(unix))]
    {
        let code = command.status().map_err(failed)?.code();
        let code = code.and_then(|code| u8::try_from(code).ok()).unwrap_or(1);
        Ok(ExitCode::from(code))
    }
}

impl FromArgMatches for WithLab {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Self::from_arg_matches_mut(&mut matches.clone())
    }

    fn from_arg_matches_mut(matches: &mut ArgMatches) -> Result<Self, clap::Error> {
        let named = |name: &str| COMMANDS.iter().find(|(command, _)| *command == name);
        match matches.subcommand_name().and_then(named) {
            Some((name, _)) => Ok(Self::Lab(name)),
            None => Box::from_arg_matches_mut(matches).map(Self::Own),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for WithLab {
    fn augment_subcommands(command: Command) -> Command {
        ServerCommand::augment_subcommands(command).subcommands(COMMANDS.map(stub))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        ServerCommand::has_subcommand(name) || COMMANDS.iter().any(|(command, _)| *command == name)
    }
}

/// A command whose arguments only the other program understands.
fn stub((name, about): (&'static str, &'static str)) -> Command {
    let rest = Arg::new("arguments")
        .num_args(0..)
        .action(ArgAction::Append)
        .trailing_var_arg(true)
        .allow_hyphen_values(true)
        .value_parser(clap::value_parser!(OsString));
    Command::new(name)
        .about(about)
        .after_help(format!("`chefshat {name} --help` prints its options."))
        .disable_help_flag(true)
        .disable_version_flag(true)
        .arg(rest)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::help::GROUPS;
    use crate::program::CommandLine;

    #[test]
    fn each_command_is_in_one_group() {
        let mut command = CommandLine::<WithLab>::command();
        command.build();
        let mut names: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        let mut listed: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .copied()
            .collect();
        names.sort_unstable();
        listed.sort_unstable();
        assert_eq!(listed, names);
    }
}
