//! The games of a tournament and their rooms: a called game is assigned a room, its participants
//! are notified, and its result counts exactly once: as the room says, or, if the server was
//! restarted in between, as the store has it. The core decides when games are called and what
//! counts.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_record::outcome::{Gathering, Outcome};
use chefshat_tournament::Ended;
use tracing::warn;

use super::message::Call;
use super::task::TournamentTask;
use crate::room::GameEnd;
use crate::rooms::{NewRoom, PartOf, Seating, Withheld};
use chefshat_base::tasks::short;
use chefshat_room::ids::{GameId, Id, RoomId};
use chefshat_room::journal::{AbortReason, Fill, GameStart, SeatedParticipant, TournamentGame};
use chefshat_store::tournaments::TournamentEntry;
use chefshat_store::{StoreError, StoredGame};
use chefshat_wire::convert::MAX_NAME_CHARS;

impl TournamentTask {
    /// Assigns a room to a game. The room is created once that is committed.
    pub(super) fn place(&mut self, game: usize) {
        let (room_id, game_id) = (Id::random(), Id::random());
        if let Some(deal) = self.unit.state.core.games()[game].deal {
            self.unit
                .rooms
                .withhold(Withheld::Series(self.unit.handle.series(deal)), true);
        }
        self.without_room.insert(game);
        self.seen.remove(&game);
        self.retired.retain(|(other, _)| *other != game);
        self.unit.push(TournamentEntry::Placed {
            game,
            room_id,
            game_id,
        });
    }

    /// Counts games that have ended.
    pub(super) async fn count_ended_games(&mut self) -> Result<(), StoreError> {
        let playing: Vec<usize> = self.unit.state.core.playing().collect();
        for game in playing {
            if self.without_room.contains(&game) {
                continue;
            }
            let placed = self.unit.state.placed.get(&game).copied();
            let Some((room, game_id)) = placed else {
                self.place(game);
                continue;
            };
            if self.unit.rooms.is_unfinished(room) {
                self.seen.insert(game);
                continue;
            }
            match self.ended(game, room, game_id).await? {
                Some(ended) => {
                    let change = self.unit.state.core.ended(game, ended);
                    self.fold_all(change.into_iter().collect());
                }
                // The server ended before the room was created, or together with it: nothing that
                // counts was played.
                None if !self.unit.rooms.is_shutting_down() => self.place(game),
                None => {}
            }
        }
        Ok(())
    }

    /// The result of a game whose room is over or gone; `None` if it must be played again.
    async fn ended(
        &self,
        game: usize,
        room: RoomId,
        game_id: GameId,
    ) -> Result<Option<Ended>, StoreError> {
        match self.unit.rooms.end_of(room) {
            Some(GameEnd::Finished(Some(outcome))) => Ok(Some(played(&outcome))),
            Some(GameEnd::Aborted(reason)) => {
                Ok((reason != AbortReason::Shutdown).then_some(Ended::Aborted))
            }
            Some(GameEnd::NotDealt) => Ok(self.without_deal(game, room).await),
            // Its cards have been seen: they are not dealt again.
            Some(GameEnd::Failed) => {
                let ended = self.ended_as_stored(game, room, game_id).await?;
                Ok(ended.or(Some(Ended::Aborted)))
            }
            // Its record could not be read when it ended, or the server was restarted since.
            Some(GameEnd::Finished(None)) | None => self.ended_as_stored(game, room, game_id).await,
        }
    }

    /// The result of a game as its record says.
    async fn ended_as_stored(
        &self,
        game: usize,
        room: RoomId,
        game_id: GameId,
    ) -> Result<Option<Ended>, StoreError> {
        let id = self.unit.handle.id();
        let read = move |stored: StoredGame| {
            // An imported record with this id is not the tournament's game.
            let is_ours = (stored.tournament()).is_some_and(|game| game.tournament == id);
            is_ours.then(|| ended_in(&stored, game_id))
        };
        let unreadable = Some(Ended::Aborted);
        match self.unit.read_record(game_id, unreadable, read).await? {
            Some(ended) => Ok(ended),
            None => Ok(self.without_deal(game, room).await),
        }
    }

    /// The result of a game that ended before the deal; `None` if it must be played again.
    async fn without_deal(&self, game: usize, room: RoomId) -> Option<Ended> {
        let described = self.unit.rooms.get(room)?.describe().await.ok()?;
        match described.abort_reason() {
            v1::AbortReason::Shutdown => None,
            // The participants present at that time are unknown.
            _ if !self.seen.contains(&game) => None,
            _ => {
                let seats = self.unit.state.core.games()[game].seats.clone();
                let disconnected = described.seats.iter().zip(seats);
                let missing = disconnected
                    .filter(|(seat, _)| !seat.connected)
                    .map(|(_, participant)| participant)
                    .collect();
                Some(Ended::NeverStarted { missing })
            }
        }
    }

    /// Creates the rooms of called games and notifies their participants.
    pub(super) async fn make_rooms(&mut self) -> Result<(), StoreError> {
        // What still waits for a room has not begun, and does not in a pause.
        let needed = !self.without_room.is_empty() && !self.unit.state.core.is_paused();
        if !self.unit.retry.take(needed) {
            return Ok(());
        }
        let without_room = self.without_room.iter().copied();
        let wanted = without_room.map(|game| (game, self.new_room(game)));
        let wanted = wanted.collect();
        let rooms = self.unit.create_rooms(wanted).await?;
        for game in rooms.created {
            self.without_room.remove(&game);
            self.seen.insert(game);
            self.call(game);
        }
        // They get new ids.
        for game in rooms.taken {
            warn!(tournament = %self.unit.handle.id(), game, "the id of a game is taken");
            self.place(game);
        }
        Ok(())
    }

    /// Gives up the seats of participants who have left the tournament, or whose place somebody else
    /// has taken.
    pub(super) fn retire_seats(&mut self) {
        let core = &self.unit.state.core;
        for number in core.playing() {
            let game = &core.games()[number];
            if game.left.is_empty() || self.without_room.contains(&number) {
                continue;
            }
            let Some((room, _)) = self.unit.state.placed.get(&number) else {
                continue;
            };
            for (seat, participant) in game.seats.iter().enumerate() {
                if game.left.contains(participant)
                    && self.retired.insert((number, *participant))
                    && let Some(room) = self.unit.rooms.get(*room)
                {
                    tokio::spawn(short("one message", async move {
                        room.retire(Seat::new(seat)).await
                    }));
                }
            }
        }
    }

    /// Notifies the connected participants of a game of its room.
    fn call(&mut self, game: usize) {
        let Some((room, _)) = self.unit.state.placed.get(&game).copied() else {
            return;
        };
        let called = self.unit.state.core.games()[game].clone();
        for participant in &called.seats {
            if !called.is_played_by(*participant) {
                continue;
            }
            let connection = self.connections.get(participant);
            if connection.is_some_and(|(_, connection)| !connection.call(Call::Seat(room))) {
                self.disconnected(*participant);
            }
        }
    }

    /// The settings of the room of a game.
    fn new_room(&self, number: usize) -> NewRoom {
        let state = &self.unit.state;
        let game = &state.core.games()[number];
        let plan = &self.unit.handle.plan;
        let entrants = state.core.participants();
        let (mut participants, mut display_names) = (BTreeMap::new(), BTreeMap::new());
        let fills = game.seats.iter().enumerate();
        let fills: Vec<Fill> = fills
            .map(|(seat, participant)| {
                let entrant = &entrants[*participant];
                if game.forfeited.contains(participant) {
                    return Fill::BuiltIn(plan.core.filler);
                }
                if let Some(kind) = entrant.built_in {
                    display_names.insert(seat, entrant.name.clone());
                    return Fill::BuiltIn(kind);
                }
                let kind = entrant.kind;
                if entrant.at_table {
                    display_names.insert(seat, entrant.name.clone());
                    return Fill::AtTable(kind);
                }
                if let Some(ticket) = state.tickets.get(participant) {
                    let seated = SeatedParticipant {
                        name: entrant.name.clone(),
                        name_fingerprint: entrant.name_fingerprint.clone(),
                        kind,
                        ticket: *ticket,
                    };
                    participants.insert(seat, seated);
                }
                Fill::Open {
                    reserved_for: Some(kind),
                }
            })
            .collect();
        let physical = fills.iter().any(|fill| matches!(fill, Fill::AtTable(_)));
        let (room_id, game_id) = state.placed[&number];
        let place = format!(
            " · round {}, table {}, game {}",
            game.round, game.table, game.number
        );
        let space = MAX_NAME_CHARS.saturating_sub(place.chars().count());
        let name: String = self
            .unit
            .handle
            .header
            .settings
            .name
            .chars()
            .take(space)
            .collect();
        NewRoom {
            name: name + &place,
            rules: plan.rules,
            policy: plan.policy.clone(),
            fills,
            display_names,
            wizards: BTreeSet::new(),
            recorded: BTreeMap::new(),
            start: GameStart::default(),
            game_seed: self.unit.handle.game_seed(number, game.deal),
            physical,
            request: None,
            charged: self.unit.handle.charged,
            creator: None,
            seating: Some(Seating {
                part_of: PartOf::Tournament(TournamentGame {
                    tournament: self.unit.handle.id(),
                    series: game.deal.map(|deal| self.unit.handle.series(deal)),
                }),
                owner: self.unit.handle.room_owner(room_id),
                game_id,
                participants,
                server_seed: game.deal.map(|deal| self.unit.handle.server_seed(deal)),
            }),
        }
    }
}

/// The end of a game with a result.
fn played(outcome: &Outcome) -> Ended {
    Ended::Played {
        shifts: outcome.shifts,
        seats: outcome.seats.iter().map(|seat| seat.statistics).collect(),
    }
}

/// The result of a game as its record says; `None` if it must be played again.
fn ended_in(stored: &StoredGame, id: GameId) -> Option<Ended> {
    let (mut gathering, mut reason) = (Gathering::default(), None);
    stored.each_line(|line| {
        gathering.add(&line);
        if let Some(v1::record_line::Line::Event(event)) = &line.line
            && let Some(v1::game_event::Kind::GameAborted(aborted)) = &event.kind
        {
            reason = Some(aborted.reason());
        }
    });
    match (gathering.outcome(), reason) {
        (Ok(outcome), _) => Some(played(&outcome)),
        (Err(_), Some(v1::AbortReason::Shutdown)) => None,
        (Err(problem), _) => {
            warn!(game = %id, %problem, "a game of a tournament has no result");
            Some(Ended::Aborted)
        }
    }
}
