//! A record as frames: one per open decision, one for the end of each Shift and one for the end of
//! the game. Decisions hidden from the viewer have no frame.

mod cut;

use std::ops::RangeInclusive;

use chefshat_engine::{Seat, Viewer};
use chefshat_proto::v1::{self, record_line::Line};

use super::figure::Figure;
use chefshat_record::convert::{rules_from_proto, seat_from_number};
use chefshat_record::replay::{ReplayError, walk};
use cut::{Cut, chronicle_of};
pub use cut::{Frame, When};

/// A recorded game as frames for one viewer.
#[derive(Debug, Clone)]
pub struct Film {
    frames: Vec<Frame>,
    decisions: u64,
    shifts: u32,
}

/// A failure to make a film or figure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FilmError {
    /// The record does not verify.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// There is no such seat.
    #[error("there is no seat {seat}: the game has seats 0 to {last}")]
    NoSeat {
        /// The seat requested.
        seat: u32,
        /// The last seat.
        last: usize,
    },
    /// The game was aborted before cards were dealt.
    #[error("nothing to draw: the game was aborted before the first deal")]
    Empty,
    /// There is no such decision.
    #[error("there is no decision {decision}: the game has decisions 1 to {last}")]
    NoDecision {
        /// The decision requested.
        decision: u64,
        /// The last one.
        last: u64,
    },
    /// There is no such Shift.
    #[error("there is no Shift {shift}: the game has Shifts 1 to {last}")]
    NoShift {
        /// The Shift requested.
        shift: u32,
        /// The last one.
        last: u32,
    },
    /// The Shift was aborted.
    #[error("Shift {shift} did not end")]
    NoShiftEnd {
        /// The Shift requested.
        shift: u32,
    },
    /// No decision is open at the moment requested.
    #[error("no decision is open then: choose one of the decisions 1 to {last}")]
    NothingOpen {
        /// The last decision.
        last: u64,
    },
    /// The hand of the seat is missing from an imported record.
    #[error("decision {decision} is of seat {seat}, whose hand is unknown")]
    HandNotKnown {
        /// The decision.
        decision: u64,
        /// The seat.
        seat: Seat,
    },
    /// The decision is another seat's. Which one may be hidden too.
    #[error("decision {decision} is another seat's: this viewer does not see its hand")]
    HandNotSeen {
        /// The decision.
        decision: u64,
    },
}

/// The point of view of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Perspective {
    /// All hands open.
    All,
    /// A seat, by number.
    Seat(u32),
    /// A spectator: no hand open.
    Spectator,
}

impl Film {
    /// Makes the film of a record. Decisions hidden from the viewer (special actions of other
    /// seats) get no frame.
    ///
    /// # Errors
    /// The record does not verify, has no such seat, or ended before the first deal.
    pub fn new(lines: &[v1::RecordLine], perspective: Perspective) -> Result<Film, FilmError> {
        let mut cut = Cut::new(viewer(lines, perspective)?);
        walk(lines, |moment| cut.take(&moment))?;
        Self::of(cut)
    }

    fn of(cut: Cut) -> Result<Film, FilmError> {
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

    /// The number of decisions of the game.
    pub fn decisions(&self) -> u64 {
        self.decisions
    }

    /// The frame of a moment. For a hidden decision, the frame before: to the viewer, that moment
    /// lasts until the next decision.
    ///
    /// # Errors
    /// There is no such moment.
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

    /// The frames of a Shift including its end. For a Shift aborted before its first decision, the
    /// end of the game.
    ///
    /// # Errors
    /// There is no such Shift.
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

    /// The frames of an inclusive range of decisions, with the ends of Shifts between them, and
    /// the end of the game after its last decision. Hidden decisions are replaced as in
    /// [`Film::at`], so the result is never empty.
    ///
    /// # Errors
    /// One of the decisions does not exist.
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

    /// The index of a decision's frame, or of the one before it.
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
        // If the game begins with a hidden decision, use the first frame.
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

/// The frame of a moment as [`Film::at`] finds it, without the rest of the film, which may be large.
///
/// # Errors
/// As [`Film::new`] and [`Film::at`].
pub fn frame_at(
    lines: &[v1::RecordLine],
    perspective: Perspective,
    when: When,
) -> Result<Frame, FilmError> {
    let is_reached = |frame: &Frame| match (frame.when, when) {
        (When::Decision(decision), When::Decision(wanted)) => decision >= wanted,
        (When::End, When::Decision(_)) => true,
        (reached, wanted) => reached == wanted,
    };
    let mut cut = Cut::new(viewer(lines, perspective)?);
    walk(lines, |moment| {
        cut.take(&moment);
        // The frame before is that of a hidden decision.
        match cut.frames.iter().any(is_reached) {
            true => cut.frames.truncate(2),
            false => drop(cut.frames.drain(..cut.frames.len().saturating_sub(1))),
        }
    })?;
    Film::of(cut)?.at(when).cloned()
}

/// The action table of a decision.
///
/// # Errors
/// The record does not verify, there is no such decision, or the hand is hidden or unknown.
pub fn figure_at(
    lines: &[v1::RecordLine],
    perspective: Perspective,
    decision: u64,
) -> Result<Figure, FilmError> {
    let viewer = viewer(lines, perspective)?;
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

/// The viewer of a perspective. Records without a header are rejected by the replay.
fn viewer(lines: &[v1::RecordLine], perspective: Perspective) -> Result<Viewer, FilmError> {
    let players = header(lines)
        .and_then(|header| rules_from_proto(header.rules.as_ref()?).ok())
        .map_or(chefshat_engine::MAX_SEATS, |rules| rules.players());
    match perspective {
        Perspective::All => Ok(Viewer::Everything),
        Perspective::Spectator => Ok(Viewer::Spectator),
        Perspective::Seat(number) => {
            seat_from_number(number, players)
                .map(Viewer::Seat)
                .ok_or(FilmError::NoSeat {
                    seat: number,
                    last: players - 1,
                })
        }
    }
}
