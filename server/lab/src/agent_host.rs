//! A server on which agents in any language play, which are started by their commands.

use std::env;
use std::process::ExitStatus;
use std::time::Duration;

use chefshat_cli::connect::ServerArg;
use chefshat_cli::error::CommandError;
use chefshat_client::{Client, Error};
use chefshat_examiner::{AgentCommand, AgentProcess, Placeholders};
use chefshat_proto::v1;
use chefshat_server::host::Host;
use tokio::time::sleep;

/// Lines of the agent's output that an error shows.
const LAST_LINES: usize = 8;
/// How long an agent may take to exit after its last game.
pub(crate) const EXIT: Duration = Duration::from_secs(10);
/// How long a game may take to end after the process of its agent has exited.
pub(crate) const END: Duration = Duration::from_secs(5);
/// The same, if the process says that it has failed.
const FAILED: Duration = Duration::from_millis(500);
/// How often a record is asked for that the server does not have yet, and how long to wait between.
const ATTEMPTS: u32 = 20;
const PAUSE: Duration = Duration::from_millis(250);

/// A server, and what agents need to play there.
pub(crate) struct AgentHost {
    /// The server, if it is one of this process.
    host: Option<Host>,
    pub(crate) client: Client,
    /// `host:port` of the server, or its URL with TLS.
    pub(crate) address: String,
}

impl AgentHost {
    /// Connects to a server, or starts one for this process. Agents inherit `CHEFSHAT_TOKEN` and
    /// `CHEFSHAT_CA`.
    ///
    /// # Errors
    /// The server does not answer, or no port is free.
    pub(crate) async fn open(server: Option<&str>) -> Result<Self, CommandError> {
        let host = match server {
            Some(_) => None,
            None => Some(Host::in_memory(None).await?),
        };
        let own = host.as_ref().map(Host::url);
        let url = server.map(str::to_owned).or(own).unwrap_or_default();
        let token = env::var("CHEFSHAT_TOKEN").ok();
        let ca = env::var_os("CHEFSHAT_CA").map(Into::into);
        Ok(Self {
            client: ServerArg::new(url.clone(), token, ca).connect().await?,
            // With TLS an agent must see the scheme.
            address: url
                .trim_start_matches("http://")
                .trim_end_matches('/')
                .to_owned(),
            host,
        })
    }

    /// Starts an agent, for the room with this join code if its command mentions one.
    ///
    /// # Errors
    /// The program cannot be started.
    pub(crate) async fn start(
        &self,
        command: &AgentCommand,
        name: &str,
        code: String,
    ) -> Result<AgentProcess, CommandError> {
        let places = Placeholders {
            address: self.address.clone(),
            code,
            name: name.to_owned(),
        };
        let started = AgentProcess::start(command, &places, None).await;
        let program = command.words().first();
        Ok(started.map_err(|error| format!("{}: {error}", program.map_or("", String::as_str)))?)
    }

    /// Stops the server if it is one of this process.
    ///
    /// # Errors
    /// It failed.
    pub(crate) async fn close(self) -> Result<(), CommandError> {
        drop(self.client);
        match self.host {
            Some(host) => Ok(host.stop().await?),
            None => Ok(()),
        }
    }
}

/// The line that tells an agent which game to play, if it reads that.
pub(crate) fn game_line(address: &str, code: &str, name: &str) -> String {
    format!("{address} {code} {name}\n")
}

/// The record of a game that has ended. The server may need a moment to have it.
///
/// # Errors
/// The server does not answer, or has no such record.
pub(crate) async fn record(client: &Client, game_id: &str) -> Result<Vec<v1::RecordLine>, Error> {
    for _ in 1..ATTEMPTS {
        match client.record(game_id).await {
            Err(error) if error.reason() == Some("GAME_RUNNING") => sleep(PAUSE).await,
            record => return record,
        }
    }
    client.record(game_id).await
}

/// How long a game may take to end after its agent exited like this.
pub(crate) fn patience(status: ExitStatus) -> Duration {
    if status.success() { END } else { FAILED }
}

/// The error of an agent that exited too soon.
pub(crate) fn exited(status: ExitStatus) -> CommandError {
    format!("the agent exited before the end: {status}").into()
}

/// An error with the last lines that the agent printed.
pub(crate) async fn explained(error: CommandError, process: AgentProcess) -> CommandError {
    let lines = process.finish(LAST_LINES).await;
    if lines.is_empty() {
        return error;
    }
    let lines: String = lines.iter().map(|line| format!("\n  | {line}")).collect();
    format!("{error}; the agent's last lines:{lines}").into()
}
