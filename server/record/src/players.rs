//! The decisions of a recorded player with its observations, for agents that imitate it.

use chefshat_engine::{ActionId, RecordedDecision, Seat, Viewer};
use chefshat_proto::v1::{self, record_line::Line};

use crate::convert::{seat_from_number, seat_number};
use crate::replay::{Moment, ReplayError, walk};

/// Why a recorded player is not available.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PlayerError {
    /// The record does not verify.
    #[error("the record cannot be replayed: {0}")]
    Record(#[from] ReplayError),
    /// The game has no such seat.
    #[error("the recorded game has seats 0 to {}, not {seat}", players - 1)]
    NoSuchSeat {
        /// The seat requested.
        seat: u32,
        /// The number of seats.
        players: usize,
    },
    /// No decision has a known hand.
    #[error("seat {0} of the recorded game took no decision with a known hand")]
    NothingKnown(u32),
}

/// The decisions of a seat in order, except those with an unknown hand.
///
/// # Errors
/// The record does not verify, has no such seat, or no decision of it with a known hand.
pub fn recorded_player(
    lines: &[v1::RecordLine],
    seat: u32,
) -> Result<Vec<RecordedDecision>, PlayerError> {
    let (mut decisions, mut players) = (Vec::new(), 0);
    walk(lines, |moment| {
        players = moment.hands_known.len();
        let known = seat_from_number(seat, players).filter(|seat| moment.hands_known[*seat]);
        decisions.extend(known.and_then(|seat| decision_of(&moment, seat)));
    })?;
    if seat_from_number(seat, players).is_none() {
        return Err(PlayerError::NoSuchSeat { seat, players });
    }
    if decisions.is_empty() {
        return Err(PlayerError::NothingKnown(seat));
    }
    Ok(decisions)
}

/// The decision of a line, if it is the seat's.
fn decision_of(moment: &Moment<'_>, seat: Seat) -> Option<RecordedDecision> {
    let (Line::Decision(decision), Some(game)) = (moment.entry, moment.game) else {
        return None;
    };
    if decision.seat != seat_number(seat) {
        return None;
    }
    use v1::DecisionSource::{Disconnected, Invalid, Substitute, Timeout};
    Some(RecordedDecision {
        observation: game.observe(Viewer::Seat(seat)),
        legal: game.legal_actions(),
        action: ActionId::new(u16::try_from(decision.action).ok()?),
        own: !matches!(
            decision.source(),
            Timeout | Invalid | Disconnected | Substitute
        ),
    })
}
