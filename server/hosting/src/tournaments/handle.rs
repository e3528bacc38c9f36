//! The handle of one tournament: what others can read of it, and messages to its task.

use std::collections::BTreeSet;

use chefshat_proto::v1;
use chefshat_record::pseudonym::Pseudonym;
use chefshat_tournament::{BeginProblem, Entrant, GameState, JoinProblem, Tournament};
use sha2::{Digest as _, Sha256};
use tokio::sync::mpsc;

use super::message::{BeginRefusal, Call, Connection, Entry, JoinRefusal, Message};
use super::state::TournamentState;
use super::task::TournamentTask;
use crate::journaled::{Handle, Stopped};
use crate::rooms::{Rooms, Withheld};
use chefshat_admission::access::{Relation, Secrets};
use chefshat_room::ids::{Id, RoomId, RoomToken, SecretHash, SeriesId, Token, TournamentToken};
use chefshat_room::journal::ParticipantKind;
use chefshat_room::policy::Visibility;
use chefshat_wire::convert::{self, Mirrored as _};
use chefshat_wire::outbox::StreamEnd;

/// Why a game has no physical table now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TableProblem {
    /// There is no such game.
    #[error("this tournament has not drawn a game with this number")]
    Unknown,
    /// The cards are dealt by the server.
    #[error("nobody plays this game at a physical table")]
    NotPhysical,
    /// It has no room yet.
    #[error("the game has not started yet; ask again when it is being played")]
    NotStarted,
    /// It is counted or void.
    #[error("the game is over")]
    Over,
}

/// A tournament of this server.
pub type TournamentHandle = Handle<TournamentTask>;

impl TournamentHandle {
    /// Its join code.
    pub fn join_code(&self) -> &str {
        &self.header.join_code
    }

    /// Renames a participant; the store must have done so. Returns whether there was one.
    pub(super) fn forget(&self, who: &Pseudonym) -> bool {
        let is_meant = |it: &Entrant| who.of.is(&it.name, &it.name_fingerprint);
        self.committed().core.rename(is_meant, &who.pseudonym)
    }

    /// Who sees it and its games.
    pub fn visibility(&self) -> Visibility {
        self.plan.policy.visibility
    }

    /// What the secrets that a caller shows make of it.
    pub fn relation(&self, secrets: &Secrets) -> Relation {
        let state = self.committed();
        let tickets = state.tickets.values().copied();
        secrets.relation(self.header.id, &self.header.owner, tickets)
    }

    /// The participant with this ticket, in constant time for each.
    pub fn participant_of(&self, secret: &[u8]) -> Option<usize> {
        self.committed().participant_of(&SecretHash::of(secret))
    }

    /// Joins; returns the participant's number and its ticket.
    ///
    /// # Errors
    /// See [`JoinRefusal`].
    pub async fn join(&self, entry: Entry) -> Result<(usize, TournamentToken), JoinRefusal> {
        // A repeated request is answered in every state of the tournament.
        let repeated = entry.request_id.and_then(|_| {
            let ticket = self.ticket_of(&entry);
            self.committed().joined_before(&entry, ticket)
        });
        if let Some(answer) = repeated {
            return answer;
        }
        match self.ask(|reply| Message::Join(entry, reply)).await {
            Err(Stopped) if self.is_over() => Err(JoinProblem::Started.into()),
            joined => joined?,
        }
    }

    /// The owner token of the room of a physical game in progress.
    ///
    /// # Errors
    /// The game has no physical table now.
    pub fn physical_room(&self, number: usize) -> Result<RoomToken, TableProblem> {
        let state = self.committed();
        let game = (state.core.games().get(number)).ok_or(TableProblem::Unknown)?;
        if !game.physical {
            return Err(TableProblem::NotPhysical);
        }
        match game.state {
            GameState::Due => Err(TableProblem::NotStarted),
            GameState::Counted(_) | GameState::Void => Err(TableProblem::Over),
            GameState::Playing => {
                let (room, _) = state.placed.get(&number).ok_or(TableProblem::NotStarted)?;
                Ok(self.room_owner(*room))
            }
        }
    }

    /// Starts it.
    ///
    /// # Errors
    /// See [`BeginRefusal`].
    pub async fn begin(&self) -> Result<(), BeginRefusal> {
        match self.ask(Message::Begin).await {
            Err(Stopped) if self.is_over() => Err(BeginProblem::Started.into()),
            started => Ok(started??),
        }
    }

    /// Closes it, unless it is over.
    ///
    /// # Errors
    /// The server ends.
    pub async fn close(&self) -> Result<(), Stopped> {
        match self.ask(Message::Close).await {
            Err(Stopped) if self.is_over() => Ok(()),
            closed => closed,
        }
    }

    /// Attaches a stream to the participant with this ticket; `number` is the id of the connection.
    pub async fn enter(
        &self,
        participant: usize,
        ticket: &TournamentToken,
        number: u64,
        connection: Connection,
    ) {
        let message = Message::Enter(participant, ticket.hash(), number, connection);
        let sent = self.mailbox.send(message).await;
        let Err(mpsc::error::SendError(Message::Enter(_, _, _, connection))) = sent else {
            return;
        };
        match self.is_over() {
            true => {
                connection.call(Call::Over);
            }
            // It resumes here or at another node, which does not know the stream.
            false => connection.outbox.end(StreamEnd::RoomGone),
        }
    }

    /// Whether this is the newest connection of the participant.
    pub fn is_newest(&self, participant: usize, number: u64) -> bool {
        self.committed().connected.get(&participant) == Some(&number)
    }

    /// Detaches the stream with this number from a participant.
    pub async fn left(&self, participant: usize, number: u64) {
        let _ = self.mailbox.send(Message::Left(participant, number)).await;
    }

    /// The ticket for a request to join.
    pub(super) fn ticket_of(&self, entry: &Entry) -> TournamentToken {
        self.ticket_with(entry.request_id.as_ref())
    }

    /// The ticket for a request with this id, or a random one.
    pub(super) fn ticket_with(&self, request_id: Option<&[u8; 32]>) -> TournamentToken {
        match request_id {
            Some(id) => Token::of_request(self.header.id, &self.header.owner, id),
            None => Token::random(self.header.id),
        }
    }

    /// Kinds that may join; empty: all.
    pub fn admits(&self, kind: ParticipantKind) -> bool {
        self.plan.kinds.is_empty() || self.plan.kinds.contains(&kind)
    }

    /// The public view of the tournament.
    pub fn describe(&self) -> v1::Tournament {
        self.described(&self.committed().core)
    }

    /// The public view without participants.
    pub fn describe_briefly(&self) -> v1::Tournament {
        self.outlined(&self.committed().core)
    }

    /// The public view of a state of the tournament.
    pub(super) fn described(&self, core: &Tournament) -> v1::Tournament {
        v1::Tournament {
            participants: convert::tournament_participants(core),
            ..self.outlined(core)
        }
    }

    fn outlined(&self, core: &Tournament) -> v1::Tournament {
        let state = core.state();
        let mut settings = self.header.settings.clone();
        if !state.is_over() {
            // With the seed, the coming draws could be computed.
            settings.draw_seed.clear();
            settings.deal_seed.clear();
        }
        v1::Tournament {
            tournament_id: self.header.id.to_string(),
            settings: Some(settings),
            state: state.to_proto().into(),
            participants: Vec::new(),
            round: core.round(),
            rounds: core.rounds(),
            games_over: convert::number(core.games_over()),
            games_playing: convert::number(core.playing().count()),
            games: convert::number(core.games_expected()),
            created_at_ms: self.header.created_at_ms,
            paused: core.is_paused(),
        }
    }

    /// At most `most` of its games from this number on, with their results.
    pub fn games(&self, from: usize, most: usize) -> Vec<v1::TournamentGame> {
        let state = self.committed();
        let numbers = (from..state.core.games().len()).take(most);
        numbers.map(|number| self.game(&state, number)).collect()
    }

    /// One of its games, as it is now.
    pub fn game_now(&self, number: usize) -> Option<v1::TournamentGame> {
        self.games(number, 1).pop()
    }

    /// One of its games, with its result.
    pub(super) fn game(&self, state: &TournamentState, number: usize) -> v1::TournamentGame {
        let game = &state.core.games()[number];
        let placed = state.placed.get(&number).copied();
        let series = game.deal.map(|deal| self.series(deal));
        convert::tournament_game(number, &state.core, placed, series, &self.plan)
    }

    /// Whether its games can count for ratings.
    pub fn is_rated(&self) -> bool {
        self.plan.deal_seed.is_none()
    }

    /// Reads the committed state of the core.
    pub fn read<T>(&self, read: impl FnOnce(&Tournament) -> T) -> T {
        read(&self.committed().core)
    }

    /// Closes the rooms that the tournament does not need: those of running games if it is over,
    /// perhaps since just before the server ended, and one that failed and was resumed.
    pub(super) fn close_rooms(&self, rooms: &Rooms) {
        let needed: BTreeSet<RoomId> = {
            let state = self.committed();
            let running = (state.core.playing()).filter(|_| !state.core.state().is_over());
            let placed = running.filter_map(|game| state.placed.get(&game));
            placed.map(|(room, _)| *room).collect()
        };
        rooms.close_all_but(self.id().unit(), &needed);
    }

    /// Withholds the records of these deals that are still to be played, and releases the others.
    pub(super) fn withhold(&self, deals: &BTreeSet<u32>, rooms: &Rooms) {
        let state = self.committed();
        let over = state.core.state().is_over();
        for &deal in deals {
            let withheld = !over && !state.core.is_deal_open(deal);
            rooms.withhold(Withheld::Series(self.series(deal)), withheld);
        }
    }

    /// The id of the series of games with this deal.
    pub(super) fn series(&self, deal: u32) -> SeriesId {
        let hash = self.of_deal(b"chefshat.v1 series", deal);
        Id::from_bytes(std::array::from_fn(|index| hash[index]))
    }

    /// The server's part of the seed of games with this deal.
    pub(super) fn server_seed(&self, deal: u32) -> [u8; 32] {
        self.of_deal(b"chefshat.v1 deal", deal)
    }

    /// The seed of a game whose deals the owner has set.
    pub(super) fn game_seed(&self, number: usize, deal: Option<u32>) -> Option<[u8; 32]> {
        let seed = self.plan.deal_seed?;
        let number = u64::try_from(number).unwrap_or(u64::MAX);
        Some(match deal {
            Some(deal) => hash(b"chefshat.v1 fixed deal", &seed, &deal.to_le_bytes()),
            None => hash(b"chefshat.v1 fixed game", &seed, &number.to_le_bytes()),
        })
    }

    fn of_deal(&self, what: &[u8], deal: u32) -> [u8; 32] {
        hash(what, &self.header.deal_secret, &deal.to_le_bytes())
    }
}

fn hash(what: &[u8], secret: &[u8; 32], number: &[u8]) -> [u8; 32] {
    let mut hash = Sha256::new();
    for part in [what, secret, number] {
        hash.update(part);
    }
    hash.finalize().into()
}
