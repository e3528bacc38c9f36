//! A record as a row of scenes: one for each decision while it is open, one for the end of each Shift, one for the end of the game.
//! Decisions that the viewer may not know of have none.
//! Replaying is `chefshat_record::replay`'s affair, drawing that of the modules beside this one.

mod cut;

use std::ops::RangeInclusive;
use std::time::Duration;

use chefshat_engine::{Seat, Viewer};
use chefshat_proto::v1::{self, record_line::Line};

use super::figure::Figure;
use super::scene::Scene;
use chefshat_record::convert::{rules_from_proto, seat_from_number};
use chefshat_record::replay::{ReplayError, walk};
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
    /// The decision is another seat's; it is not said whose, for that may be hidden too.
    #[error(
        "decision {decision} is another seat's: no other viewer knows what is possible with its hand"
    )]
    HandNotSeen {
        /// The decision.
        decision: u64,
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
    /// Replays a record and makes a scene of each of its moments. A decision that the viewer may not know of (another seat may declare a
    /// special action) makes none.
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

    /// The frame of a moment. Of a decision that the viewer may not know of, it is the frame before: for that viewer the moment before
    /// lasts until the next decision.
    ///
    /// # Errors
    /// If there is no such moment.
    pub fn at(&self, when: When) -> Result<&Frame, FilmError> {
        let (index, missing) = match when {
            When::Decision(decision) => (Some(self.index(decision)?), FilmError::Empty),
            When::ShiftEnd(shift) if (1..=self.shifts).contains(&shift) => {
                (self.position(when), FilmError::NoShiftEnd { shift })
            }
            When::ShiftEnd(shift) => (None, self.no_shift(shift)),
            When::End => (self.position(when), FilmError::Empty),
        };
        index
            .and_then(|index| self.frames.get(index))
            .ok_or(missing)
    }

    /// The frames of a Shift, its end included. Of a Shift that was given up before its first decision it is the end of the game.
    ///
    /// # Errors
    /// If there is no such Shift.
    pub fn shift(&self, shift: u32) -> Result<Vec<&Frame>, FilmError> {
        let of_it = || {
            self.frames
                .iter()
                .filter(|frame| frame.scene.shift == shift)
        };
        let mut frames: Vec<&Frame> = of_it().filter(|frame| frame.when != When::End).collect();
        if frames.is_empty() {
            frames = of_it().collect();
        }
        if frames.is_empty() {
            return Err(self.no_shift(shift));
        }
        Ok(frames)
    }

    /// The frames from one decision to another, both included, with the ends of Shifts between them; to the end of the game if the last
    /// decision is the game's last. For a decision that the viewer may not know of stands the frame before it, as in [`Film::at`]: there is
    /// always something to show.
    ///
    /// # Errors
    /// If one of the decisions does not exist.
    pub fn range(&self, decisions: RangeInclusive<u64>) -> Result<Vec<&Frame>, FilmError> {
        let (from, to) = (*decisions.start(), *decisions.end());
        let first = self.index(from)?;
        let mut last = self.index(to)?;
        if to == self.decisions {
            last = self.frames.len() - 1;
        }
        Ok(self
            .frames
            .get(first..=last)
            .unwrap_or_default()
            .iter()
            .collect())
    }

    fn position(&self, when: When) -> Option<usize> {
        self.frames.iter().position(|frame| frame.when == when)
    }

    /// Where a decision's frame is, or the one before it if it has none.
    fn index(&self, decision: u64) -> Result<usize, FilmError> {
        let last = self.decisions;
        if !(1..=last).contains(&decision) {
            return Err(FilmError::NoDecision { decision, last });
        }
        if let Some(index) = self.position(When::Decision(decision)) {
            return Ok(index);
        }
        let later = |frame: &Frame| match frame.when {
            When::Decision(number) => number > decision,
            When::ShiftEnd(_) => false,
            When::End => true,
        };
        // A game may begin with such a decision; the viewer's first moment is then the one after it.
        let after = self.frames.iter().position(later);
        Ok(after.unwrap_or(self.frames.len()).saturating_sub(1))
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
                let sees = [Viewer::Everything, Viewer::Seat(open.seat)].contains(&viewer);
                figure = Some(if !sees {
                    Err(FilmError::HandNotSeen { decision })
                } else if !moment.hands_known[open.seat] {
                    Err(FilmError::HandNotKnown {
                        decision,
                        seat: open.seat,
                    })
                } else {
                    Figure::of(game, chronicle)
                        .map(|mut figure| {
                            if !moment.golden_known[open.seat] {
                                figure.hand.iter_mut().for_each(|card| *card = card.plain());
                            }
                            figure
                        })
                        .ok_or(FilmError::NothingOpen { last: count })
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
