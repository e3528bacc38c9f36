//! `chefshat admin`: operates a running server. Needs a token with the role admin.

use std::process::ExitCode;

use chefshat_client::{Connection, Error};
use chefshat_proto::v1::{self, admin_service_client::AdminServiceClient};
use clap::{Args, Subcommand};
use serde_json::json;

use super::connect::ServerArg;
use super::narration::clean;
use super::numbers::counted;
use super::tournament::words::state;
use super::{CommandError, pages, say};

/// Bytes of a mebibyte.
const MIB: f64 = 1024.0 * 1024.0;

/// Operate a running server: see and disconnect clients, close rooms and tournaments, see how much is
/// stored. Needs a token with the role admin.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  chefshat token create --role admin\n  \
                  export CHEFSHAT_TOKEN=chefshat_...\n  \
                  chefshat admin clients\n  \
                  chefshat admin disconnect 17\n  \
                  chefshat admin close room 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n  \
                  chefshat admin storage --json")]
pub(super) struct AdminCommand {
    #[command(subcommand)]
    action: AdminAction,
}

#[derive(Debug, Subcommand)]
enum AdminAction {
    /// List the connected clients, one per line, longest connected first.
    Clients(Listing),
    /// Close the connection of a client, which may connect again.
    Disconnect(Disconnect),
    /// Close a room or tournament without its owner token.
    Close(Close),
    /// Show how much is stored and free.
    Storage(Listing),
}

/// A server, and the form of what it says.
#[derive(Debug, Args)]
struct Listing {
    #[command(flatten)]
    server: ServerArg,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Disconnect {
    #[command(flatten)]
    server: ServerArg,
    /// Number of the client, as `chefshat admin clients` prints it.
    client: u64,
    /// Print the result as a JSON line.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Close {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Close a room. A running game is aborted.
    Room(Closed),
    /// Close a tournament with its rooms.
    Tournament(Closed),
}

#[derive(Debug, Args)]
struct Closed {
    #[command(flatten)]
    server: ServerArg,
    /// Its id.
    id: String,
    /// Print the result as a JSON line.
    #[arg(long)]
    json: bool,
}

impl AdminCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            AdminAction::Clients(command) => return clients(&command).await,
            AdminAction::Storage(command) => storage(&command).await?,
            AdminAction::Disconnect(command) => {
                let request = v1::DisconnectClientRequest {
                    client_id: command.client,
                };
                let mut service = service(&command.server).await?;
                service.disconnect_client(request).await.map_err(refused)?;
                let client = command.client;
                match command.json {
                    true => say(json!({"event": "disconnected", "client": client}))?,
                    false => say(format_args!("client {client} is disconnected"))?,
                }
            }
            AdminAction::Close(Close {
                what: What::Room(Closed { server, id, json }),
            }) => {
                let request = v1::AdminServiceCloseRoomRequest {
                    room_id: id.clone(),
                };
                let answer =
                    (service(&server).await?.close_room(request).await).map_err(refused)?;
                match json {
                    true => say(json!({"event": "closed", "room": answer.into_inner().room}))?,
                    false => say(format_args!("room {id} is closed"))?,
                }
            }
            AdminAction::Close(Close {
                what: What::Tournament(Closed { server, id, json }),
            }) => {
                let request = v1::AdminServiceCloseTournamentRequest {
                    tournament_id: id.clone(),
                };
                let answer =
                    (service(&server).await?.close_tournament(request).await).map_err(refused)?;
                let tournament = answer.into_inner().tournament.unwrap_or_default();
                let state = state(tournament.state());
                match json {
                    true => say(json!({"event": "closed", "tournament": tournament}))?,
                    false => say(format_args!("tournament {id} is {state}"))?,
                }
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The server's service for operators.
pub(super) async fn service(
    server: &ServerArg,
) -> Result<AdminServiceClient<Connection>, CommandError> {
    Ok(AdminServiceClient::new(server.connect().await?.channel()))
}

/// A refusal, for people.
pub(super) fn refused(status: tonic::Status) -> CommandError {
    Error::from(status).into()
}

async fn clients(listing: &Listing) -> Result<ExitCode, CommandError> {
    let service = service(&listing.server).await?;
    let fetch = async |page_token| {
        let request = v1::ListClientsRequest {
            page_size: 0,
            page_token,
        };
        let page = service.clone().list_clients(request).await?.into_inner();
        Ok((page.clients, page.next_page_token))
    };
    let in_a_line = |client: &v1::ConnectedClient| {
        let token = match client.token_id.as_str() {
            "" => "no token",
            token => &clean(token, 16),
        };
        format!(
            "{:>8}  {:<24} {token:<8}  {}, {}",
            client.client_id,
            clean(&client.address, 64),
            counted(client.streams, "stream"),
            counted(client.calls, "call"),
        )
    };
    pages::print(fetch, listing.json, in_a_line, "no clients").await
}

async fn storage(listing: &Listing) -> Result<(), CommandError> {
    let mut service = service(&listing.server).await?;
    let request = v1::GetStorageRequest {};
    let storage = service.get_storage(request).await.map_err(refused)?;
    let storage = storage.into_inner();
    if listing.json {
        return say(json!(storage));
    }
    let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / MIB);
    say(format_args!("database   {}", mib(storage.database_bytes)))?;
    say(format_args!(
        "records    {} in {}",
        mib(storage.record_bytes),
        counted(storage.record_files, "file")
    ))?;
    say(format_args!("free       {}", mib(storage.free_bytes)))?;
    say(format_args!(
        "games      {} finished, {} open",
        storage.finished_games,
        counted(storage.open_rooms, "room")
    ))?;
    say(format_args!("connections {}", storage.connections))?;
    Ok(())
}
