//! `chefshat room`: creates, lists, shows, follows and closes rooms of a server.

mod create;
mod show;
mod start;
mod watch;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::connect::{OwnerArgs, ServerArg};
use super::{CommandError, say};

/// Create, list, watch and close rooms of a server.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat room create --name friday --seat greedy --seat random\n  \
                  chefshat room list\n  chefshat room watch ROOM-ID"
)]
pub(super) struct RoomCommand {
    #[command(subcommand)]
    action: RoomAction,
}

#[derive(Debug, Subcommand)]
enum RoomAction {
    /// Create a room and print how to join it.
    Create(Box<create::Create>),
    /// List the rooms of a server.
    List(show::List),
    /// Show one room.
    Show(show::Show),
    /// Follow the game of a room.
    Watch(watch::Watch),
    /// Close a room; a game in progress is aborted.
    Close(Close),
}

/// Close a room; a game in progress is aborted.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat room close 5f0c6a4de2b14b7f8a3d9c1e7b60425d --owner-token TOKEN"
)]
struct Close {
    /// ID of the room.
    #[arg(value_name = "ROOM-ID")]
    room_id: String,
    #[command(flatten)]
    owner: OwnerArgs,
    #[command(flatten)]
    server: ServerArg,
    /// Print the room as a JSON line.
    #[arg(long)]
    json: bool,
}

impl RoomCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            RoomAction::Create(command) => command.run().await,
            RoomAction::List(command) => command.run().await,
            RoomAction::Show(command) => command.run().await,
            RoomAction::Watch(command) => command.run().await,
            RoomAction::Close(command) => command.run().await,
        }
    }
}

impl Close {
    async fn run(self) -> Result<ExitCode, CommandError> {
        let (token, client) = (self.owner.token()?, self.server.connect().await?);
        let room = client.close_room(self.room_id, token).await?;
        if self.json {
            say(serde_json::json!({"event": "closed", "room": room}))?;
        } else {
            say(format_args!(
                "room {} is {}",
                room.room_id,
                show::state(room.state())
            ))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
