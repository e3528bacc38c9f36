//! Runs a command line: parses it, starts logging, runs the command, and says why it failed.

use std::io::{self, IsTerminal as _};
use std::process::ExitCode;
use std::sync::LazyLock;

use clap::builder::FalseyValueParser;
use clap::{Parser, Subcommand};
use tokio::runtime::{Builder, Runtime};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{Layer as _, fmt};

pub use crate::config::Invocation;
use crate::error::{CommandError, is_broken_pipe, tell};

/// The commands of a program.
pub trait Commands: Subcommand {
    /// Runs the command.
    ///
    /// # Errors
    /// What its user must know, in words.
    fn run(self, invocation: &Invocation) -> Result<ExitCode, CommandError>;

    /// Whether the command draws on the whole terminal, which log lines would corrupt.
    fn draws(&self) -> bool {
        false
    }

    /// Where the command sends spans, if it does.
    fn otlp_endpoint(&self) -> Option<&str> {
        None
    }
}

/// The version, with the commit of a release.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let version = env!("CARGO_PKG_VERSION");
    match option_env!("CHEFSHAT_COMMIT") {
        Some(commit) => format!("{version} ({commit})"),
        None => version.to_owned(),
    }
});

/// Chef's Hat: a game server for agents, robots and people.
#[derive(Debug, Parser)]
#[command(
    name = "chefshat",
    bin_name = "chefshat",
    version = VERSION.as_str(),
    propagate_version = true
)]
pub struct CommandLine<C: Subcommand> {
    #[command(subcommand)]
    command: C,
    /// Log filter for standard error, for example `debug` or `chefshat=debug`.
    #[arg(long, env = "CHEFSHAT_LOG", default_value = "warn", global = true)]
    log: String,
    /// Log lines as JSON.
    #[arg(long, env = "CHEFSHAT_LOG_JSON", global = true, value_parser = FalseyValueParser::new())]
    log_json: bool,
}

/// Runs the command line of this process.
pub fn run<C: Commands>() -> ExitCode {
    let result = Invocation::of_process::<CommandLine<C>>().and_then(|(cli, invocation)| {
        let _tracing = start_logging(&cli)?;
        cli.command.run(&invocation)
    });
    match result {
        Ok(code) => code,
        // The reader of the output has closed the pipe, as `head` does.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            tell(format_args!("chefshat: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Runs a command on tokio's threads.
///
/// # Errors
/// The command failed, or the operating system cannot start the threads.
pub fn in_runtime<T>(
    command: impl Future<Output = Result<T, CommandError>>,
) -> Result<T, CommandError> {
    runtime()?.block_on(command)
}

/// [`in_runtime`] for a command that reads standard input by tokio. Its end does not wait for the
/// thread that reads, which only more input would wake.
///
/// # Errors
/// As [`in_runtime`].
pub fn in_runtime_with_input(
    command: impl Future<Output = Result<ExitCode, CommandError>>,
) -> Result<ExitCode, CommandError> {
    let runtime = runtime()?;
    let result = runtime.block_on(command);
    runtime.shutdown_background();
    result
}

fn runtime() -> io::Result<Runtime> {
    Builder::new_multi_thread().enable_all().build()
}

fn start_logging<C: Commands>(cli: &CommandLine<C>) -> Result<Tracing, CommandError> {
    let filter: Targets = (cli.log.parse())
        .map_err(|error| format!("--log {:?}: {error}; use for example info", cli.log))?;
    let terminal = io::stderr().is_terminal();
    let filter = match terminal && cli.command.draws() {
        true => Targets::new(),
        false => filter,
    };
    let colours = terminal && std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty());
    let lines = fmt::layer().with_ansi(colours).with_writer(io::stderr);
    let lines = match cli.log_json {
        true => lines.json().boxed(),
        false => lines.boxed(),
    };
    let logs = tracing_subscriber::registry().with(lines.with_filter(filter));
    #[cfg(feature = "otlp")]
    if let Some(endpoint) = cli.command.otlp_endpoint() {
        let traces = crate::traces::Traces::to(endpoint)?;
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
    _traces: Option<crate::traces::Traces>,
}
