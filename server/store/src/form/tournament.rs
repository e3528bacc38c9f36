//! Headers and journals of tournaments.
//!
//! Entries have forms of their own: those of the server stand between changes of the core, whose
//! numbers are indices, and whose agents, kinds and statistics are types of other crates.

use chefshat_proto::v1;
use chefshat_tournament::{Change, Entrant, GameResult, SeatResult, SeatStatistics};
use prost::Message;

use super::entry::{KINDS, number_of, value_of};
use super::{Unreadable, array, read_messages};
use crate::error::StoreError;
use crate::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use crate::units::{StoredUnit, UnitKey};
use chefshat_room::ids::{Id, SecretHash, TournamentId};

#[derive(Clone, PartialEq, Message)]
struct HeaderForm {
    #[prost(bytes = "vec", tag = "1")]
    id: Vec<u8>,
    #[prost(message, optional, tag = "2")]
    settings: Option<v1::TournamentSettings>,
    #[prost(uint64, tag = "3")]
    created_at_ms: u64,
    #[prost(string, tag = "4")]
    join_code: String,
    #[prost(bytes = "vec", tag = "5")]
    owner: Vec<u8>,
    #[prost(bytes = "vec", tag = "6")]
    deal_secret: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct EntryForm {
    #[prost(
        oneof = "KindForm",
        tags = "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16"
    )]
    kind: Option<KindForm>,
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum KindForm {
    #[prost(message, tag = "1")]
    Joined(EntrantForm),
    #[prost(message, tag = "2")]
    Ticket(TicketForm),
    #[prost(uint32, tag = "3")]
    Begun(u32),
    #[prost(message, tag = "4")]
    Drawn(DrawnForm),
    #[prost(message, tag = "5")]
    Called(GameForm),
    #[prost(message, tag = "6")]
    Placed(PlacedForm),
    #[prost(message, tag = "7")]
    Rescheduled(RescheduledForm),
    #[prost(message, tag = "8")]
    Counted(CountedForm),
    #[prost(uint64, tag = "9")]
    Voided(u64),
    #[prost(bool, tag = "10")]
    Finished(bool),
    #[prost(bool, tag = "11")]
    Closed(bool),
    #[prost(message, tag = "12")]
    Withdrawn(WithdrawnForm),
    #[prost(message, tag = "13")]
    Replaced(ReplacedForm),
    /// Paused, or resumed.
    #[prost(bool, tag = "14")]
    Paused(bool),
    /// A game, and the participant who postponed it, if one did.
    #[prost(message, tag = "15")]
    Postponed(GameForm),
    #[prost(uint64, tag = "16")]
    Recalled(u64),
}

/// Whether these bytes are an entry of a kind that this version knows.
#[cfg(test)]
pub(super) fn is_known(bytes: &[u8]) -> bool {
    EntryForm::decode(bytes).is_ok_and(|entry| entry.kind.is_some())
}

#[derive(Clone, PartialEq, Message)]
struct WithdrawnForm {
    #[prost(uint64, tag = "1")]
    participant: u64,
    #[prost(bool, tag = "2")]
    removed: bool,
}

#[derive(Clone, PartialEq, Message)]
struct ReplacedForm {
    #[prost(uint64, tag = "1")]
    participant: u64,
    #[prost(message, optional, tag = "2")]
    by: Option<EntrantForm>,
}

#[derive(Clone, PartialEq, Message)]
struct EntrantForm {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(uint32, tag = "2")]
    kind: u32,
    #[prost(string, tag = "3")]
    built_in: String,
    #[prost(bool, tag = "4")]
    filler: bool,
    #[prost(bool, tag = "5")]
    stateless: bool,
    #[prost(uint64, tag = "6")]
    max_games: u64,
    #[prost(bool, tag = "7")]
    at_table: bool,
    #[prost(string, tag = "8")]
    name_fingerprint: String,
}

#[derive(Clone, PartialEq, Message)]
struct TicketForm {
    #[prost(uint64, tag = "1")]
    participant: u64,
    #[prost(bytes = "vec", tag = "2")]
    ticket: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct DrawnForm {
    #[prost(uint32, tag = "1")]
    round: u32,
    #[prost(message, repeated, tag = "2")]
    tables: Vec<GameForm>,
    #[prost(uint64, repeated, tag = "3")]
    byes: Vec<u64>,
}

/// A number and participants: a game and its absent participants, or a table (without a number) and
/// its participants.
#[derive(Clone, PartialEq, Message)]
struct GameForm {
    #[prost(uint64, tag = "1")]
    game: u64,
    #[prost(uint64, repeated, tag = "2")]
    participants: Vec<u64>,
}

#[derive(Clone, PartialEq, Message)]
struct RescheduledForm {
    #[prost(uint64, tag = "1")]
    game: u64,
    #[prost(uint64, repeated, tag = "2")]
    missing: Vec<u64>,
    /// Earlier versions did not store it.
    #[prost(bool, tag = "3")]
    never_started: bool,
}

#[derive(Clone, PartialEq, Message)]
struct PlacedForm {
    #[prost(uint64, tag = "1")]
    game: u64,
    #[prost(bytes = "vec", tag = "2")]
    room_id: Vec<u8>,
    #[prost(bytes = "vec", tag = "3")]
    game_id: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct CountedForm {
    #[prost(uint64, tag = "1")]
    game: u64,
    #[prost(uint32, tag = "2")]
    shifts: u32,
    #[prost(message, repeated, tag = "3")]
    seats: Vec<SeatForm>,
}

#[derive(Clone, PartialEq, Message)]
struct SeatForm {
    #[prost(uint64, tag = "1")]
    participant: u64,
    #[prost(bool, tag = "2")]
    forfeited: bool,
    #[prost(bool, tag = "3")]
    substituted: bool,
    #[prost(uint64, tag = "4")]
    place: u64,
    #[prost(uint32, tag = "5")]
    score: u32,
    #[prost(uint64, tag = "6")]
    points: u64,
    #[prost(uint64, tag = "7")]
    decisions: u64,
    #[prost(uint64, tag = "8")]
    wrong_actions: u64,
    #[prost(uint64, tag = "9")]
    timeouts: u64,
    #[prost(uint64, tag = "10")]
    decision_time_us: u64,
    #[prost(uint64, tag = "11")]
    timed_decisions: u64,
    #[prost(double, tag = "12")]
    performance_score: f64,
    #[prost(bool, tag = "13")]
    hinted: bool,
}

impl TournamentHeader {
    /// Its encoding.
    pub fn to_bytes(&self) -> Vec<u8> {
        HeaderForm {
            id: self.id.bytes().to_vec(),
            settings: Some(self.settings.clone()),
            created_at_ms: self.created_at_ms,
            join_code: self.join_code.clone(),
            owner: self.owner.bytes().to_vec(),
            deal_secret: self.deal_secret.to_vec(),
        }
        .encode_to_vec()
    }
}

/// Decodes a header.
///
/// # Errors
/// An invalid field.
pub(crate) fn tournament_from_bytes(bytes: &[u8]) -> Result<TournamentHeader, Unreadable> {
    let form = HeaderForm::decode(bytes)?;
    Ok(TournamentHeader {
        id: Id::from_bytes(array(&form.id, "the tournament's id")?),
        settings: form.settings.unwrap_or_default(),
        created_at_ms: form.created_at_ms,
        join_code: form.join_code,
        owner: SecretHash::from_bytes(array(&form.owner, "the owner's hash")?),
        deal_secret: array(&form.deal_secret, "the secret of the deals")?,
    })
}

impl TournamentEntry {
    /// The encoding of entries.
    pub fn to_bytes(entries: &[Self]) -> Vec<u8> {
        let mut out = Vec::new();
        for entry in entries {
            let kind = Some(kind_of(entry));
            (EntryForm { kind }.encode_length_delimited(&mut out))
                .expect("a vector grows as needed");
        }
        out
    }
}

/// Decodes entries.
///
/// # Errors
/// An invalid entry.
pub(crate) fn tournament_entries_from_bytes(
    bytes: &[u8],
) -> Result<Vec<TournamentEntry>, Unreadable> {
    read_messages(bytes, |form: EntryForm| {
        entry_of((form.kind).ok_or_else(|| Unreadable::new("an entry is empty"))?)
    })
}

impl StoredTournament {
    /// Decodes a tournament.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn decode(id: TournamentId, unit: &StoredUnit) -> Result<Self, StoreError> {
        Self::readable(unit).map_err(|problem| UnitKey::Tournament(id).unreadable(&problem))
    }

    pub(super) fn readable(unit: &StoredUnit) -> Result<Self, Unreadable> {
        let (header, entries) =
            unit.decode(tournament_from_bytes, tournament_entries_from_bytes)?;
        Ok(Self {
            header,
            entries,
            rows: unit.rows.len() as u64,
        })
    }
}

fn kind_of(entry: &TournamentEntry) -> KindForm {
    match entry {
        TournamentEntry::Ticket {
            participant,
            ticket,
        } => KindForm::Ticket(TicketForm {
            participant: wide(*participant),
            ticket: ticket.bytes().to_vec(),
        }),
        TournamentEntry::Placed {
            game,
            room_id,
            game_id,
        } => KindForm::Placed(PlacedForm {
            game: wide(*game),
            room_id: room_id.bytes().to_vec(),
            game_id: game_id.bytes().to_vec(),
        }),
        TournamentEntry::Change(change) => match change {
            Change::Joined(entrant) => KindForm::Joined(entrant_to_form(entrant)),
            Change::Begun { rounds } => KindForm::Begun(*rounds),
            Change::Drawn {
                round,
                tables,
                byes,
            } => KindForm::Drawn(DrawnForm {
                round: *round,
                tables: tables.iter().map(|table| game_form(0, table)).collect(),
                byes: byes.iter().map(|participant| wide(*participant)).collect(),
            }),
            Change::Called { game, forfeited } => KindForm::Called(game_form(*game, forfeited)),
            Change::Rescheduled {
                game,
                missing,
                never_started,
            } => KindForm::Rescheduled(RescheduledForm {
                game: wide(*game),
                missing: missing.iter().map(|number| wide(*number)).collect(),
                never_started: *never_started,
            }),
            Change::Counted { game, result } => KindForm::Counted(CountedForm {
                game: wide(*game),
                shifts: result.shifts,
                seats: result.seats.iter().map(seat_to_form).collect(),
            }),
            Change::Voided { game } => KindForm::Voided(wide(*game)),
            Change::Finished => KindForm::Finished(true),
            Change::Closed => KindForm::Closed(true),
            Change::Withdrawn {
                participant,
                removed,
            } => KindForm::Withdrawn(WithdrawnForm {
                participant: wide(*participant),
                removed: *removed,
            }),
            Change::Replaced { participant, by } => KindForm::Replaced(ReplacedForm {
                participant: wide(*participant),
                by: Some(entrant_to_form(by)),
            }),
            Change::Paused => KindForm::Paused(true),
            Change::Resumed => KindForm::Paused(false),
            Change::Postponed { game, by } => {
                KindForm::Postponed(game_form(*game, &Vec::from_iter(*by)))
            }
            Change::Recalled { game } => KindForm::Recalled(wide(*game)),
        },
    }
}

fn entry_of(kind: KindForm) -> Result<TournamentEntry, Unreadable> {
    Ok(TournamentEntry::Change(match kind {
        KindForm::Ticket(form) => {
            return Ok(TournamentEntry::Ticket {
                participant: narrow(form.participant)?,
                ticket: SecretHash::from_bytes(array(&form.ticket, "a ticket's hash")?),
            });
        }
        KindForm::Placed(form) => {
            return Ok(TournamentEntry::Placed {
                game: narrow(form.game)?,
                room_id: Id::from_bytes(array(&form.room_id, "a room's id")?),
                game_id: Id::from_bytes(array(&form.game_id, "a game's id")?),
            });
        }
        KindForm::Joined(form) => Change::Joined(entrant_from_form(form)?),
        KindForm::Begun(rounds) => Change::Begun { rounds },
        KindForm::Drawn(form) => Change::Drawn {
            round: form.round,
            tables: (form.tables.iter())
                .map(|table| numbers(&table.participants))
                .collect::<Result<_, _>>()?,
            byes: numbers(&form.byes)?,
        },
        KindForm::Called(form) => Change::Called {
            game: narrow(form.game)?,
            forfeited: numbers(&form.participants)?,
        },
        KindForm::Rescheduled(form) => Change::Rescheduled {
            game: narrow(form.game)?,
            missing: numbers(&form.missing)?,
            never_started: form.never_started,
        },
        KindForm::Counted(form) => Change::Counted {
            game: narrow(form.game)?,
            result: GameResult {
                shifts: form.shifts,
                seats: (form.seats.into_iter())
                    .map(seat_from_form)
                    .collect::<Result<_, _>>()?,
            },
        },
        KindForm::Voided(game) => Change::Voided {
            game: narrow(game)?,
        },
        KindForm::Finished(_) => Change::Finished,
        KindForm::Closed(_) => Change::Closed,
        KindForm::Withdrawn(form) => Change::Withdrawn {
            participant: narrow(form.participant)?,
            removed: form.removed,
        },
        KindForm::Replaced(form) => Change::Replaced {
            participant: narrow(form.participant)?,
            by: entrant_from_form(
                (form.by).ok_or_else(|| Unreadable::new("nobody takes a place"))?,
            )?,
        },
        KindForm::Paused(true) => Change::Paused,
        KindForm::Paused(false) => Change::Resumed,
        KindForm::Postponed(form) => Change::Postponed {
            game: narrow(form.game)?,
            by: (form.participants.first())
                .map(|participant| narrow(*participant))
                .transpose()?,
        },
        KindForm::Recalled(game) => Change::Recalled {
            game: narrow(game)?,
        },
    }))
}

fn entrant_to_form(entrant: &Entrant) -> EntrantForm {
    EntrantForm {
        name: entrant.name.clone(),
        kind: number_of(&KINDS, &entrant.kind),
        built_in: (entrant.built_in).map_or_else(String::new, |agent| agent.name()),
        filler: entrant.filler,
        stateless: entrant.stateless,
        max_games: wide(entrant.max_games),
        at_table: entrant.at_table,
        name_fingerprint: entrant.name_fingerprint.clone(),
    }
}

fn entrant_from_form(form: EntrantForm) -> Result<Entrant, Unreadable> {
    Ok(Entrant {
        kind: value_of(&KINDS, form.kind, "kind of participant")?,
        built_in: match form.built_in.as_str() {
            "" => None,
            name => Some((name.parse()).map_err(|error| Unreadable::new(format!("{error}")))?),
        },
        name: form.name,
        filler: form.filler,
        stateless: form.stateless,
        max_games: narrow(form.max_games)?,
        at_table: form.at_table,
        name_fingerprint: form.name_fingerprint,
    })
}

fn seat_to_form(seat: &SeatResult) -> SeatForm {
    SeatForm {
        participant: wide(seat.participant),
        forfeited: seat.forfeited,
        substituted: seat.statistics.substituted,
        place: wide(seat.statistics.place),
        score: seat.score,
        points: seat.statistics.points,
        decisions: seat.statistics.decisions,
        wrong_actions: seat.statistics.wrong_actions,
        timeouts: seat.statistics.timeouts,
        decision_time_us: seat.statistics.decision_time_us,
        timed_decisions: seat.statistics.timed_decisions,
        performance_score: seat.statistics.performance_score,
        hinted: seat.statistics.hinted,
    }
}

fn seat_from_form(form: SeatForm) -> Result<SeatResult, Unreadable> {
    Ok(SeatResult {
        participant: narrow(form.participant)?,
        forfeited: form.forfeited,
        score: form.score,
        statistics: SeatStatistics {
            place: narrow(form.place)?,
            points: form.points,
            substituted: form.substituted,
            decisions: form.decisions,
            wrong_actions: form.wrong_actions,
            timeouts: form.timeouts,
            decision_time_us: form.decision_time_us,
            timed_decisions: form.timed_decisions,
            performance_score: form.performance_score,
            hinted: form.hinted,
        },
    })
}

fn game_form(game: usize, participants: &[usize]) -> GameForm {
    GameForm {
        game: wide(game),
        participants: participants.iter().map(|number| wide(*number)).collect(),
    }
}

fn numbers(numbers: &[u64]) -> Result<Vec<usize>, Unreadable> {
    numbers.iter().map(|number| narrow(*number)).collect()
}

fn wide(number: usize) -> u64 {
    u64::try_from(number).unwrap_or(u64::MAX)
}

fn narrow(number: u64) -> Result<usize, Unreadable> {
    usize::try_from(number).map_err(|_| Unreadable::new(format!("{number} is too large")))
}
