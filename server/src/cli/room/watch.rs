//! `chefshat room watch`: the public events of a room as they happen, told or as JSON lines.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_client::v1::game_event::Kind;
use clap::Args;

use super::super::CommandError;
use super::super::connect::ServerArg;
use super::super::narrator::{Narrator, clean, heading};

/// Follow the game of a room.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat room watch 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n\n\
                  Exit code: 0 when the game finished, 1 when it was aborted or the room was lost."
)]
pub(super) struct Watch {
    /// Which room.
    #[arg(value_name = "ROOM-ID")]
    room_id: String,
    #[command(flatten)]
    server: ServerArg,
    /// Print each event as a JSON line.
    #[arg(long)]
    json: bool,
}

impl Watch {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect().await?;
        let room = client.get_room(self.room_id.as_str()).await?;
        let mut out = anstream::stdout();
        if !self.json {
            let name = match room.name.as_str() {
                "" => "a room",
                name => name,
            };
            write!(
                out,
                "{}",
                heading(&format!("Chef's Hat · {}", clean(name, 64)))
            )?;
        }
        let mut narrator = Narrator::new();
        let mut spectator = client.spectate(self.room_id, 1);
        let mut finished = false;
        while let Some(event) = spectator.next().await? {
            finished |= matches!(event.kind, Some(Kind::GameEnded(_)));
            if self.json {
                // What came over the wire may be more than JSON can say; that is an error, not a panic.
                let game_event = serde_json::to_value(&event)?;
                let line = serde_json::json!({"event": "game", "game_event": game_event});
                writeln!(out, "{line}")?;
            } else {
                write!(out, "{}", narrator.tell(&event))?;
            }
            out.flush()?;
        }
        Ok(if finished {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }
}
