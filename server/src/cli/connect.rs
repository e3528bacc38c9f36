//! Reaching a server from the command line: where it is, and waiting for what is about to be there (a server that is starting, a
//! file with a join code that is being written). What is then said to the server is the commands' own.

use std::path::Path;
use std::time::Duration;

use chefshat_client::{Client, v1};
use clap::Args;
use tokio::time::{Instant, sleep};

use super::CommandError;

/// How long to wait for a server or a file that is about to be there.
pub(super) const PATIENCE: Duration = Duration::from_secs(30);
/// Time between two looks.
const PAUSE: Duration = Duration::from_millis(200);

/// Which server.
#[derive(Debug, Clone, Args)]
pub(super) struct ServerArg {
    /// Address of the server.
    #[arg(
        long,
        env = "CHEFSHAT_SERVER",
        value_name = "URL",
        default_value = "http://127.0.0.1:50051"
    )]
    server: String,
}

impl ServerArg {
    /// The address as it was given.
    pub(super) fn url(&self) -> &str {
        &self.server
    }

    /// Connects at once or not at all.
    ///
    /// # Errors
    /// Nobody answers at the address, or it is none.
    pub(super) async fn connect(&self) -> Result<Client, CommandError> {
        Client::connect(&self.server).await.map_err(|error| {
            let hint = "start one there with `chefshat serve`, or name another with --server";
            format!("{}; {hint}", error.message()).into()
        })
    }

    /// Connects, and tries again for [`PATIENCE`] while nobody answers, as when servers and clients are started together.
    ///
    /// # Errors
    /// The last failure.
    pub(super) async fn connect_patiently(&self) -> Result<Client, CommandError> {
        let give_up_at = Instant::now() + PATIENCE;
        let mut told = false;
        loop {
            match Client::connect(&self.server).await {
                Ok(client) => return Ok(client),
                Err(error) if error.reason() == Some("CONNECT_FAILED") => {
                    if Instant::now() + PAUSE > give_up_at {
                        let waited = PATIENCE.as_secs();
                        return Err(format!(
                            "{}; nobody answered there for {waited} seconds, see that `chefshat serve` is running",
                            error.message()
                        )
                        .into());
                    }
                    if !std::mem::replace(&mut told, true) {
                        let patience = PATIENCE.as_secs();
                        anstream::eprintln!(
                            "nobody answers at {} yet; trying for up to {patience} seconds",
                            self.server
                        );
                    }
                }
                Err(error) => return Err(error.message().to_owned().into()),
            }
            sleep(PAUSE).await;
        }
    }
}

/// The join code in a file, once there is one other than `last`; waits for it for [`PATIENCE`].
///
/// # Errors
/// There is none in time, or the file cannot be read.
pub(super) async fn code_in(file: &Path, last: Option<&str>) -> Result<String, CommandError> {
    let give_up_at = Instant::now() + PATIENCE;
    let mut told = false;
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
                "there was not {what} in {} for {patience} seconds; write one with `chefshat room create --code-file`",
                file.display()
            )
            .into());
        }
        if !std::mem::replace(&mut told, true) {
            anstream::eprintln!(
                "waiting for {what} in {} for up to {patience} seconds",
                file.display()
            );
        }
        sleep(PAUSE).await;
    }
}

/// How many seats of a room nobody holds yet.
pub(super) fn free_seats(room: &v1::Room) -> usize {
    let free = |seat: &&v1::Participant| seat.name.is_empty();
    room.seats.iter().filter(free).count()
}

/// What a participant says it is, on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum KindArg {
    /// A program.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
}

impl KindArg {
    /// The protocol's name for it.
    pub(super) fn kind(self) -> v1::ParticipantKind {
        match self {
            Self::Agent => v1::ParticipantKind::Agent,
            Self::Human => v1::ParticipantKind::Human,
            Self::Robot => v1::ParticipantKind::Robot,
        }
    }
}
