//! Connecting to a server: its address, waiting for a server that is starting or for a file with a
//! join code.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chefshat_client::{Backoff, Client, ConnectOptions, Error, v1};
use clap::Args;
use tokio::time::{Instant, sleep};

use super::error::tell;
use super::{CommandError, ticket_file};

/// Time to wait for a server or a file.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// The variable with a ticket.
pub(crate) const TICKET: &str = "CHEFSHAT_TICKET";
/// The variable with the ticket of a physical table.
pub(crate) const TABLE_TICKET: &str = "CHEFSHAT_TABLE_TICKET";
/// Time between two attempts.
const PAUSE: Duration = Duration::from_millis(200);
/// The client's reason if no server answers.
const CONNECT_FAILED: &str = "CONNECT_FAILED";

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

    /// The address of the server's page, which links begin with. Without a scheme, a browser would
    /// take the host for one.
    pub fn page(&self) -> String {
        let url = self.server.trim_end_matches('/');
        match url.contains("://") {
            true => url.to_owned(),
            false => format!("http://{url}"),
        }
    }

    /// The flags with which a command reaches this server, for people to type.
    pub fn flags(&self) -> String {
        let ca = self.ca.as_ref();
        let ca = ca.map_or_else(String::new, |ca| format!(" --ca {}", ca.display()));
        format!("--server {}{ca}", self.server)
    }

    /// A command for this server with a ticket, in a variable: flags show in lists of processes.
    pub fn with_ticket(&self, variable: &str, ticket: &str, command: &str) -> String {
        let there = self.flags();
        match cfg!(windows) {
            true => format!("chefshat {command} {there} --ticket {ticket}"),
            false => format!("{variable}={ticket} chefshat {command} {there}"),
        }
    }

    async fn attempt(&self) -> Result<Client, Error> {
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
            Some(CONNECT_FAILED) => {
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
        let shown = secrets.given()?;
        Ok(self.connect().await?.with_secrets(shown)?)
    }

    /// Connects with retries for [`PATIENCE`], for servers and clients that are started together.
    ///
    /// # Errors
    /// The last failure.
    pub async fn connect_patiently(&self) -> Result<Client, CommandError> {
        let is_away = |error: &Error| error.reason() == Some(CONNECT_FAILED);
        let patience = PATIENCE.as_secs();
        let notice = || {
            tell(format_args!(
                "no answer from {} yet; retrying for up to {patience} seconds",
                self.server
            ));
        };
        let connected = patiently(PAUSE, async || self.attempt().await, is_away, notice).await;
        connected.map_err(|error| match (error.message(), is_away(&error)) {
            (message, true) => format!(
                "{message}; no answer for {patience} seconds; check that `chefshat serve` is running there"
            )
            .into(),
            (message, false) => message.into(),
        })
    }
}

/// Repeats an attempt whose failure passes, for [`PATIENCE`]. `notice`: before the first repetition.
///
/// # Errors
/// The last failure.
pub(crate) async fn patiently<T, E>(
    pause: Duration,
    attempt: impl AsyncFn() -> Result<T, E>,
    passes: impl Fn(&E) -> bool,
    notice: impl FnOnce(),
) -> Result<T, E> {
    let give_up_at = Instant::now() + PATIENCE;
    let mut notice = Some(notice);
    loop {
        match attempt().await {
            Err(error) if passes(&error) && Instant::now() + pause <= give_up_at => {}
            done => return done,
        }
        if let Some(notice) = notice.take() {
            notice();
        }
        sleep(pause).await;
    }
}

/// The proof of who created a room or tournament.
#[derive(Clone, Default, Args)]
pub struct OwnerArgs {
    /// The owner token, printed by `create`. CHEFSHAT_OWNER_TOKEN does the same and does not show in
    /// lists of processes.
    #[arg(long)]
    owner_token: Option<String>,
    /// File with the owner token, written by `create --owner-file`.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
}

impl OwnerArgs {
    /// The owner token that a flag gives, if one does.
    ///
    /// # Errors
    /// The file is unreadable or empty.
    pub(crate) fn by_flag(&self) -> Result<Option<String>, CommandError> {
        if let Some(token) = self.owner_token.as_ref().filter(|it| !it.is_empty()) {
            return Ok(Some(token.clone()));
        }
        let file = self.owner_file.as_deref();
        file.map(|file| secret_in(file, "--owner-file")).transpose()
    }

    /// The owner token, if there is one: of a flag, or else of the environment.
    ///
    /// # Errors
    /// The file is unreadable or empty.
    pub(crate) fn given(&self) -> Result<Option<String>, CommandError> {
        let by_flag = self.by_flag()?;
        Ok(by_flag.or_else(|| in_environment("CHEFSHAT_OWNER_TOKEN")))
    }

    /// The owner token.
    ///
    /// # Errors
    /// There is none, or the file is unreadable or empty.
    pub fn token(&self) -> Result<String, CommandError> {
        let token = self.given()?;
        token.ok_or_else(|| "give --owner-token or --owner-file".into())
    }
}

/// The secret in a file that a flag names.
///
/// # Errors
/// The file is unreadable or empty.
pub(crate) fn secret_in(file: &Path, flag: &str) -> Result<String, CommandError> {
    let name = file.display();
    let text = std::fs::read_to_string(file);
    let text = text.map_err(|error| format!("{flag}: {name}: {error}"))?;
    match text.trim() {
        "" => Err(format!("{flag}: {name} is empty").into()),
        secret => Ok(secret.to_owned()),
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
    /// File with such a ticket. Repeatable.
    #[arg(long = "ticket-file", value_name = "FILE")]
    ticket_files: Vec<PathBuf>,
    #[command(flatten)]
    owner: OwnerArgs,
}

impl SecretArgs {
    /// The secrets that are not empty.
    fn given(&self) -> Result<Vec<String>, CommandError> {
        let tickets = self.tickets.iter().filter(|ticket| !ticket.is_empty());
        let mut secrets: Vec<String> = tickets.cloned().collect();
        for file in &self.ticket_files {
            secrets.push(secret_in(file, "--ticket-file")?);
        }
        secrets.extend(self.owner.given()?);
        Ok(secrets)
    }
}

/// Leaves out the secrets.
impl fmt::Debug for SecretArgs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} tickets, {:?}", self.tickets.len(), self.owner)
    }
}

/// How to get a seat or place.
#[derive(Debug, Args)]
#[group(required = ticket_in_environment().is_none(), multiple = true)]
pub struct JoinArgs {
    /// Join code.
    #[arg(long, conflicts_with_all = ["code_file", "ticket"])]
    code: Option<String>,
    /// File with the join code; waits until it exists.
    #[arg(long, value_name = "FILE", conflicts_with = "ticket")]
    code_file: Option<PathBuf>,
    /// Ticket to resume with: of a seat or, in `tournament join`, of a place. CHEFSHAT_TICKET does the
    /// same, unless another flag says what to join, and does not show in lists of processes.
    #[arg(long)]
    ticket: Option<String>,
    /// File that keeps the ticket, readable only by you, until the game or tournament is over, instead
    /// of printing it. If it has a ticket, that is resumed, so that the same command can be run again.
    #[arg(long, value_name = "FILE", conflicts_with = "ticket")]
    ticket_file: Option<PathBuf>,
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
        if let Some(kept) = ticket_file::kept(self.ticket_file())? {
            return Ok(Pass::Ticket(kept));
        }
        match (&self.ticket, &self.code, &self.code_file) {
            (Some(ticket), ..) => Ok(Pass::Ticket(ticket.clone())),
            (None, Some(code), _) => Ok(Pass::Code(code.clone())),
            (None, None, Some(file)) => Ok(Pass::Code(code_in(file, last).await?)),
            (None, None, None) => ticket_in_environment()
                .map(Pass::Ticket)
                .ok_or_else(|| "there is no ticket yet: give --code or --code-file".into()),
        }
    }

    /// The file that keeps the ticket, if one was named.
    pub(crate) fn ticket_file(&self) -> Option<&Path> {
        self.ticket_file.as_deref()
    }
}

/// The ticket in the environment. Read here and not by clap, for which a variable counts as much as a
/// flag: it would conflict with a code that somebody typed.
pub fn ticket_in_environment() -> Option<String> {
    in_environment(TICKET)
}

/// A variable of the environment, unless it is empty.
pub(crate) fn in_environment(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// Waits up to [`PATIENCE`] for a join code other than `last` in a file.
///
/// # Errors
/// There is none in time, or the file is unreadable.
async fn code_in(file: &Path, last: Option<&str>) -> Result<String, CommandError> {
    let (name, patience) = (file.display(), PATIENCE.as_secs());
    let (another, other) = match last {
        Some(_) => ("another", " other"),
        None => ("a", ""),
    };
    // A file without a code is waited for; one that cannot be read is an error.
    let read = async || match std::fs::read_to_string(file) {
        Ok(text) if !text.trim().is_empty() && last != Some(text.trim()) => {
            Ok(text.trim().to_owned())
        }
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Some(error)),
        _ => Err(None),
    };
    let notice = || {
        tell(format_args!(
            "waiting for {another} join code in {name} for up to {patience} seconds"
        ));
    };
    let found = patiently(PAUSE, read, Option::is_none, notice).await;
    found.map_err(|unreadable| match unreadable {
        Some(error) => format!("cannot read {name}: {error}").into(),
        None => format!(
            "there was no{other} join code in {name} for {patience} seconds; `create --code-file` of `chefshat room` or `chefshat tournament` writes one"
        )
        .into(),
    })
}

/// How long a command that follows something tries to get a lost connection back.
pub(crate) fn patience() -> Backoff {
    Backoff {
        give_up_after: PATIENCE,
        ..Backoff::default()
    }
}

/// Number of free seats of a room.
pub fn free_seats(room: &v1::Room) -> usize {
    let free = |seat: &&v1::Participant| seat.name.is_empty();
    room.seats.iter().filter(free).count()
}

/// The address of the attendant's view. Browsers send what follows the # to no server.
pub fn attendant_link(page: &str, room_id: &str, ticket: &str) -> String {
    format!("{page}/rooms/{room_id}/table#ticket={ticket}")
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn links_have_a_scheme_and_one_slash() {
        let page = |url: &str| ServerArg::new(url.to_owned(), None, None).page();
        assert_eq!(page("localhost:7"), "http://localhost:7");
        assert_eq!(page("https://chef.example/"), "https://chef.example");
        assert_eq!(page("http://[::1]:7"), "http://[::1]:7");
    }

    #[test]
    fn what_is_empty_is_not_given() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("owner");
        let by_flag = |token: &str, file: Option<&Path>| {
            let owner = OwnerArgs {
                owner_token: Some(token.to_owned()),
                owner_file: file.map(Path::to_path_buf),
            };
            owner.by_flag()
        };
        assert_eq!(by_flag("", None).expect("nothing is given"), None);
        std::fs::write(&file, "").expect("written");
        let error = by_flag("", Some(&file)).expect_err("it has no token");
        assert!(error.to_string().ends_with("owner is empty"), "{error}");
        std::fs::write(&file, "of the file\n").expect("written");
        let of_file = by_flag("", Some(&file)).expect("it can be read");
        assert_eq!(of_file.as_deref(), Some("of the file"));
        let typed = by_flag("typed", Some(&file)).expect("it is given");
        assert_eq!(typed.as_deref(), Some("typed"));
        let secrets = SecretArgs {
            tickets: vec![String::new(), "T".to_owned()],
            ticket_files: vec![file],
            owner: OwnerArgs::default(),
        };
        assert_eq!(secrets.given().expect("two"), ["T", "of the file"]);
    }

    #[tokio::test(start_paused = true)]
    async fn what_passes_is_tried_again_but_not_for_ever() {
        let (attempts, notices) = (Cell::new(0_u32), Cell::new(0));
        let after = async |failures: u32, passes: bool| {
            attempts.set(0);
            let attempt = async || {
                attempts.set(attempts.get() + 1);
                match attempts.get() > failures {
                    true => Ok(()),
                    false => Err("no"),
                }
            };
            let second = Duration::from_secs(1);
            patiently(
                second,
                attempt,
                |_| passes,
                || notices.set(notices.get() + 1),
            )
            .await
        };
        assert_eq!(after(8, true).await, Ok(()));
        assert_eq!((attempts.get(), notices.take()), (9, 1));
        assert_eq!(after(u32::MAX, true).await, Err("no"));
        assert_eq!(u64::from(attempts.get()), PATIENCE.as_secs() + 1);
        assert_eq!(after(1, false).await, Err("no"));
        assert_eq!((attempts.get(), notices.get()), (1, 1));
    }

    #[test]
    fn a_ticket_stays_out_of_lists_of_processes() {
        let server = ServerArg::new("h:1".to_owned(), None, Some(PathBuf::from("ca.pem")));
        let command = server.with_ticket(TICKET, "T", "play");
        if cfg!(unix) {
            assert_eq!(
                command,
                "CHEFSHAT_TICKET=T chefshat play --server h:1 --ca ca.pem"
            );
        }
    }
}
