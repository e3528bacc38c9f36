//! `chefshat mcp`: a Model Context Protocol server, by which language models take seats.

mod http;
mod prompt;
mod resources;
mod seat;
mod seats;
mod server;
mod tools;

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use chefshat_cli::connect::{ServerArg, ticket_in_environment};
use chefshat_cli::error::CommandError;
use chefshat_cli::name_key::NameKeyArg;
use chefshat_cli::stops::Stops;
use clap::Args;
use rmcp::ServiceExt as _;
use rmcp::service::ServerInitializeError;
use seats::{Handles, Seats};
use server::{Server, Settings};

/// Let language models play: a Model Context Protocol server.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  chefshat mcp --server http://127.0.0.1:50051 --code BCDF2345 --name Claude\n  \
                  chefshat mcp --listen 127.0.0.1:8000\n\n\
                  A client such as a desktop assistant starts this program and talks to it over standard input and output (docs/mcp.md). With \
                  --listen it serves HTTP at /mcp instead."
)]
pub(super) struct Mcp {
    #[command(flatten)]
    server: ServerArg,
    /// Join code for `join_room`, if the model gives none.
    #[arg(long)]
    code: Option<String>,
    /// Display name for `join_room`, if the model gives none.
    #[arg(long, env = "CHEFSHAT_NAME")]
    name: Option<String>,
    #[command(flatten)]
    name_key: NameKeyArg,
    /// Ticket of a seat to resume. CHEFSHAT_TICKET does the same, without --listen, and does not show in
    /// lists of processes.
    #[arg(long, conflicts_with = "listen")]
    ticket: Option<String>,
    /// File that keeps the tickets of the seats, readable only by you. Seats of games that it names are
    /// resumed, so that a client that starts again plays on.
    #[arg(long, value_name = "FILE", conflicts_with = "listen")]
    tickets: Option<PathBuf>,
    /// Serve streamable HTTP at this address instead of standard input and output. Only this
    /// computer can reach a loopback address; there is no other protection.
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// With --listen: also answer requests for this host name. By default only for localhost and the
    /// address.
    #[arg(long, value_name = "NAME", requires = "listen")]
    allow_host: Vec<String>,
    /// With --listen: let pages of this origin call. By default no page may.
    #[arg(long, value_name = "ORIGIN", requires = "listen")]
    allow_origin: Vec<String>,
}

impl Mcp {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let handles = match self.listen {
            Some(_) => Handles::Random,
            None => Handles::Counted,
        };
        let settings = Arc::new(Settings {
            seats: Seats::new(self.server, handles, self.tickets),
            join_code: self.code,
            name: self.name,
            name_key: self.name_key.key()?,
        });
        match self.listen {
            None => {
                settings.seats.resume_kept().await?;
                if let Some(ticket) = self.ticket.or_else(ticket_in_environment) {
                    settings.seats.resume(ticket).await?;
                }
                tokio::select! {
                    served = over_stdio(settings.clone()) => served?,
                    asked = asked_to_stop() => asked?,
                }
            }
            Some(address) => {
                let checks = http::Checks {
                    hosts: self.allow_host,
                    origins: self.allow_origin,
                };
                http::serve(address, checks, settings.clone(), asked_to_stop()).await?;
            }
        }
        settings.seats.leave_all().await;
        Ok(ExitCode::SUCCESS)
    }
}

/// Leaves out the ticket.
impl fmt::Debug for Mcp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Mcp").field(&self.server).finish()
    }
}

/// Serves over standard input and output until the client closes them.
async fn over_stdio(settings: Arc<Settings>) -> Result<(), CommandError> {
    let server = Server::new(settings);
    match server.serve(rmcp::transport::stdio()).await {
        Ok(running) => drop(running.waiting().await?),
        // It has asked nothing.
        Err(ServerInitializeError::ConnectionClosed(_)) => {}
        Err(error) => return Err(error.into()),
    }
    Ok(())
}

/// Waits for SIGINT or SIGTERM.
///
/// # Errors
/// The operating system has no place for the signals.
async fn asked_to_stop() -> Result<(), CommandError> {
    Stops::catch()?.next().await;
    Ok(())
}
