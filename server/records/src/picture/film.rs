//! A record as a row of scenes: one for each decision while it is open, one for the end of each Shift, one for the end of the game.
//! Replaying is `crate::replay`'s affair, drawing that of the modules beside this one.

mod cut;

use std::ops::RangeInclusive;
use std::time::Duration;

use chefshat_engine::{Seat, Viewer};
use chefshat_proto::v1::{self, record_line::Line};

use super::figure::Figure;
use super::scene::{Now, Scene};
use crate::convert::{rules_from_proto, seat_from_number};
use crate::replay::{ReplayError, walk};
use cut::{Cut, chronicle_of};

/// Which moment of a game a scene shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// This decision is open; counted over the whole game, from 1.
    Decision(u64),
    /// This Shift has just ended.
    ShiftEnd(u32),
    /// The game has ended.
    End,
}

/// A scene, and how long it lasted.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Which moment it is.
    pub when: When,
    /// What is to be seen.
    pub scene: Scene,
    /// How long the decision that is open took; nothing for built-in agents and at the ends of Shifts and games.
    pub decision_time: Duration,
}

/// A recorded game as one viewer saw it.
#[derive(Debug, Clone)]
pub struct Film {
    frames: Vec<Frame>,
    decisions: u64,
    shifts: u32,
}

/// Why a film cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FilmError {
    /// The record does not replay.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// There is no such seat.
    #[error("there is no seat {seat}: the game has the seats 0 to {last}")]
    NoSeat {
        /// The seat asked for.
        seat: u32,
        /// The last seat there is.
        last: usize,
    },
    /// The game was aborted before cards were dealt.
    #[error("the game ended before cards were dealt: there is nothing to draw")]
    Empty,
    /// There is no such decision.
    #[error("there is no decision {decision}: the game has the decisions 1 to {last}")]
    NoDecision {
        /// The decision asked for.
        decision: u64,
        /// The last one there is.
        last: u64,
    },
    /// There is no such Shift.
    #[error("there is no Shift {shift}: the game has the Shifts 1 to {last}")]
    NoShift {
        /// The Shift asked for.
        shift: u32,
        /// The last one there is.
        last: u32,
    },
    /// The Shift was never played to its end.
    #[error("Shift {shift} was not played to its end")]
    NoShiftEnd {
        /// The Shift asked for.
        shift: u32,
    },
    /// No decision is open at the moment asked for.
    #[error("no decision is open then: name one of the decisions 1 to {last}")]
    NothingOpen {
        /// The last decision there is.
        last: u64,
    },
    /// The hand of the seat that decides was not written down.
    #[error("decision {decision} is seat {seat}'s, whose hand is not known")]
    HandNotKnown {
        /// The decision.
        decision: u64,
        /// The seat.
        seat: Seat,
    },
    /// The decision is another seat's.
    #[error(
        "decision {decision} is seat {seat}'s: no other viewer knows what is possible with its hand"
    )]
    HandNotSeen {
        /// The decision.
        decision: u64,
        /// The seat whose decision it is.
        seat: Seat,
    },
}

/// Who is to look at a recorded game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Eyes {
    /// Those of nobody at the table: all hands are open.
    All,
    /// Those of a seat, by its number.
    Seat(u32),
    /// Those of a spectator: no hand is open.
    Spectator,
}

impl Film {
    /// Replays a record and makes a scene of each of its moments. A moment that the viewer may not know of (another seat may declare a
    /// special action) shows a Shift whose cards have just been dealt.
    ///
    /// # Errors
    /// If the record does not replay, has no such seat, or ended before cards were dealt.
    pub fn new(lines: &[v1::RecordLine], eyes: Eyes) -> Result<Film, FilmError> {
        let viewer = viewer(lines, eyes)?;
        let mut cut = Cut::new(viewer);
        walk(lines, |moment| cut.take(&moment))?;
        if cut.frames.is_empty() {
            return Err(FilmError::Empty);
        }
        Ok(Film {
            frames: cut.frames,
            decisions: cut.decisions,
            shifts: cut.shifts,
        })
    }

    /// All frames, in order.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// How many decisions the game had.
    pub fn decisions(&self) -> u64 {
        self.decisions
    }

    /// The frame of a moment.
    ///
    /// # Errors
    /// If there is no such moment.
    pub fn at(&self, when: When) -> Result<&Frame, FilmError> {
        let missing = match when {
            When::Decision(decision) => FilmError::NoDecision {
                decision,
                last: self.decisions,
            },
            When::ShiftEnd(shift) if (1..=self.shifts).contains(&shift) => {
                FilmError::NoShiftEnd { shift }
            }
            When::ShiftEnd(shift) => self.no_shift(shift),
            When::End => FilmError::Empty,
        };
        self.frames
            .iter()
            .find(|frame| frame.when == when)
            .ok_or(missing)
    }

    /// The frames of a Shift, its end included; without moments that the viewer may not know of.
    ///
    /// # Errors
    /// If there is no such Shift.
    pub fn shift(&self, shift: u32) -> Result<Vec<&Frame>, FilmError> {
        let of_it = |frame: &&Frame| frame.scene.shift == shift && frame.when != When::End;
        let frames: Vec<&Frame> = self.known().filter(of_it).collect();
        if frames.is_empty() {
            return Err(self.no_shift(shift));
        }
        Ok(frames)
    }

    /// The frames from one decision to another, both included, with the ends of Shifts between them; to the end of the game if the last
    /// decision is the game's last. Without moments that the viewer may not know of.
    ///
    /// # Errors
    /// If one of the decisions does not exist.
    pub fn range(&self, decisions: RangeInclusive<u64>) -> Result<Vec<&Frame>, FilmError> {
        let (from, to) = (*decisions.start(), *decisions.end());
        for decision in [from, to] {
            self.at(When::Decision(decision))?;
        }
        let mut last = 0;
        let within = |frame: &&Frame| {
            if let When::Decision(decision) = frame.when {
                last = decision;
                return (from..=to).contains(&decision);
            }
            // What follows a decision belongs to it, but not to the last one asked for, unless nothing else follows.
            (from..to).contains(&last) || (last == to && to == self.decisions)
        };
        Ok(self.known().filter(within).collect())
    }

    fn known(&self) -> impl Iterator<Item = &Frame> {
        let known = |frame: &&Frame| frame.scene.now != Now::Dealt;
        self.frames.iter().filter(known)
    }

    fn no_shift(&self, shift: u32) -> FilmError {
        FilmError::NoShift {
            shift,
            last: self.shifts,
        }
    }
}

/// The look-up table of a decision: what the seat's hand could do, and what is legal.
///
/// # Errors
/// If the record does not replay, there is no such decision, or the hand is not the viewer's to see or not known.
pub fn figure_at(lines: &[v1::RecordLine], eyes: Eyes, decision: u64) -> Result<Figure, FilmError> {
    let viewer = viewer(lines, eyes)?;
    let mut chronicle = None;
    let (mut count, mut figure) = (0, None);
    walk(lines, |moment| match (moment.entry, moment.game) {
        (Line::Header(header), _) => chronicle = chronicle_of(header, viewer),
        (Line::Event(event), _) => {
            if let (Some(chronicle), Some(kind)) = (&mut chronicle, &event.kind) {
                chronicle.note(kind);
            }
        }
        (Line::Decision(_), Some(game)) => {
            count += 1;
            if count == decision
                && let (Some(chronicle), Some(open)) = (&chronicle, game.decision())
            {
                figure = Some(if !moment.hands_known[open.seat] {
                    Err(FilmError::HandNotKnown {
                        decision,
                        seat: open.seat,
                    })
                } else if viewer != Viewer::Everything && viewer != Viewer::Seat(open.seat) {
                    Err(FilmError::HandNotSeen {
                        decision,
                        seat: open.seat,
                    })
                } else {
                    Figure::of(game, chronicle).ok_or(FilmError::NothingOpen { last: count })
                });
            }
        }
        _ => {}
    })?;
    figure.unwrap_or(Err(FilmError::NoDecision {
        decision,
        last: count,
    }))
}

fn header(lines: &[v1::RecordLine]) -> Option<&v1::RecordHeader> {
    match lines.first()?.line.as_ref()? {
        Line::Header(header) => Some(header),
        _ => None,
    }
}

/// The eyes as the engine names them. A record without a header is left to the replay to refuse.
fn viewer(lines: &[v1::RecordLine], eyes: Eyes) -> Result<Viewer, FilmError> {
    let players = header(lines)
        .and_then(|header| rules_from_proto(header.rules.as_ref()?).ok())
        .map_or(chefshat_engine::MAX_SEATS, |rules| rules.players());
    match eyes {
        Eyes::All => Ok(Viewer::Everything),
        Eyes::Spectator => Ok(Viewer::Spectator),
        Eyes::Seat(number) => {
            seat_from_number(number, players)
                .map(Viewer::Seat)
                .ok_or(FilmError::NoSeat {
                    seat: number,
                    last: players - 1,
                })
        }
    }
}
