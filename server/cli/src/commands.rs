//! The commands that both programs have.

use std::process::ExitCode;

use clap::Subcommand;

use crate::error::CommandError;
use crate::program::{Commands, Invocation, in_runtime};
use crate::{
    admin, agent, backup, cluster, config, demo, generate, health, import, key, leaderboard,
    migrate, participant, records, room, serve, study, table, token, tournament, tui, verify,
};

/// The commands of a server, of those who play on it, and of those who operate it.
#[derive(Debug, Subcommand)]
#[expect(
    private_interfaces,
    reason = "programs run commands without looking into them"
)]
pub enum ServerCommand {
    /// Run a server that hosts rooms.
    Serve(serve::Serve),
    /// Run a server and agents over real connections, and watch their game.
    Demo(demo::Demo),
    /// Print the configuration of a server, with the source of each value.
    Config(config::ConfigCommand),
    /// Play on a server as a built-in agent.
    Agent(agent::AgentCommand),
    /// Play in this terminal.
    Play(tui::play::Play),
    /// Watch a room or a recorded game in this terminal.
    Watch(tui::watch::Watch),
    /// Create, list, watch and close rooms of a server.
    Room(room::RoomCommand),
    /// Run a table with real cards: see what it waits for, and report what happens.
    Table(table::TableCommand),
    /// Create, join and follow tournaments, and show their results.
    Tournament(tournament::TournamentCommand),
    /// Run studies with people: conditions, participants, questionnaires, data.
    Study(study::StudyCommand),
    /// Show the ratings of a server's participants.
    Leaderboard(leaderboard::Leaderboard),
    /// List, download and import records of finished games.
    Records(records::RecordsCommand),
    /// Verify records by replaying them; report the first wrong line.
    Verify(verify::Verify),
    /// Import a record from elsewhere, including games at a physical table.
    Import(import::Import),
    /// Show the key that signs a server's records.
    Key(key::KeyCommand),
    /// Operate a running server: clients, rooms and tournaments of others, storage.
    Admin(admin::AdminCommand),
    /// Show the nodes of a cluster, or make one hand over what it owns.
    Cluster(cluster::ClusterCommand),
    /// Export or delete a participant's data.
    Participant(participant::ParticipantCommand),
    /// Create, list and revoke the tokens of a server.
    Token(token::TokenCommand),
    /// Copy a data directory while a server uses it.
    Backup(backup::Backup),
    /// Create a data directory from a copy that `chefshat backup` made.
    Restore(backup::Restore),
    /// Create or upgrade the tables of a PostgreSQL database, or move a data directory there.
    Migrate(migrate::Migrate),
    /// Check that a server answers and takes new games.
    Health(health::Health),
    /// Print a completion script for a shell.
    Completions(generate::Completions),
    /// Write manual pages.
    Man(generate::Man),
}

impl ServerCommand {
    /// Whether the command prints what there is on the command line.
    pub(crate) fn describes_commands(&self) -> bool {
        matches!(self, Self::Completions(_) | Self::Man(_))
    }
}

impl Commands for ServerCommand {
    fn run(self, invocation: &Invocation) -> Result<ExitCode, CommandError> {
        match self {
            Self::Serve(command) => in_runtime(command.run()),
            Self::Demo(command) => in_runtime(command.run()),
            Self::Config(command) => command.run(invocation),
            Self::Agent(command) => in_runtime(command.run()),
            Self::Play(command) => in_runtime(command.run()),
            Self::Watch(command) => in_runtime(command.run()),
            Self::Room(command) => in_runtime(command.run()),
            Self::Table(command) => in_runtime(command.run()),
            Self::Tournament(command) => in_runtime(command.run()),
            Self::Study(command) => in_runtime(command.run()),
            Self::Leaderboard(command) => in_runtime(command.run()),
            Self::Records(command) => in_runtime(command.run()),
            Self::Verify(command) => command.run(),
            Self::Import(command) => command.run(),
            Self::Key(command) => command.run(),
            Self::Admin(command) => in_runtime(command.run()),
            Self::Cluster(command) => in_runtime(command.run()),
            Self::Participant(command) => in_runtime(command.run()),
            Self::Token(command) => command.run(),
            Self::Backup(command) => in_runtime(command.run()),
            Self::Restore(command) => in_runtime(command.run()),
            Self::Migrate(command) => in_runtime(command.run()),
            Self::Health(command) => in_runtime(command.run()),
            Self::Completions(command) => command.run(invocation.command()),
            Self::Man(command) => command.run(invocation.command()),
        }
    }

    fn draws(&self) -> bool {
        matches!(self, Self::Play(_) | Self::Watch(_))
    }

    fn otlp_endpoint(&self) -> Option<&str> {
        #[cfg(feature = "otlp")]
        if let Self::Serve(command) = self {
            return command.settings.otlp_endpoint.as_deref();
        }
        None
    }
}
