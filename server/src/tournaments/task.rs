//! The task that moves one tournament: it lets the core say what follows, keeps it, and only then makes rooms for games that are called
//! and tells participants where they play. It sees that a game has ended by the room and reads what came of it from the store, so that
//! a game counts once, whenever the server ended in between.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_arena::tournament::{
    BeginProblem, Change, Ended, Entrant, Game, JoinProblem, SeatPlayed, State, Tournament,
};
use chefshat_proto::v1;
use chefshat_records::outcome;
use futures::future::join_all;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};
use tracing::{error, info, warn};

use super::Stop;
use super::hosted::{Call, Connection, Entry, Hosted, Message};
use crate::config::{MAX_NAME_CHARS, TOURNAMENT_OPEN_TIME, TOURNAMENT_RETRY};
use crate::convert;
use crate::ids::{Id, Token};
use crate::rooms::{CreateError, NewRoom, Rooms, Seating};
use crate::store::StoreError;
use crate::store::journal::{Fill, GameStart, SeatedParticipant, TournamentGame};
use crate::store::tournaments::TournamentEntry;

/// Messages that are taken before what follows from them is worked out.
const MESSAGES_AT_A_TIME: usize = 64;

/// Moves a tournament until the server ends.
pub(super) struct Task {
    hosted: Arc<Hosted>,
    rooms: Arc<Rooms>,
    /// Rows that have been kept.
    rows: u64,
    /// What is to be kept next.
    unkept: Vec<TournamentEntry>,
    /// Streams of participants, with the numbers of the connections.
    connections: BTreeMap<usize, (u64, Connection)>,
    /// Games that were called and have no room yet.
    unmade: BTreeSet<usize>,
    /// Games whose rooms were there since the server was started.
    seen: BTreeSet<usize>,
    /// Rooms that are to be closed, once it is kept that the tournament is.
    to_close: Vec<Id>,
    /// Whether something was seen to change that is not kept.
    has_changed: bool,
    /// When somebody last joined, or the server was started.
    joined_at: Instant,
    /// When rooms that could not be made are tried again.
    retry: Option<Instant>,
    /// Answers that wait for what they promise to be kept.
    replies: Vec<Box<dyn FnOnce() + Send + Sync>>,
    began: Instant,
}

impl Task {
    /// The task of a tournament of which so many rows have been kept.
    pub(super) fn new(hosted: Arc<Hosted>, rooms: Arc<Rooms>, rows: u64) -> Self {
        Self {
            hosted,
            rooms,
            rows,
            unkept: Vec::new(),
            connections: BTreeMap::new(),
            unmade: BTreeSet::new(),
            seen: BTreeSet::new(),
            to_close: Vec::new(),
            has_changed: false,
            joined_at: Instant::now(),
            retry: None,
            replies: Vec::new(),
            began: Instant::now(),
        }
    }

    /// Moves the tournament until it is over, the server ends, or its store fails.
    pub(super) async fn run(mut self, mut inbox: mpsc::Receiver<Message>, stop: Stop) {
        let rooms = Arc::clone(&self.rooms);
        let mut messages = Vec::new();
        loop {
            let changed = rooms.changed();
            tokio::pin!(changed);
            // From here on no end of a game is missed.
            changed.as_mut().enable();
            if let Err(error) = self.settle(stop.no_more_games.is_cancelled()).await {
                error!(tournament = %self.hosted.id(), %error, "the tournament stops");
                return;
            }
            if self.hosted.is_over() {
                // Whoever comes later is answered by what can be seen.
                inbox.close();
                while let Some(message) = inbox.recv().await {
                    self.answer_late(message);
                }
                return;
            }
            let wake = self
                .wake_at()
                .filter(|_| !stop.no_more_games.is_cancelled());
            let alarm = sleep_until(wake.unwrap_or(self.began));
            tokio::select! {
                () = stop.end.cancelled() => return,
                received = inbox.recv_many(&mut messages, MESSAGES_AT_A_TIME) => {
                    if received == 0 {
                        return;
                    }
                    for message in messages.drain(..) {
                        if let Err(error) = self.receive(message).await {
                            error!(tournament = %self.hosted.id(), %error, "the tournament stops");
                            return;
                        }
                    }
                }
                () = changed => {}
                () = alarm, if wake.is_some() => self.expire(),
            }
        }
    }

    fn wake_at(&self) -> Option<Instant> {
        let core = self.hosted.look(|core| core.wake_at());
        let core = core.map(|ms| self.began + Duration::from_millis(ms));
        core.into_iter()
            .chain(self.retry)
            .chain(self.open_until())
            .min()
    }

    /// When a tournament that nobody begins or joins is closed.
    fn open_until(&self) -> Option<Instant> {
        let is_open = self.hosted.look(|core| core.state() == State::Open);
        is_open.then(|| self.joined_at + TOURNAMENT_OPEN_TIME)
    }

    fn expire(&mut self) {
        if (self.open_until()).is_some_and(|until| until <= Instant::now()) {
            self.close();
        }
    }

    /// Answers somebody who came when the tournament was over.
    fn answer_late(&mut self, message: Message) {
        // Who asked may be gone.
        match message {
            Message::Join(_, reply) => drop(reply.send(Err(JoinProblem::Started))),
            Message::Begin(reply) => drop(reply.send(Err(BeginProblem::Started))),
            Message::Close(reply) => drop(reply.send(())),
            Message::Enter(_, _, connection) => drop(connection.call(Call::Over)),
            Message::Left(..) => {}
        }
    }

    fn now_ms(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    async fn receive(&mut self, message: Message) -> Result<(), StoreError> {
        match message {
            Message::Join(entry, reply) => {
                let joined = self.join(entry);
                self.replies.push(Box::new(move || {
                    let _ = reply.send(joined);
                }));
            }
            Message::Begin(reply) => {
                let begun = self.off_thread(|core| core.begin()).await?;
                let begun = begun.map(|changes| self.fold_all(changes));
                self.replies.push(Box::new(move || {
                    // Who asked may be gone.
                    let _ = reply.send(begun);
                }));
            }
            Message::Close(reply) => {
                self.close();
                self.replies.push(Box::new(move || {
                    let _ = reply.send(());
                }));
            }
            Message::Enter(participant, number, connection) => {
                self.enter(participant, number, connection);
            }
            Message::Left(participant, number) => self.left(participant, number),
        }
        Ok(())
    }

    fn join(&mut self, entry: Entry) -> Result<(usize, Token), JoinProblem> {
        let entrant = Entrant {
            name: entry.name,
            kind: convert::entrant_kind(entry.kind),
            built_in: None,
            filler: false,
            stateless: entry.stateless,
            max_games: entry.max_games,
        };
        let (change, participant) = self
            .hosted
            .look(|core| Ok((core.join(entrant)?, core.participants().len())))?;
        let token = Token::random(self.hosted.id());
        let ticket = token.hash();
        self.fold(change);
        self.joined_at = Instant::now();
        self.hosted.moving().tickets.insert(participant, ticket);
        self.unkept.push(TournamentEntry::Ticket {
            participant,
            ticket,
        });
        Ok((participant, token))
    }

    /// Closes the tournament and the rooms of its games.
    fn close(&mut self) {
        let Some(change) = self.hosted.look(|core| core.close()) else {
            return;
        };
        let playing: Vec<usize> = self.hosted.look(|core| core.playing().collect());
        self.fold(change);
        for game in playing {
            let placed = self.hosted.moving().placed.get(&game).copied();
            self.to_close.extend(placed.map(|(room, _)| room));
        }
        self.unmade.clear();
    }

    fn enter(&mut self, participant: usize, number: u64, connection: Connection) {
        if let Some((_, older)) = self.connections.remove(&participant) {
            older.call(Call::Superseded);
        }
        if self.hosted.is_over() {
            connection.call(Call::Over);
            return;
        }
        // Known before it is called: a stream takes a seat only as long as it is the newest.
        (self.hosted.moving().connected).insert(participant, number);
        let mut rooms = self.rooms_of(participant).into_iter();
        let reached = rooms.all(|room| connection.call(Call::Seat(room)));
        self.connections.insert(participant, (number, connection));
        if reached {
            (self.hosted.moving().core).set_present(participant, true);
            self.has_changed = true;
        } else {
            self.away(participant);
        }
    }

    fn left(&mut self, participant: usize, number: u64) {
        if (self.connections.get(&participant)).is_some_and(|(newest, _)| *newest == number) {
            self.away(participant);
        }
    }

    /// A participant is not to be reached any more.
    fn away(&mut self, participant: usize) {
        self.connections.remove(&participant);
        let mut moving = self.hosted.moving();
        moving.connected.remove(&participant);
        moving.core.set_present(participant, false);
        drop(moving);
        self.has_changed = true;
    }

    /// Rooms in which a participant has a seat now.
    fn rooms_of(&self, participant: usize) -> Vec<Id> {
        let moving = self.hosted.moving();
        let games = moving.core.playing().filter(|number| {
            let game = &moving.core.games()[*number];
            !self.unmade.contains(number) && plays_itself(game, participant)
        });
        games
            .filter_map(|number| moving.placed.get(&number).map(|(room, _)| *room))
            .collect()
    }

    /// Folds a change and puts it where it will be kept.
    fn fold(&mut self, change: Change) {
        let mut moving = self.hosted.moving();
        moving.core.fold(&change);
        let placed = match &change {
            Change::Called { game, .. } => Some(*game),
            _ => None,
        };
        self.unkept.push(TournamentEntry::Change(change));
        drop(moving);
        if let Some(game) = placed {
            self.place(game);
        }
    }

    fn fold_all(&mut self, changes: Vec<Change>) {
        for change in changes {
            self.fold(change);
        }
    }

    /// Gives a game a room, which is made when that is kept.
    fn place(&mut self, game: usize) {
        let (room_id, game_id) = (Id::random(), Id::random());
        let mut moving = self.hosted.moving();
        moving.placed.insert(game, (room_id, game_id));
        if let Some(deal) = moving.core.games()[game].deal {
            self.rooms.withhold(self.hosted.series(deal), true);
        }
        self.unmade.insert(game);
        self.seen.remove(&game);
        self.unkept.push(TournamentEntry::Placed {
            game,
            room_id,
            game_id,
        });
    }

    /// Does everything that follows now, and keeps it. Where there are to be no more games, what came is kept and nothing follows.
    async fn settle(&mut self, no_more_games: bool) -> Result<(), StoreError> {
        loop {
            if !no_more_games {
                self.look_at_games().await?;
                self.follow().await?;
            }
            let moved = !self.unkept.is_empty();
            if moved {
                let entries = std::mem::take(&mut self.unkept);
                let store = self.rooms.store();
                (store.append_tournament(self.hosted.id(), self.rows, entries)).await?;
                self.rows += 1;
            }
            for reply in self.replies.drain(..) {
                reply();
            }
            for room in self
                .to_close
                .drain(..)
                .filter_map(|room| self.rooms.get(room))
            {
                tokio::spawn(async move { room.give_up().await });
            }
            if moved {
                self.hosted.withhold_deals(&self.rooms);
            }
            if !no_more_games {
                self.make_rooms().await?;
            }
            if std::mem::take(&mut self.has_changed) || moved {
                self.hosted.changes.send_modify(|count| *count += 1);
            }
            if self.hosted.is_over() {
                for (_, connection) in std::mem::take(&mut self.connections).into_values() {
                    connection.call(Call::Over);
                }
            }
            if !moved {
                return Ok(());
            }
        }
    }

    /// Does what follows now. Where a round may have to be drawn it is worked out elsewhere.
    async fn follow(&mut self) -> Result<(), StoreError> {
        let now_ms = self.now_ms();
        // With nothing being played a round may be due, which takes a while to draw.
        let may_draw = self.hosted.look(|core| match core.state() {
            State::Open => core.settings().start_when_joined.is_some(),
            State::Playing => core.playing().next().is_none(),
            State::Finished | State::Closed => false,
        });
        if may_draw {
            let following = move |mut core: Tournament| {
                let mut changes = Vec::new();
                while let Some(change) = core.next(now_ms) {
                    core.fold(&change);
                    changes.push(change);
                }
                changes
            };
            let changes = self.off_thread(following).await?;
            self.fold_all(changes);
        }
        loop {
            let next = self.hosted.moving().core.next(now_ms);
            let Some(change) = next else { return Ok(()) };
            self.fold(change);
        }
    }

    /// What `work` makes of the tournament, on a thread that serves nobody. Nobody else moves it meanwhile.
    async fn off_thread<T: Send + 'static>(
        &self,
        work: impl FnOnce(Tournament) -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        let core = self.hosted.look(Tournament::clone);
        let working = tokio::task::spawn_blocking(move || work(core));
        (working.await).map_err(|error| StoreError(format!("a draw was not made: {error}")))
    }

    /// Takes in what came of games that have ended.
    async fn look_at_games(&mut self) -> Result<(), StoreError> {
        let playing: Vec<usize> = self.hosted.look(|core| core.playing().collect());
        for game in playing {
            if self.unmade.contains(&game) {
                continue;
            }
            let placed = self.hosted.moving().placed.get(&game).copied();
            let Some((room, game_id)) = placed else {
                self.place(game);
                continue;
            };
            if self.rooms.is_over(room) == Some(false) {
                self.seen.insert(game);
                continue;
            }
            match self.ended(game, room, game_id).await? {
                Some(ended) => {
                    let change = self.hosted.look(|core| core.ended(game, ended));
                    self.fold_all(change.into_iter().collect());
                }
                // The server ended before the room was made, or with it: nothing was played that could count.
                None if !self.rooms.is_shutting_down() => self.place(game),
                None => {}
            }
        }
        Ok(())
    }

    /// What came of a game whose room is over or gone; `None` if nothing did, and that was nobody's fault.
    async fn ended(&self, game: usize, room: Id, game_id: Id) -> Result<Option<Ended>, StoreError> {
        if let Some(kept) = self.rooms.store().finished(game_id).await? {
            let told = tokio::task::spawn_blocking(move || {
                let lines = convert::lines_of(&kept);
                (outcome::outcome(&lines), abort_reason(&lines))
            });
            let (outcome, reason) = told
                .await
                .map_err(|error| StoreError(format!("a record was not read: {error}")))?;
            return Ok(match (outcome, reason) {
                (Ok(outcome), _) => Some(Ended::Played {
                    shifts: outcome.shifts,
                    seats: outcome.seats.iter().map(seat_played).collect(),
                }),
                (Err(_), Some(v1::AbortReason::Shutdown)) => None,
                (Err(problem), _) => {
                    warn!(%game_id, %problem, "a game of a tournament has no result");
                    Some(Ended::Aborted)
                }
            });
        }
        let Some(handle) = self.rooms.get(room) else {
            return Ok(None);
        };
        let Ok(described) = handle.describe().await else {
            return Ok(None);
        };
        Ok(match described.abort_reason() {
            v1::AbortReason::Shutdown => None,
            // Who was there when it was given up is not known any more.
            _ if !self.seen.contains(&game) => None,
            _ => {
                let seats = self.hosted.look(|core| core.games()[game].seats.clone());
                let away = described.seats.iter().zip(seats);
                let missing = away
                    .filter(|(seat, _)| !seat.connected)
                    .map(|(_, participant)| participant)
                    .collect();
                Some(Ended::NeverStarted { missing })
            }
        })
    }

    /// Makes the rooms of games that were called, and tells their participants.
    async fn make_rooms(&mut self) -> Result<(), StoreError> {
        if self.unmade.is_empty() || self.retry.is_some_and(|retry| Instant::now() < retry) {
            return Ok(());
        }
        self.retry = None;
        let unmade: Vec<usize> = self.unmade.iter().copied().collect();
        let making = unmade.iter().map(|game| {
            let new = self.new_room(*game);
            let rooms = &self.rooms;
            async move { (*game, rooms.create(new).await) }
        });
        for (game, made) in join_all(making).await {
            match made {
                Ok(_) => {
                    self.unmade.remove(&game);
                    self.seen.insert(game);
                    self.has_changed = true;
                    self.call(game);
                }
                Err(CreateError::Store(error)) => return Err(error),
                // When the server is back, the game is given a room anew.
                Err(CreateError::ShuttingDown) => self.retry = Some(retry()),
                Err(error) => {
                    if self.retry.replace(retry()).is_none() {
                        warn!(tournament = %self.hosted.id(), %error, "games of a tournament wait");
                    }
                }
            }
        }
        Ok(())
    }

    /// Tells the participants of a game that are connected where it is played.
    fn call(&mut self, game: usize) {
        let moving = self.hosted.moving();
        let Some((room, _)) = moving.placed.get(&game).copied() else {
            return;
        };
        let called = moving.core.games()[game].clone();
        drop(moving);
        for participant in &called.seats {
            if !plays_itself(&called, *participant) {
                continue;
            }
            let connection = self.connections.get(participant);
            if connection.is_some_and(|(_, connection)| !connection.call(Call::Seat(room))) {
                self.away(*participant);
            }
        }
    }

    /// The room of a game.
    fn new_room(&self, number: usize) -> NewRoom {
        let moving = self.hosted.moving();
        let game = &moving.core.games()[number];
        let plan = &self.hosted.plan;
        let entrants = moving.core.participants();
        let mut participants = BTreeMap::new();
        let fills = game.seats.iter().enumerate();
        let fills = fills
            .map(|(seat, participant)| {
                let entrant = &entrants[*participant];
                if game.forfeited.contains(participant) {
                    return Fill::BuiltIn(plan.core.filler);
                }
                if let Some(kind) = entrant.built_in {
                    return Fill::BuiltIn(kind);
                }
                let kind = convert::participant_kind(entrant.kind);
                if let Some(ticket) = moving.tickets.get(participant) {
                    let (name, ticket) = (entrant.name.clone(), *ticket);
                    participants.insert(seat, SeatedParticipant { name, kind, ticket });
                }
                Fill::Open {
                    reserved_for: Some(kind),
                }
            })
            .collect();
        let (room_id, game_id) = moving.placed[&number];
        let place = format!(
            " · round {}, table {}, game {}",
            game.round, game.table, game.number
        );
        let space = MAX_NAME_CHARS.saturating_sub(place.chars().count());
        let name: String = self
            .hosted
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
            recorded: BTreeMap::new(),
            start: GameStart::default(),
            game_seed: self.hosted.game_seed(number, game.deal),
            seating: Some(Seating {
                game: TournamentGame {
                    tournament: self.hosted.id(),
                    series: game.deal.map(|deal| self.hosted.series(deal)),
                },
                room_id,
                game_id,
                participants,
                server_seed: game.deal.map(|deal| self.hosted.server_seed(deal)),
            }),
        }
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        let state = self.hosted.look(|core| core.state());
        info!(tournament = %self.hosted.id(), ?state, "the tournament's task has ended");
    }
}

fn retry() -> Instant {
    Instant::now() + TOURNAMENT_RETRY
}

/// Whether a participant has a seat of its own in a game.
fn plays_itself(game: &Game, participant: usize) -> bool {
    game.seats.contains(&participant) && !game.forfeited.contains(&participant)
}

fn seat_played(seat: &outcome::SeatOutcome) -> SeatPlayed {
    SeatPlayed {
        place: usize::try_from(seat.place).unwrap_or(usize::MAX),
        points: seat.points,
        substituted: seat.substituted,
        decisions: seat.decisions,
        wrong_actions: seat.wrong_actions,
        timeouts: seat.timeouts,
        decision_time_us: seat.decision_time_us,
        timed_decisions: seat.timed_decisions,
        performance_score: seat.performance_score,
    }
}

/// Why the game of a record was aborted, if it was.
fn abort_reason(lines: &[v1::RecordLine]) -> Option<v1::AbortReason> {
    use v1::game_event::Kind;
    use v1::record_line::Line;
    lines.iter().rev().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::GameAborted(aborted)) => Some(aborted.reason()),
            _ => None,
        },
        _ => None,
    })
}
