//! `chefshat watch`: a room as it is played, or a game that is over, at a terminal. This file finds out which and carries events, keys and
//! pictures to and fro; the reel that is wound is in `reel`, how it looks in `view`.

mod reel;
#[cfg(test)]
mod tests;
mod view;

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_client::v1::{self, record_line};
use chefshat_client::{Backoff, Client, Spectator};
use chefshat_record::jsonl;
use chefshat_record::replay::{ReplayError, replay};
use clap::Args;
use tokio::sync::mpsc;
use tokio::time::{Instant, MissedTickBehavior, interval};

use crate::CommandError;
use crate::connect::{PATIENCE, ServerArg};
use crate::tui::look::Look;
use crate::tui::screen::{Key, Screen, asked_to_end, missing};
use crate::tui::table::Table;
use reel::Reel;

/// Events that may wait to be shown.
const EVENTS: usize = 256;
/// How often the reel is looked at.
const TICK: Duration = Duration::from_millis(50);

/// Watch a room or a recorded game at this terminal.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat watch 5f0c6a4de2b14b7f8a3d9c1e7b60425d --server http://127.0.0.1:50051\n  \
                  chefshat watch records/229f59ae0b9ec1e5571bac0902b99674.jsonl\n\n\
                  Press ? for the keys. `chefshat room watch` tells a room as lines of text."
)]
pub(crate) struct Watch {
    /// A room of the server, the game of a record it holds, or the file of a record.
    #[arg(value_name = "ROOM-ID|GAME-ID|FILE")]
    what: String,
    #[command(flatten)]
    server: ServerArg,
}

impl Watch {
    pub(crate) async fn run(self) -> Result<ExitCode, CommandError> {
        let instead =
            "`chefshat room watch` tells a room as text, `chefshat render` draws a record";
        if let Some(code) = missing(instead) {
            return Ok(code);
        }
        let path = Path::new(&self.what);
        let is_file = path.extension().is_some_and(|it| it == "jsonl") || path.is_file();
        let (reel, live) = if is_file {
            let reel = of_record(jsonl::read(path)?);
            let reel = reel.map_err(|error| {
                format!("{}: {error}; `chefshat verify` says more", path.display())
            })?;
            (reel, None)
        } else {
            let client = self.server.connect().await?;
            self.of_server(&client).await?
        };
        show(reel, live).await
    }

    /// A room that is played, or the record of a game that is over, in which all hands can be seen.
    async fn of_server(&self, client: &Client) -> Result<(Reel, Option<Spectator>), CommandError> {
        let room = match client.get_room(self.what.as_str()).await {
            Ok(room) => room,
            Err(error) if error.reason() == Some("ROOM_UNKNOWN") => {
                let lines = client.record(self.what.as_str()).await;
                let lines = lines.map_err(|error| match error.reason() {
                    Some("GAME_UNKNOWN") => CommandError::from(format!(
                        "{:?} is no file, and on the server neither a room nor a game; `chefshat room list` and `chefshat records list` say which \
                         there are",
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
        let spectator = client
            .spectate(room.room_id.as_str(), 1)
            .with_backoff(Backoff {
                give_up_after: PATIENCE,
                ..Backoff::default()
            });
        Ok((Reel::live(Table::of_room(&room)), Some(spectator)))
    }
}

/// The reel of a record. A file can say anything: only what replays is shown.
///
/// # Errors
/// The first line that does not fit.
fn of_record(lines: Vec<v1::RecordLine>) -> Result<Reel, ReplayError> {
    replay(&lines)?;
    let mut table = Table::default();
    let mut events = Vec::new();
    for line in lines {
        match line.line {
            Some(record_line::Line::Header(header)) => {
                table = Table::of_room(&v1::Room {
                    name: header.room_name,
                    game_id: header.game_id,
                    rules: header.rules,
                    ..v1::Room::default()
                });
            }
            Some(record_line::Line::Event(event)) => events.push(event),
            _ => {}
        }
    }
    Ok(Reel::recorded(table, events))
}

/// Shows the reel until the person has seen enough.
async fn show(mut reel: Reel, live: Option<Spectator>) -> Result<ExitCode, CommandError> {
    let look = Look::of_environment();
    let begun = Instant::now();
    let now = || u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let ended = asked_to_end()?;
    tokio::pin!(ended);
    let mut following = live.map(follow);
    let mut screen = Screen::open()?;
    let mut dirty = true;
    while !reel.left {
        if std::mem::take(&mut dirty) {
            screen.draw(|frame| view::draw(frame, look, &reel))?;
        }
        tokio::select! {
            key = screen.keys.recv() => {
                reel.key(key.unwrap_or(Key::Interrupt), now());
                dirty = true;
            }
            event = next(&mut following) => {
                dirty = true;
                match event {
                    Some(Ok(event)) => reel.push(event),
                    over => {
                        let why = over.and_then(Result::err);
                        reel.close(why.map(|error| error.message().to_owned()));
                        following = None;
                    }
                }
            }
            _ = ticks.tick() => dirty = reel.tick(now()),
            _ = &mut ended => reel.key(Key::Interrupt, now()),
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// An event of a room, or why there are no more.
type Heard = Result<v1::GameEvent, chefshat_client::Error>;

/// Has a task of its own follow the room: keys and the clock would else interrupt its connecting and its waiting again and again.
fn follow(mut spectator: Spectator) -> mpsc::Receiver<Heard> {
    let (sender, heard) = mpsc::channel(EVENTS);
    tokio::spawn(async move {
        while let Some(event) = spectator.next().await.transpose() {
            let over = event.is_err();
            if sender.send(event).await.is_err() || over {
                return;
            }
        }
    });
    heard
}

/// The next event of a room; of none, never.
async fn next(following: &mut Option<mpsc::Receiver<Heard>>) -> Option<Heard> {
    match following {
        Some(heard) => heard.recv().await,
        None => std::future::pending().await,
    }
}
