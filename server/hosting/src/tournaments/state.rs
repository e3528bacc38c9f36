//! The state of a tournament, and what is shared besides it.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use chefshat_proto::v1;
use chefshat_tournament::{Change, State, Tournament};
use tokio::sync::Mutex as AsyncMutex;

use super::message::{Entry, JoinRefusal};
use super::shared::{AsOf, Shared};
use chefshat_base::clock::TimeOfDay;
use chefshat_room::ids::{GameId, RoomId, SecretHash, TournamentToken};
use chefshat_store::tournaments::TournamentEntry;

/// Most rooms and tournaments that are over and are read at a time.
const READ_AT_ONCE: usize = 4;

/// What all tournaments of a server share.
#[derive(Debug)]
pub struct Common {
    pub(super) now: TimeOfDay,
    /// Locked while something that is over is read.
    pub(super) reading: [AsyncMutex<()>; READ_AT_ONCE],
}

/// The state of a tournament. Its task has one with pending changes; the handle has one with only
/// committed changes, for readers.
#[derive(Debug, Clone)]
pub struct TournamentState {
    pub(crate) core: Tournament,
    /// Hashed tickets of participants; built-in ones have none.
    pub(super) tickets: BTreeMap<usize, SecretHash>,
    /// Rooms and game ids of the tournament's games.
    pub(super) placed: BTreeMap<usize, (RoomId, GameId)>,
    /// All of these game ids, those that others have replaced, too.
    pub(super) announced: HashSet<GameId>,
    /// Ids of the connections that have participants now.
    pub(super) connected: BTreeMap<usize, u64>,
}

impl TournamentState {
    /// The initial state.
    pub(super) fn new(core: Tournament) -> Self {
        Self {
            core,
            tickets: BTreeMap::new(),
            placed: BTreeMap::new(),
            announced: HashSet::new(),
            connected: BTreeMap::new(),
        }
    }

    /// The participant with this ticket, in constant time for each.
    pub(super) fn participant_of(&self, ticket: &SecretHash) -> Option<usize> {
        let mut tickets = self.tickets.iter();
        tickets
            .find(|(_, known)| known.is(ticket))
            .map(|(participant, _)| *participant)
    }

    /// The answer to an earlier request with the same id; `None` if the request is new.
    pub(super) fn joined_before(
        &self,
        entry: &Entry,
        ticket: TournamentToken,
    ) -> Option<Result<(usize, TournamentToken), JoinRefusal>> {
        let participant = self.participant_of(&ticket.hash())?;
        Some(
            match self.core.participants()[participant] == entry.entrant() {
                true => Ok((participant, ticket)),
                false => Err(JoinRefusal::RequestIdUsed),
            },
        )
    }

    /// Applies an entry of the tournament's journal.
    pub(super) fn apply(&mut self, entry: &TournamentEntry) {
        match entry {
            TournamentEntry::Change(change) => {
                match change {
                    Change::Withdrawn {
                        participant,
                        removed,
                    } if *removed || self.core.state() == State::Open => {
                        self.tickets.remove(participant);
                    }
                    Change::Replaced { participant, .. } => {
                        self.tickets.remove(participant);
                    }
                    _ => {}
                }
                self.core.fold(change);
            }
            TournamentEntry::Ticket {
                participant,
                ticket,
            } => drop(self.tickets.insert(*participant, *ticket)),
            TournamentEntry::Placed {
                game,
                room_id,
                game_id,
            } => {
                self.placed.insert(*game, (*room_id, *game_id));
                self.announced.insert(*game_id);
            }
        }
    }

    /// Sets or clears the connection of a participant. Connections are not part of the journal.
    pub(super) fn set_connection(&mut self, participant: usize, connection: Option<u64>) {
        match connection {
            Some(number) => drop(self.connected.insert(participant, number)),
            None => drop(self.connected.remove(&participant)),
        }
        self.core.set_present(participant, connection.is_some());
    }

    /// All deals that several games share.
    pub(super) fn deals(&self) -> BTreeSet<u32> {
        let games = self.core.games().iter();
        games.filter_map(|game| game.deal).collect()
    }
}

/// What readers of a tournament share besides its state: what is expensive to compute.
#[derive(Debug, Default)]
pub struct TournamentShared {
    pub(super) follower_update: Shared<AsOf<v1::FollowTournamentResponse>>,
    pub(super) results: Shared<AsOf<v1::GetTournamentResultsResponse>>,
}
