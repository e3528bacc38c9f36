//! Runs one case, from the creation of its room to the exit of the agent's process.

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1::{self, tournament_service_client::TournamentServiceClient};
use tempfile::TempDir;
use tokio::time::{sleep, sleep_until};

use super::case::{Case, Patience, Place};
use super::exam::{Exam, Venue};
use super::fault::{Fault, Finding};
use super::process::{AgentCommand, AgentProcess, Placeholders};
use super::relay::{Desk, Port};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::{Host, HostError};
use chefshat_server::store::{OpenError, SqliteStore};

/// Name of the agent in the room.
const NAME: &str = "examined";
/// Last lines of the agent's output that are shown with a fault.
const LAST_LINES: usize = 8;
/// How long the port stays closed when the server is restarted.
const CLOSED: Duration = Duration::from_secs(2);

/// Why an examination failed for reasons other than the agent.
#[derive(Debug, thiserror::Error)]
pub enum ExaminationError {
    /// A socket or file.
    #[error("a socket or file failed: {0}")]
    Io(#[from] io::Error),
    /// A request to the server failed.
    #[error("the examiner's own server: {0}")]
    Server(#[from] chefshat_client::Error),
    /// The server did not stop cleanly.
    #[error(transparent)]
    Stopped(#[from] HostError),
    /// The database of a case could not be opened.
    #[error("the examiner's own server: {0}")]
    Store(#[from] OpenError),
    /// A response was incomplete.
    #[error("the examiner's own server did not return the room it created")]
    NoRoom,
}

/// Where a case waits for an agent that is started by hand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waiting {
    /// The examiner's address.
    pub address: SocketAddr,
    /// The join code.
    pub code: String,
}

/// The outcome of a case.
#[derive(Debug)]
pub struct Outcome {
    /// The faults found; empty if the case is passed.
    pub findings: Vec<Finding>,
    /// How long it took.
    pub took: Duration,
    /// The agent's last lines of output.
    pub last_lines: Vec<String>,
}

impl Outcome {
    /// Whether no fault was found.
    pub fn is_passed(&self) -> bool {
        self.findings.is_empty()
    }

    /// Whether other cases would fail in the same way, because there is no agent to examine.
    pub fn is_fatal(&self) -> bool {
        let hopeless = [
            Fault::CommandFailed,
            Fault::NeverJoined,
            Fault::NoPlayStream,
        ];
        (self.findings.iter()).any(|finding| hopeless.contains(&finding.fault))
    }
}

/// The server behind the examiner.
#[derive(Debug)]
struct Server {
    host: Host,
    client: Client,
    /// Where its games survive a restart; `None`: they do not.
    data: Option<TempDir>,
}

impl Server {
    async fn in_memory() -> Result<Self, ExaminationError> {
        let host = Host::in_memory(None).await?;
        let client = Client::connect(host.url()).await?;
        let data = None;
        Ok(Self { host, client, data })
    }

    async fn with_database(data: TempDir) -> Result<Self, ExaminationError> {
        let config = ServerConfig {
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        let store = SqliteStore::open(data.path()).await?;
        let host = Host::start(config, Arc::new(store)).await?;
        let client = Client::connect(host.url()).await?;
        let data = Some(data);
        Ok(Self { host, client, data })
    }

    /// Stops the server; starts another with its games, if they were stored.
    async fn restarted(self) -> Result<Self, ExaminationError> {
        let data = self.data;
        drop(self.client);
        self.host.stop().await?;
        match data {
            Some(data) => Self::with_database(data).await,
            None => Self::in_memory().await,
        }
    }
}

/// An examiner with its server.
#[derive(Debug)]
pub struct Examination {
    server: Server,
    listen: SocketAddr,
    patience: Patience,
    logs: Option<PathBuf>,
}

impl Examination {
    /// Creates an examiner that listens on `listen` (port 0: another port for each case) and writes
    /// the output of agents into the folder `logs`.
    ///
    /// # Errors
    /// Its server cannot be started.
    pub async fn new(
        listen: Option<SocketAddr>,
        patience: Patience,
        logs: Option<PathBuf>,
    ) -> Result<Self, ExaminationError> {
        Ok(Self {
            server: Server::in_memory().await?,
            listen: listen.unwrap_or(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))),
            patience,
            logs,
        })
    }

    /// Runs a case with an agent started by `command`. Without a command, calls `waiting` when an
    /// agent can be started by hand.
    ///
    /// # Errors
    /// The case could not be run.
    pub async fn examine(
        &self,
        case: &'static Case,
        command: Option<&AgentCommand>,
        waiting: impl FnOnce(&Waiting),
    ) -> Result<Outcome, ExaminationError> {
        let mut own = match case.restarts() {
            true => Some(Server::with_database(TempDir::new()?).await?),
            false => None,
        };
        let client = own.as_ref().map_or(&self.server.client, |own| &own.client);
        let Opened {
            venue,
            code,
            owner_token,
        } = self.open(client, case).await?;
        let exam = Exam::new(case, self.patience, venue.clone(), command.is_some());
        let desk = Desk::new(exam, self.patience.each);
        let mut port = Port::open(self.listen, client.channel(), Arc::clone(&desk)).await?;
        let address = port.address;
        let mut process = None;
        match command {
            None => waiting(&Waiting { address, code }),
            Some(command) => {
                let places = Placeholders {
                    address: address.to_string(),
                    code,
                    name: NAME.into(),
                };
                let log = (self.logs.as_ref()).map(|logs| logs.join(format!("{}.log", case.name)));
                match AgentProcess::start(command, &places, log).await {
                    Ok(started) => process = Some(started),
                    Err(error) => {
                        let program = command.words().first().cloned().unwrap_or_default();
                        desk.show(|exam, _| exam.not_started(&format!("{program}: {error}")));
                    }
                }
            }
        }
        while !watch(&desk, process.as_mut()).await? {
            drop(port);
            let server = own
                .take()
                .expect("only a case with its own server restarts it");
            let server = own.insert(server.restarted().await?);
            sleep(CLOSED).await;
            port = Port::open(address, server.client.channel(), Arc::clone(&desk)).await?;
            desk.show(Exam::restarted);
        }
        let mut last_lines = match process {
            Some(process) => process.finish(LAST_LINES).await,
            None => Vec::new(),
        };
        drop(port);
        match own {
            Some(own) => own.host.stop().await?,
            None => close(&self.server.client, venue, owner_token).await,
        }
        let findings = desk.lock().findings().to_vec();
        if findings.is_empty() {
            last_lines.clear();
        }
        Ok(Outcome {
            findings,
            took: desk.elapsed(),
            last_lines,
        })
    }

    /// Creates the room or tournament of a case.
    async fn open(&self, client: &Client, case: &Case) -> Result<Opened, ExaminationError> {
        match case.place {
            Place::Room(room) => {
                let mut request = room(&self.patience);
                request.name = format!("examination: {}", case.name);
                let created = client.create_room(request).await?;
                let room = created.room.ok_or(ExaminationError::NoRoom)?;
                Ok(Opened {
                    venue: Venue::Room {
                        room_id: room.room_id,
                        join_code: created.join_code.clone(),
                    },
                    code: created.join_code,
                    owner_token: created.owner_token,
                })
            }
            Place::Tournament(settings) => {
                let request = v1::CreateTournamentRequest {
                    settings: Some(settings(&self.patience)),
                    ..v1::CreateTournamentRequest::default()
                };
                let mut service = TournamentServiceClient::new(client.channel());
                let created = service.create_tournament(request).await;
                let created = created.map_err(chefshat_client::Error::from)?.into_inner();
                let tournament = created.tournament.ok_or(ExaminationError::NoRoom)?;
                Ok(Opened {
                    venue: Venue::Tournament {
                        tournament_id: tournament.tournament_id,
                    },
                    code: created.join_code,
                    owner_token: created.owner_token,
                })
            }
        }
    }

    /// Stops the examiner's server.
    ///
    /// # Errors
    /// It did not stop cleanly.
    pub async fn stop(self) -> Result<(), ExaminationError> {
        drop(self.server.client);
        Ok(self.server.host.stop().await?)
    }
}

/// The room or tournament of a case.
struct Opened {
    venue: Venue,
    code: String,
    owner_token: String,
}

/// Closes the room or tournament of a case. It may have ended already.
async fn close(client: &Client, venue: Venue, owner_token: String) {
    match venue {
        Venue::Room { room_id, .. } => {
            let _closed = client.close_room(room_id, owner_token).await;
        }
        Venue::Tournament { tournament_id } => {
            let request = v1::CloseTournamentRequest {
                tournament_id,
                owner_token,
            };
            let mut service = TournamentServiceClient::new(client.channel());
            let _closed = service.close_tournament(request).await;
        }
    }
}

/// Waits until the case is over, or the server must be restarted; returns whether it is over.
async fn watch(desk: &Desk, mut process: Option<&mut AgentProcess>) -> io::Result<bool> {
    let mut running = process.is_some();
    while !desk.lock().is_done() {
        if desk.lock().takes_restart() {
            return Ok(false);
        }
        let exited = async {
            match &mut process {
                Some(process) if running => process.ended().await,
                _ => std::future::pending().await,
            }
        };
        tokio::select! {
            () = desk.changed() => {}
            () = sleep_until(desk.wake_at()) => desk.show(Exam::tick),
            status = exited => {
                let status = status?;
                running = false;
                desk.show(|exam, _| exam.exited(status));
            }
        }
    }
    Ok(true)
}
