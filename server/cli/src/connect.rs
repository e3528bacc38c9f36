//! Connecting to a server: its address, waiting for a server that is starting or for a file with a
//! join code.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chefshat_client::{Client, ConnectOptions, v1};
use clap::Args;
use tokio::time::{Instant, sleep};

use super::CommandError;
use super::error::tell;

/// Time to wait for a server or a file.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// Time between two attempts.
const PAUSE: Duration = Duration::from_millis(200);

/// The server, and what it takes to be let in.
#[derive(Clone, Args)]
pub struct ServerArg {
    /// Address of the server, https:// for TLS.
    #[arg(
        long,
        env = "CHEFSHAT_SERVER",
        value_name = "URL",
        default_value = "http://127.0.0.1:50051"
    )]
    server: String,
    /// Token of the server's operator, from `chefshat token create`. CHEFSHAT_TOKEN does the same and
    /// does not show in lists of processes.
    #[arg(long, env = "CHEFSHAT_TOKEN", hide_env_values = true)]
    token: Option<String>,
    /// PEM file of the certificate authorities to trust, instead of the system's.
    #[arg(long, env = "CHEFSHAT_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
}

/// Leaves out the token.
impl fmt::Debug for ServerArg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ServerArg").field(&self.server).finish()
    }
}

impl ServerArg {
    /// The server with this address.
    pub fn new(server: String, token: Option<String>, ca: Option<PathBuf>) -> Self {
        Self { server, token, ca }
    }

    /// The address as it was given.
    pub fn url(&self) -> &str {
        &self.server
    }

    async fn attempt(&self) -> Result<Client, chefshat_client::Error> {
        let options = ConnectOptions {
            token: self.token.clone().filter(|token| !token.is_empty()),
            ca: self.ca.clone(),
        };
        Client::connect_with(&self.server, &options).await
    }

    /// Connects without a retry.
    ///
    /// # Errors
    /// The server does not answer or is not trusted, or an argument is invalid.
    pub async fn connect(&self) -> Result<Client, CommandError> {
        self.attempt().await.map_err(|error| match error.reason() {
            Some("CONNECT_FAILED") => {
                let hint = "start one there with `chefshat serve`, or name another with --server";
                format!("{}; {hint}", error.message()).into()
            }
            _ => error.message().into(),
        })
    }

    /// [`connect`](Self::connect), showing secrets with every call.
    ///
    /// # Errors
    /// As [`connect`](Self::connect); a file is unreadable.
    pub async fn connect_with(&self, secrets: &SecretArgs) -> Result<Client, CommandError> {
        let shown: Vec<_> = (secrets.tickets.iter().cloned())
            .chain(secrets.owner.given()?)
            .collect();
        Ok(self.connect().await?.with_secrets(shown)?)
    }

    /// Connects with retries for [`PATIENCE`], for servers and clients that are started together.
    ///
    /// # Errors
    /// The last failure.
    pub async fn connect_patiently(&self) -> Result<Client, CommandError> {
        let give_up_at = Instant::now() + PATIENCE;
        let mut announced = false;
        loop {
            match self.attempt().await {
                Ok(client) => return Ok(client),
                Err(error) if error.reason() == Some("CONNECT_FAILED") => {
                    if Instant::now() + PAUSE > give_up_at {
                        let waited = PATIENCE.as_secs();
                        return Err(format!(
                            "{}; no answer for {waited} seconds; check that `chefshat serve` is running there",
                            error.message()
                        )
                        .into());
                    }
                    if !std::mem::replace(&mut announced, true) {
                        let patience = PATIENCE.as_secs();
                        tell(format_args!(
                            "no answer from {} yet; retrying for up to {patience} seconds",
                            self.server
                        ));
                    }
                }
                Err(error) => return Err(error.message().to_owned().into()),
            }
            sleep(PAUSE).await;
        }
    }
}

/// The proof of who created a room or tournament.
#[derive(Clone, Default, Args)]
pub struct OwnerArgs {
    /// The owner token, printed by `create`.
    #[arg(long, env = "CHEFSHAT_OWNER_TOKEN", hide_env_values = true)]
    owner_token: Option<String>,
    /// File with the owner token, written by `create --owner-file`.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
}

impl OwnerArgs {
    /// The owner token, if there is one; the file has priority over the environment.
    ///
    /// # Errors
    /// The file is unreadable.
    pub(crate) fn given(&self) -> Result<Option<String>, CommandError> {
        match &self.owner_file {
            Some(file) => std::fs::read_to_string(file)
                .map(|text| Some(text.trim().to_owned()))
                .map_err(|error| format!("--owner-file: {}: {error}", file.display()).into()),
            None => Ok(self.owner_token.clone()),
        }
    }

    /// The owner token.
    ///
    /// # Errors
    /// There is none, or the file is unreadable.
    pub fn token(&self) -> Result<String, CommandError> {
        let token = self.given()?;
        token.ok_or_else(|| "give --owner-token or --owner-file".into())
    }
}

/// Leaves out the secret.
impl fmt::Debug for OwnerArgs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("OwnerArgs").field(&self.owner_file).finish()
    }
}

/// Secrets that show unlisted and private rooms, tournaments and records.
#[derive(Clone, Default, Args)]
#[command(next_help_heading = "Unlisted and private")]
pub struct SecretArgs {
    /// Ticket of a seat, a place in a tournament or a physical table. Repeatable.
    #[arg(
        long = "ticket",
        value_name = "TICKET",
        env = "CHEFSHAT_TICKET",
        hide_env_values = true
    )]
    tickets: Vec<String>,
    #[command(flatten)]
    owner: OwnerArgs,
}

/// Leaves out the secrets.
impl fmt::Debug for SecretArgs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} tickets, {:?}", self.tickets.len(), self.owner)
    }
}

/// How to get a seat or place.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct JoinArgs {
    /// Join code.
    #[arg(long)]
    code: Option<String>,
    /// File with the join code; waits until it exists.
    #[arg(long, value_name = "FILE")]
    code_file: Option<PathBuf>,
    /// Ticket of a seat or place to resume.
    #[arg(long, env = "CHEFSHAT_TICKET", hide_env_values = true)]
    ticket: Option<String>,
}

/// How to get a seat or place.
pub enum Pass {
    /// A join code for a new one.
    Code(String),
    /// The ticket of an existing one.
    Ticket(String),
}

impl JoinArgs {
    /// Whether codes for several games can follow.
    pub fn has_code_file(&self) -> bool {
        self.code_file.is_some()
    }

    /// The join code or ticket; waits for a code in a file other than `last`.
    ///
    /// # Errors
    /// There is no code in time, or the file is unreadable.
    pub async fn pass(&self, last: Option<&str>) -> Result<Pass, CommandError> {
        match (&self.ticket, &self.code, &self.code_file) {
            (Some(ticket), ..) => Ok(Pass::Ticket(ticket.clone())),
            (None, Some(code), _) => Ok(Pass::Code(code.clone())),
            (None, None, Some(file)) => Ok(Pass::Code(code_in(file, last).await?)),
            (None, None, None) => Err("give --code, --code-file or --ticket".into()),
        }
    }
}

/// Waits up to [`PATIENCE`] for a join code other than `last` in a file.
///
/// # Errors
/// There is none in time, or the file is unreadable.
async fn code_in(file: &Path, last: Option<&str>) -> Result<String, CommandError> {
    let give_up_at = Instant::now() + PATIENCE;
    let mut announced = false;
    loop {
        match std::fs::read_to_string(file) {
            Ok(text) if !text.trim().is_empty() && last != Some(text.trim()) => {
                return Ok(text.trim().to_owned());
            }
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(format!("cannot read {}: {error}", file.display()).into()),
        }
        let patience = PATIENCE.as_secs();
        let what = match last {
            Some(_) => "another join code",
            None => "a join code",
        };
        if Instant::now() + PAUSE > give_up_at {
            return Err(format!(
                "there was no {what} in {} for {patience} seconds; `create --code-file` of `chefshat room` or `chefshat tournament` writes one",
                file.display()
            )
            .into());
        }
        if !std::mem::replace(&mut announced, true) {
            tell(format_args!(
                "waiting for {what} in {} for up to {patience} seconds",
                file.display()
            ));
        }
        sleep(PAUSE).await;
    }
}

/// Number of free seats of a room.
pub fn free_seats(room: &v1::Room) -> usize {
    let free = |seat: &&v1::Participant| seat.name.is_empty();
    room.seats.iter().filter(free).count()
}

/// The address of the attendant's view. Browsers send what follows the # to no server.
pub fn attendant_link(server: &str, room_id: &str, ticket: &str) -> String {
    let server = server.trim_end_matches('/');
    format!("{server}/rooms/{room_id}/table#ticket={ticket}")
}
