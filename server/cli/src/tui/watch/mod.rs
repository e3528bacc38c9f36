//! `chefshat watch`: shows a room live, or a finished game, in a terminal. This file finds the game
//! and runs the loop of events, keys and frames; `reel` moves through the game, `view` draws it.

mod reel;
#[cfg(test)]
mod tests;
mod view;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_client::v1::{self, record_line};
use chefshat_client::{Client, Error, Spectator, Watched};
use chefshat_record::jsonl;
use chefshat_record::replay::{ReplayError, replay};
use clap::Args;

use crate::CommandError;
use crate::connect::{SecretArgs, ServerArg, patience};
use crate::narration::story;
use crate::narration::view::GameView;
use crate::tui::screen::{Screen, Wake, missing};
use crate::tui::theme::Theme;
use reel::Reel;

/// Time between two ticks.
const TICK: Duration = Duration::from_millis(50);

/// Watch a room or a recorded game in this terminal.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat watch 5f0c6a4de2b14b7f8a3d9c1e7b60425d --server http://127.0.0.1:50051\n  \
                  chefshat watch records/229f59ae0b9ec1e5571bac0902b99674.jsonl\n\n\
                  Press ? for the keys. To follow a room as lines of text, use `chefshat room watch`."
)]
pub(crate) struct Watch {
    /// A room of the server, a game whose record the server has, or a record file.
    #[arg(value_name = "ROOM-ID|GAME-ID|FILE")]
    what: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
}

impl Watch {
    pub(crate) async fn run(self) -> Result<ExitCode, CommandError> {
        let instead = "use `chefshat room watch` to follow a room as text, `chefshat render` to draw a record";
        if let Some(code) = missing(instead) {
            return Ok(code);
        }
        let path = Path::new(&self.what);
        let is_file = path.extension().is_some_and(|it| it == "jsonl") || path.is_file();
        let (reel, live) = if is_file {
            let reel = of_record(jsonl::read(path)?);
            let reel = reel.map_err(|error| {
                format!(
                    "{}: {error}; run `chefshat verify` for details",
                    path.display()
                )
            })?;
            (reel, None)
        } else {
            let client = self.server.connect_with(&self.secrets).await?;
            self.of_server(&client).await?
        };
        show(reel, live).await
    }

    /// Finds a room to follow, or the record of a finished game, which shows all hands.
    async fn of_server(&self, client: &Client) -> Result<(Reel, Option<Spectator>), CommandError> {
        let room = match client.get_room(self.what.as_str()).await {
            Ok(room) => room,
            Err(error) if error.reason() == Some("ROOM_UNKNOWN") => {
                let lines = client.record(self.what.as_str()).await;
                let lines = lines.map_err(|error| match error.reason() {
                    Some("GAME_UNKNOWN") => CommandError::from(format!(
                        "{:?} is neither a file nor a room or game of the server; list them with `chefshat room list` and `chefshat \
                         records list`",
                        self.what
                    )),
                    _ => error.into(),
                })?;
                return Ok((of_record(lines)?, None));
            }
            Err(error) => return Err(error.into()),
        };
        if room.state() == v1::RoomState::Finished
            && let Ok(lines) = client.record(room.game_id.as_str()).await
        {
            return Ok((of_record(lines)?, None));
        }
        let spectator = client.spectate(room.room_id.as_str(), 1);
        let spectator = spectator.with_backoff(patience());
        Ok((Reel::live(GameView::of_room(&room)), Some(spectator)))
    }
}

/// Makes the reel of a record. The record is verified first: a file may contain anything.
///
/// # Errors
/// The first line that does not replay.
fn of_record(lines: Vec<v1::RecordLine>) -> Result<Reel, ReplayError> {
    replay(&lines)?;
    let mut table = GameView::default();
    let mut events = Vec::new();
    let mut hints: BTreeMap<usize, Vec<story::Line>> = BTreeMap::new();
    for line in lines {
        match line.line {
            Some(record_line::Line::Header(header)) => {
                table = GameView::of_room(&v1::Room {
                    name: header.room_name,
                    game_id: header.game_id,
                    rules: header.rules,
                    ..v1::Room::default()
                });
            }
            Some(record_line::Line::Event(event)) => events.push(event),
            Some(record_line::Line::Decision(decision)) if decision.hints > 0 => {
                let line = story::after_hints(decision.seat, decision.hints);
                hints.entry(events.len()).or_default().push(line);
            }
            _ => {}
        }
    }
    Ok(Reel::recorded(table, events, hints))
}

/// Shows the reel until the person quits.
async fn show(mut reel: Reel, mut live: Option<Spectator>) -> Result<ExitCode, CommandError> {
    let theme = Theme::of_environment();
    let mut screen = Screen::open(TICK)?;
    let mut dirty = true;
    while !reel.left {
        if std::mem::take(&mut dirty) {
            screen.draw(|frame| view::draw(frame, theme, &reel))?;
        }
        tokio::select! {
            wake = screen.next() => match wake {
                Wake::Key(key) => {
                    reel.key(key, screen.now_ms());
                    dirty = true;
                }
                Wake::Tick => dirty = reel.tick(screen.now_ms()),
            },
            event = next(&mut live) => {
                dirty = true;
                match event {
                    Some(Ok(Watched::Event(event))) => reel.push(*event),
                    Some(Ok(Watched::Snapshot(snapshot))) => reel.restore(&snapshot),
                    Some(Ok(Watched::Awaited(awaited))) => {
                        reel.wait_for(&awaited, screen.now_ms());
                    }
                    over => {
                        let why = over.and_then(Result::err);
                        reel.close(why.map(|error| error.message().to_owned()));
                        live = None;
                    }
                }
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What is learnt next of a room, or why no more follows; pending forever without one. Cancel safe.
async fn next(live: &mut Option<Spectator>) -> Option<Result<Watched, Error>> {
    match live {
        Some(spectator) => spectator.next_watched().await.transpose(),
        None => std::future::pending().await,
    }
}
