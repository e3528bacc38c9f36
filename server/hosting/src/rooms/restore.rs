//! Resumes games after a restart of the server: running games continue after their last committed
//! decision, games that have just ended are still shown to their clients, and missing records are
//! written.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::RecordedPlayer;
use chefshat_engine::RULES_VERSION;
use chefshat_record::convert::seat_number;
use chefshat_record::jsonl;
use tracing::{error, info, warn};

use super::{Entry, Rooms};
use crate::room::spawn_room;
use chefshat_admission::limits::Key;
use chefshat_base::clock::{RoomClock, millis, since_epoch_ms};
use chefshat_room::Core;
use chefshat_room::ids::GameId;
use chefshat_room::journal::Fill;
use chefshat_store::{ResumableGame, Store, StoreError};
use chefshat_wire::convert;

impl Rooms {
    /// Resumes the unfinished games of the store and returns their number. A game that cannot be
    /// resumed is logged and left unchanged.
    ///
    /// # Errors
    /// The store failed.
    pub async fn restore(&self) -> Result<usize, StoreError> {
        let ended_since_ms = since_epoch_ms().saturating_sub(millis(self.context.retention));
        // Before any room could write its record at the same time. Other servers that only write
        // records may share the folder.
        if self.context.store.outlives_server()
            && let Some(data_dir) = self.context.record_writer.data_dir()
            && let Err(error) = jsonl::remove_unfinished(data_dir)
        {
            error!(%error, "removing unfinished record files failed");
        }
        let without_record_file = self.context.store.without_record_file().await?;
        let games = self.context.store.resumable_games(ended_since_ms).await?;
        let restored = self.resume_all(games).await;
        if restored > 0 {
            info!(games = restored, "games resumed");
        }
        for game in without_record_file {
            self.context.record_writer.write_record(game, Key::Resumed);
        }
        Ok(restored)
    }

    /// Resumes games and returns how many are not over. One that cannot be resumed is logged and left
    /// unchanged.
    pub async fn resume_all(&self, games: Vec<ResumableGame>) -> usize {
        let mut players = Players::default();
        let mut resumed = 0;
        for game in games {
            let id = game.header.game_id;
            let goes_on = !game.concluded;
            match self.resume(game, &mut players, true).await {
                Ok(()) => resumed += usize::from(goes_on),
                Err(problem) => {
                    error!(game = %id, %problem, "a game cannot be resumed; it is left unchanged");
                }
            }
        }
        resumed
    }

    /// Shows the end of a game whose node is gone, because somebody asked for its room. Other rooms
    /// that are over make space for it. It is in no list: others may show it too.
    pub async fn show_ended(&self, game: ResumableGame) {
        let (room, id) = (game.header.room_id, game.header.game_id);
        {
            let mut table = self.lock();
            // What stopped here before its end was known.
            if let Some(number) = table.number_of(room) {
                table.remove(number);
            }
            table.make_space(self.max_rooms);
        }
        if let Err(problem) = self.resume(game, &mut Players::default(), false).await {
            error!(game = %id, %problem, "the end of a game cannot be shown");
        }
    }

    async fn resume(
        &self,
        game: ResumableGame,
        players: &mut Players,
        listed: bool,
    ) -> Result<(), String> {
        let mut header = game.header;
        if header.rules_version != RULES_VERSION {
            return Err(format!(
                "it uses version {} of the rules; this version of chefshat supports version {RULES_VERSION}",
                header.rules_version
            ));
        }
        header.recorded = players.of(&self.context.store, &header.fills).await;
        let header = Arc::new(header);
        let since_created = since_epoch_ms().saturating_sub(header.created_at_ms);
        let last = game.entries.last().map_or(Duration::ZERO, |entry| entry.at);
        // A system clock that was set back does not make the room younger than its journal.
        let age = Duration::from_millis(since_created).max(last);
        // A long game takes a while, and others are played meanwhile.
        let (revived, entries) = (Arc::clone(&header), game.entries);
        let reviving = move || Core::revived(revived, &entries, age);
        let core = tokio::task::spawn_blocking(reviving)
            .await
            .map_err(|problem| problem.to_string())?
            .map_err(|problem| problem.to_string())?;
        let clock = RoomClock::of_age(age, &self.context.process_clock);
        let mut table = self.lock();
        if table.get(header.room_id).is_some() {
            // A node shows the end of a game that it has played and resumes the rest of its unit.
            return Ok(());
        }
        let over_since = game.concluded.then_some(age);
        let handle = spawn_room(core, clock, over_since, game.journal, self.context.clone());
        table.enter(Entry {
            handle,
            header,
            durable: true,
            over: game.concluded,
            end: None,
            suspended: false,
            listed,
            place: None,
        });
        Ok(())
    }
}

/// Recorded players that have been read: one may play in many rooms.
#[derive(Default)]
struct Players(HashMap<(GameId, u32), Option<Arc<RecordedPlayer>>>);

impl Players {
    /// The recorded players of seats that replay one. If a record is gone, the policy's substitute
    /// plays.
    async fn of(
        &mut self,
        store: &Arc<dyn Store>,
        fills: &[Fill],
    ) -> BTreeMap<usize, Arc<RecordedPlayer>> {
        let mut players = BTreeMap::new();
        for (index, fill) in fills.iter().enumerate() {
            let Fill::Replay(recorded) = fill else {
                continue;
            };
            let key = (recorded.game, seat_number(recorded.seat));
            let known = self.0.get(&key).cloned();
            let player = match known {
                Some(player) => player,
                None => {
                    let player = read(store, key).await.map_err(|problem| {
                        warn!(game = %recorded.game, problem, "a recorded player cannot be read; the substitute plays");
                    });
                    self.0.insert(key, player.clone().ok());
                    player.ok()
                }
            };
            players.extend(player.map(|player| (index, player)));
        }
        players
    }
}

async fn read(
    store: &Arc<dyn Store>,
    (game, seat): (GameId, u32),
) -> Result<Arc<RecordedPlayer>, String> {
    let stored = (store.finished(game).await)
        .map_err(|error| error.to_string())?
        .ok_or("the record does not exist")?;
    let reading = move || convert::recorded_player(&stored.lines(), seat);
    tokio::task::spawn_blocking(reading)
        .await
        .map_err(|error| error.to_string())?
        .map_err(|error| error.to_string())
}
