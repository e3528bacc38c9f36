//! The command line of `chefshat`: its arguments and one module per command.

mod admin;
mod agent;
mod backup;
mod board;
mod check_agent;
mod cluster;
mod compare;
mod config;
mod conformance;
mod connect;
mod data_dir;
mod demo;
#[cfg(test)]
mod documents;
mod error;
mod experiment;
mod export;
mod generate;
mod health;
mod import;
mod key;
mod kind;
mod lan;
mod language;
mod leaderboard;
mod listen;
mod llm;
mod mcp;
mod migrate;
mod name_key;
mod narration;
mod numbers;
mod output;
mod pages;
mod participant;
mod player;
mod policy_args;
mod progress;
mod ratings;
mod records;
mod remote;
mod render;
mod room;
mod rules_args;
mod secret_file;
mod serve;
mod simulate;
mod study;
mod table;
mod threads;
mod token;
mod tournament;
#[cfg(feature = "otlp")]
mod traces;
mod tui;
mod verify;

use std::io::{self, IsTerminal as _};
use std::process::ExitCode;

use clap::builder::FalseyValueParser;
use clap::{CommandFactory as _, Parser, Subcommand};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer as _, fmt};

use error::{CommandError, say};

/// The allocators of C libraries keep the memory that a flood of clients took; this one gives it
/// back within seconds.
#[cfg(all(target_os = "linux", feature = "dist"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// Chef's Hat: a game server for agents, robots and people.
#[derive(Debug, Parser)]
#[command(name = "chefshat", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Log filter for standard error, for example `debug` or `chefshat_server=debug`.
    #[arg(long, env = "CHEFSHAT_LOG", default_value = "warn", global = true)]
    log: String,
    /// Log lines as JSON.
    #[arg(long, env = "CHEFSHAT_LOG_JSON", global = true, value_parser = FalseyValueParser::new())]
    log_json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a server that hosts rooms.
    Serve(serve::Serve),
    /// Print the configuration of a server, with the source of each value.
    Config(config::ConfigCommand),
    /// Run a server and agents over real connections, and watch their game.
    Demo(demo::Demo),
    /// Play on a server as a built-in agent.
    Agent(agent::AgentCommand),
    /// Test whether an agent, in any language, plays correctly.
    CheckAgent(check_agent::CheckAgent),
    /// Play in this terminal.
    Play(tui::play::Play),
    /// Watch a room or a recorded game in this terminal.
    Watch(tui::watch::Watch),
    /// Let language models play: a Model Context Protocol server.
    Mcp(mcp::Mcp),
    /// Create, list, watch and close rooms of a server.
    Room(room::RoomCommand),
    /// Attend to a table with real cards: see what it waits for, and report what happens.
    Table(table::TableCommand),
    /// Create, join and follow tournaments, and show their results.
    Tournament(tournament::TournamentCommand),
    /// Run studies with people: conditions, participants, questionnaires, data.
    Study(study::StudyCommand),
    /// Show the ratings of a server's participants.
    Leaderboard(leaderboard::Leaderboard),
    /// List, download and import records of finished games.
    Records(records::RecordsCommand),
    /// Export records as a dataset: Parquet, CSV or JSON Lines, with a dataset card.
    Export(export::Export),
    /// Draw a record: a picture, an animation, or the action table of a decision.
    Render(render::Render),
    /// Play many games offline and print statistics.
    Simulate(simulate::Simulate),
    /// Compare two agents on duplicate deals: the same deals for both, in all seats.
    Compare(compare::Compare),
    /// Recompute the leaderboard from records.
    Ratings(ratings::RatingsCommand),
    /// Run an experiment of the paper.
    Experiment(experiment::ExperimentCommand),
    /// Check the rule engine against test vectors.
    Conformance(conformance::Conformance),
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

/// Runs the command.
fn main() -> ExitCode {
    let result = config::Parsed::<Cli>::from_process().and_then(|parsed| {
        let _tracing = start_logging(&parsed.cli)?;
        run(parsed)
    });
    match result {
        Ok(code) => code,
        // The reader of the output has closed the pipe, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            anstream::eprintln!("chefshat: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(parsed: config::Parsed<Cli>) -> Result<ExitCode, CommandError> {
    match parsed.cli.command {
        Command::Serve(command) => in_runtime(command.run()),
        Command::Config(ref command) => parsed.print(command),
        Command::Demo(command) => in_runtime(command.run()),
        Command::Agent(command) => in_runtime(command.run()),
        Command::Play(command) => in_runtime(command.run()),
        Command::Watch(command) => in_runtime(command.run()),
        Command::Mcp(command) => in_runtime(command.run()),
        Command::CheckAgent(command) => in_runtime(command.run()),
        Command::Room(command) => in_runtime(command.run()),
        Command::Table(command) => in_runtime(command.run()),
        Command::Tournament(command) => in_runtime(command.run()),
        Command::Study(command) => in_runtime(command.run()),
        Command::Leaderboard(command) => in_runtime(command.run()),
        Command::Records(command) => in_runtime(command.run()),
        Command::Export(command) => command.run(),
        Command::Render(command) => command.run(),
        Command::Simulate(command) => command.run(),
        Command::Compare(command) => command.run(),
        Command::Ratings(command) => command.run(),
        Command::Experiment(command) => command.run(),
        Command::Conformance(command) => command.run(),
        Command::Verify(command) => command.run(),
        Command::Import(command) => command.run(),
        Command::Key(command) => command.run(),
        Command::Admin(command) => in_runtime(command.run()),
        Command::Cluster(command) => in_runtime(command.run()),
        Command::Participant(command) => in_runtime(command.run()),
        Command::Token(command) => command.run(),
        Command::Backup(command) => in_runtime(command.run()),
        Command::Restore(command) => in_runtime(command.run()),
        Command::Migrate(command) => in_runtime(command.run()),
        Command::Health(command) => in_runtime(command.run()),
        Command::Completions(command) => command.run(Cli::command()),
        Command::Man(command) => command.run(Cli::command()),
    }
}

fn is_broken_pipe(error: &CommandError) -> bool {
    error
        .downcast_ref::<io::Error>()
        .is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

fn in_runtime(
    command: impl Future<Output = Result<ExitCode, CommandError>>,
) -> Result<ExitCode, CommandError> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?
        .block_on(command)
}

fn start_logging(cli: &Cli) -> Result<Tracing, CommandError> {
    let filter = EnvFilter::try_new(&cli.log)
        .map_err(|error| format!("--log {:?}: {error}; use for example info", cli.log))?;
    let terminal = io::stderr().is_terminal();
    // Log lines would corrupt the screen; redirect them to a file.
    let draws = matches!(cli.command, Command::Play(_) | Command::Watch(_));
    let filter = if terminal && draws {
        EnvFilter::new("off")
    } else {
        filter
    };
    let colours = terminal && std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty());
    let lines = fmt::layer().with_ansi(colours).with_writer(io::stderr);
    let lines = match cli.log_json {
        true => lines.json().boxed(),
        false => lines.boxed(),
    };
    let logs = tracing_subscriber::registry().with(lines.with_filter(filter));
    #[cfg(feature = "otlp")]
    if let Command::Serve(command) = &cli.command
        && let Some(endpoint) = &command.settings.otlp_endpoint
    {
        let traces = traces::Traces::to(endpoint)?;
        logs.with(traces.layer()).init();
        return Ok(Tracing {
            _traces: Some(traces),
        });
    }
    logs.init();
    Ok(Tracing::default())
}

/// What writes logs and spans until the end of the process.
#[derive(Default)]
struct Tracing {
    #[cfg(feature = "otlp")]
    _traces: Option<traces::Traces>,
}
