//! Tournaments and studies as stores know them: units that have a header, and rows of a journal, in
//! bytes that only their own code reads (`tournaments`, `studies`). Their games are stored as games.

use chefshat_proto::v1;
use sqlx::AssertSqlSafe;

use chefshat_room::ids::{GameId, Id, IsUnit, Study, StudyId, Tournament, TournamentId, UnitId};
use chefshat_room::journal::GameHeader;

/// What a unit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum UnitKind {
    /// A tournament, which is over at some time.
    Tournament,
    /// A study, which stays until it is deleted.
    Study,
}

impl UnitKind {
    /// The unit of this kind whose stored id has these bytes.
    pub(super) fn unit(self, id: [u8; 16]) -> UnitKey {
        match self {
            Self::Tournament => UnitKey::Tournament(Id::from_bytes(id)),
            Self::Study => UnitKey::Study(Id::from_bytes(id)),
        }
    }

    /// Its name in the plural.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Tournament => "tournaments",
            Self::Study => "studies",
        }
    }

    /// A statement about units of this kind. Its text has the names of tables and columns in braces:
    /// `{units}` with `{unit_id}`, and `{rows}` with `{unit}` and `{entries}`.
    pub(super) fn sql(self, text: &'static str) -> AssertSqlSafe<String> {
        let names = match self {
            Self::Tournament => [
                ("{units}", "tournaments"),
                ("{unit_id}", "tournament_id"),
                ("{rows}", "tournament_entries"),
                ("{unit}", "tournament"),
                ("{entries}", "entries"),
            ],
            Self::Study => [
                ("{units}", "studies"),
                ("{unit_id}", "study_id"),
                ("{rows}", "study_changes"),
                ("{unit}", "study"),
                ("{entries}", "changes"),
            ],
        };
        let named = |text: String, (place, name): (&str, &str)| text.replace(place, name);
        AssertSqlSafe(names.into_iter().fold(text.to_owned(), named))
    }
}

impl std::fmt::Display for UnitKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Tournament => "tournament",
            Self::Study => "study",
        })
    }
}

/// The header of a unit, by its id.
pub(super) const HEADER: &str = "SELECT number, form, header FROM {units} WHERE {unit_id} = $1";
/// The rows of a unit, by its number.
pub(super) const ROWS: &str = "SELECT {entries} FROM {rows} WHERE {unit} = $1 ORDER BY position";

/// The rows of a tournament with their positions, and the version of its encoding, by its number.
pub(super) const TOURNAMENT_ROWS: &str = "SELECT form, position, entries
     FROM tournaments JOIN tournament_entries ON tournament = number
     WHERE number = $1 ORDER BY position";

/// A kind of id that stores know: of tournaments or of studies.
pub trait StoredKind: IsUnit + Sized + 'static {
    /// The kind.
    const KIND: UnitKind;
    /// The unit with this id.
    fn key(id: Id<Self>) -> UnitKey;
    /// The id of a unit, if it is of this kind.
    fn id_of(unit: UnitKey) -> Option<Id<Self>>;
}

impl StoredKind for Tournament {
    const KIND: UnitKind = UnitKind::Tournament;

    fn key(id: TournamentId) -> UnitKey {
        UnitKey::Tournament(id)
    }

    fn id_of(unit: UnitKey) -> Option<TournamentId> {
        match unit {
            UnitKey::Tournament(id) => Some(id),
            UnitKey::Study(_) => None,
        }
    }
}

impl StoredKind for Study {
    const KIND: UnitKind = UnitKind::Study;

    fn key(id: StudyId) -> UnitKey {
        UnitKey::Study(id)
    }

    fn id_of(unit: UnitKey) -> Option<StudyId> {
        match unit {
            UnitKey::Study(id) => Some(id),
            UnitKey::Tournament(_) => None,
        }
    }
}

/// Which unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum UnitKey {
    /// A tournament.
    Tournament(TournamentId),
    /// A study.
    Study(StudyId),
}

impl UnitKey {
    /// The tournament or study that a game is part of, if any.
    pub fn of_game(header: &GameHeader) -> Option<Self> {
        let tournament = header.tournament.map(|game| game.tournament);
        let study = header.study.as_ref().map(|game| game.study);
        (tournament.map(Self::Tournament)).or(study.map(Self::Study))
    }

    /// Its kind.
    pub fn kind(self) -> UnitKind {
        match self {
            Self::Tournament(_) => UnitKind::Tournament,
            Self::Study(_) => UnitKind::Study,
        }
    }

    /// Its id.
    pub fn id(self) -> UnitId {
        match self {
            Self::Tournament(id) => id.unit(),
            Self::Study(id) => id.unit(),
        }
    }
}

/// What is written for a unit.
#[derive(Debug, Clone)]
pub enum UnitWrite {
    /// Creates it.
    Create {
        /// Its join code, in its normal form, if it has one.
        join_code: Option<String>,
        /// Its header.
        header: Vec<u8>,
        /// The first row of its journal, if it begins with one.
        first: Option<UnitRow>,
    },
    /// Adds a row to its journal.
    Append(UnitRow),
    /// Replaces its journal by one row, and deletes the interface traces of these participants.
    Rewrite {
        /// The entries of the row.
        entries: Vec<u8>,
        /// Numbers of participants.
        forgotten: Vec<u32>,
    },
    /// Adds interface traces to those of a participant's game.
    Traces(StoredTraces),
    /// Deletes it with its journal and interface traces, if it is there. Its games are deleted as
    /// games.
    Delete,
}

/// A row of the journal of a unit.
#[derive(Debug, Clone)]
pub struct UnitRow {
    /// Its number in the journal, from 0.
    pub position: u64,
    /// Its entries.
    pub entries: Vec<u8>,
    /// Whether the unit is over with it.
    pub over: bool,
}

/// A unit as stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredUnit {
    /// The version of the encoding.
    pub form: i64,
    /// Its header.
    pub header: Vec<u8>,
    /// The rows of its journal, in order.
    pub rows: Vec<Vec<u8>>,
}

/// Interface traces of a game.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredTraces {
    /// Number of the participant.
    pub number: u32,
    /// The game.
    pub game: GameId,
    /// Number of the session in which they were sent, from 1; 0 if it was not stored.
    pub session: u32,
    /// The traces, in order.
    pub traces: Vec<v1::StudyTrace>,
}
