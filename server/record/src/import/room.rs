//! The record of a game in a physical room: what counts at its end, after all corrections, and the
//! events of the room between the decisions.

use chefshat_engine::{Action, BySeat, RuleSet, Seat};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_referee::{ShiftFacts, StartState};

use super::{Importer, Stated};
use crate::replay::replay;

/// The game of a physical room, as it counts at its end.
#[derive(Debug)]
pub struct PhysicalRoom {
    /// The header of the record.
    pub header: v1::RecordHeader,
    /// The rule set.
    pub rules: RuleSet,
    /// What is known of each Shift.
    pub shifts: Vec<ShiftFacts>,
    /// Decisions and events in order, from the first event of the room on. The start and the end of
    /// the game are among them.
    pub entries: Vec<RoomEntry>,
}

/// An entry of the record of a physical room.
#[derive(Debug, Clone)]
pub enum RoomEntry {
    /// A decision. `record`: what does not follow from the game: source, time, bank, attempts,
    /// annotations.
    Decision {
        /// The seat.
        seat: Seat,
        /// The action.
        action: Action,
        /// Its line.
        record: Box<v1::DecisionRecord>,
    },
    /// An event of the room, or the start or the end of the game.
    Event {
        /// Milliseconds since the room was created.
        elapsed_ms: u64,
        /// The event.
        kind: Kind,
    },
    /// An expression for the record only.
    Private(v1::PrivateExpression),
    /// A marker of the room's owner.
    Marker(v1::Marker),
}

impl PhysicalRoom {
    /// The lines of the record, verified.
    ///
    /// # Errors
    /// Why the entries are no game, for the log.
    pub fn record(self) -> Result<Vec<v1::RecordLine>, String> {
        let start = StartState {
            shift: 1,
            last_order: None,
            scores: BySeat::filled(self.rules.players(), 0),
        };
        let header = self.header.clone();
        let mut importer = Importer::new(self.rules, self.header, start, self.shifts);
        importer.push(Line::Header(Box::new(header)));
        for entry in self.entries {
            importer.entry(entry)?;
        }
        replay(&importer.lines).map_err(|error| error.to_string())?;
        Ok(importer.lines)
    }
}

impl Importer {
    fn entry(&mut self, entry: RoomEntry) -> Result<(), String> {
        match entry {
            RoomEntry::Decision {
                seat,
                action,
                record,
            } => {
                self.elapsed_ms = self.elapsed_ms.max(record.elapsed_ms);
                let stated = Stated {
                    seat,
                    action,
                    record: *record,
                };
                match action {
                    Action::Give(_) | Action::GiveJoker => self.gifts.push(stated),
                    _ => self.apply_decision(stated)?,
                }
                self.apply_gifts()?;
            }
            RoomEntry::Event { elapsed_ms, kind } => {
                self.elapsed_ms = self.elapsed_ms.max(elapsed_ms);
                match kind {
                    Kind::GameStarted(_) => self.begin()?,
                    Kind::GameEnded(_) => self.end(v1::AbortReason::Unspecified),
                    Kind::GameAborted(aborted) => self.end(aborted.reason()),
                    kind => self.room_event(kind),
                }
            }
            RoomEntry::Private(mut private) => {
                self.elapsed_ms = self.elapsed_ms.max(private.elapsed_ms);
                private.elapsed_ms = self.elapsed_ms;
                self.push(Line::PrivateExpression(private));
            }
            RoomEntry::Marker(mut marker) => {
                self.elapsed_ms = self.elapsed_ms.max(marker.received_ms);
                marker.received_ms = self.elapsed_ms;
                self.push(Line::Marker(marker));
            }
        }
        Ok(())
    }
}
