//! `chefshat room watch`: follows the public events of a room, as text or as JSON lines.

use std::io::Write;
use std::process::ExitCode;

use chefshat_client::v1::game_event::Kind;
use chefshat_client::{Error, Watched};
use clap::Args;
use serde::Serialize;

use super::super::CommandError;
use super::super::connect::{PATIENCE, SecretArgs, ServerArg, patience};
use super::show::beginning;
use crate::narration::{Narrator, clean, heading};

/// Follow the game of a room as text.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat room watch 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n\n\
                  Exit code: 0 when the game finished, 1 when it was aborted or the room was lost."
)]
pub(super) struct Watch {
    /// ID of the room.
    #[arg(value_name = "ROOM-ID")]
    room_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Print each event, a snapshot in place of events that are gone, and whom the game waits for when
    /// that changes, as JSON lines.
    #[arg(long)]
    json: bool,
}

impl Watch {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
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
            if let Some(words) = beginning(&room) {
                writeln!(out, "   begins {words}")?;
            }
        }
        let mut narrator = Narrator::of_room(&room);
        let spectator = client.spectate(self.room_id.clone(), 1);
        let mut spectator = spectator.with_backoff(patience());
        let mut end = None;
        loop {
            let event = match spectator.next_watched().await {
                Ok(Some(Watched::Event(event))) => *event,
                Ok(Some(Watched::Snapshot(snapshot))) => {
                    let words = || narrator.restore(&snapshot);
                    self.write(&mut out, "snapshot", "snapshot", &snapshot, words)?;
                    continue;
                }
                Ok(Some(Watched::Awaited(awaited))) => {
                    let words = || narrator.wait_for(&awaited);
                    self.write(&mut out, "awaited", "awaited", &awaited, words)?;
                    continue;
                }
                Ok(None) if end.is_some() => break,
                interrupted => {
                    if !self.json {
                        write!(out, "{}", narrator.break_off())?;
                        out.flush()?;
                    }
                    return Err(lost(interrupted.err()));
                }
            };
            match event.kind {
                Some(Kind::GameEnded(_)) => end = Some(ExitCode::SUCCESS),
                Some(Kind::GameAborted(_)) => end = Some(ExitCode::FAILURE),
                _ => {}
            }
            let words = || narrator.narrate(&event);
            self.write(&mut out, "game", "game_event", &event, words)?;
        }
        Ok(end.unwrap_or(ExitCode::FAILURE))
    }

    /// Writes what is learnt of the room at once: as a line of JSON, its event and field with the
    /// message, or in words.
    fn write(
        &self,
        out: &mut impl Write,
        event: &str,
        field: &str,
        message: &impl Serialize,
        words: impl FnOnce() -> String,
    ) -> Result<(), CommandError> {
        if self.json {
            writeln!(out, "{}", json_line(event, field, message)?)?;
        } else {
            write!(out, "{}", words())?;
        }
        out.flush()?;
        Ok(())
    }
}

/// A line of JSON. A message may have values that JSON has not, such as NaN: an error, not a panic.
fn json_line(
    event: &str,
    field: &str,
    message: &impl Serialize,
) -> serde_json::Result<serde_json::Value> {
    let message = serde_json::to_value(message)?;
    Ok(serde_json::json!({"event": event, field: message}))
}

/// Why the stream ended before the game.
fn lost(error: Option<Error>) -> CommandError {
    match error {
        // The server gave a reason.
        Some(error) if error.reason().is_some() => error.into(),
        Some(error) => {
            let patience = PATIENCE.as_secs();
            format!("the connection was lost before the game ended and not restored within {patience} seconds: {error}").into()
        }
        None => "the server ended the stream before the game ended".into(),
    }
}
