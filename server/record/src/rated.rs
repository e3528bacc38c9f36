//! Which games are rated, and what each participant's result is: one rule, for the leaderboard of a
//! server and for ratings recomputed from records.
//!
//! Whether a game is rated is decided by what is fixed before it starts. What a participant does
//! later never takes a game out of its ratings, only its place: one whose substitute played, or too often
//! its own fallback, who was given a hint, who was away when the game was broken off, or who broke it off, has lost to all.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_proto::v1::{self, AbortReason, GameOrigin, ParticipantKind, RoomState, Visibility};

use crate::outcome::{Identity, Unrated};

/// The result of one participant of a rated game.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RatedSeat {
    /// The participant.
    pub identity: Identity,
    /// Its place from 1; `None` if the game was broken off.
    pub place: Option<u32>,
    /// Whether it has lost to all others, whatever its place.
    pub forfeited: bool,
}

/// The results of a game by its summary.
///
/// # Errors
/// The game is not rated.
pub fn rated(summary: &v1::RecordSummary) -> Result<Vec<RatedSeat>, Unrated> {
    let seats = &summary.seats;
    if summary.origin() != GameOrigin::Dealt {
        return Err(Unrated::NotDealt);
    }
    // Who plays such a game is shown to nobody else.
    if matches!(
        summary.visibility(),
        Visibility::Unlisted | Visibility::Private
    ) {
        return Err(Unrated::NotPublic);
    }
    if seats.iter().any(|seat| seat.replay.is_some()) {
        return Err(Unrated::RecordedPlayer);
    }
    if (seats.iter()).any(|seat| seat.shown_kind() != ParticipantKind::Unspecified) {
        return Err(Unrated::Wizard);
    }
    let identities: BTreeSet<Identity> = seats.iter().map(Identity::of).collect();
    if identities.len() < seats.len() {
        return Err(Unrated::SameParticipant);
    }
    let is_finished = summary.state() == RoomState::Finished;
    let reason = summary.abort_reason();
    let is_broken_off = summary.state() == RoomState::Aborted
        && matches!(reason, AbortReason::Closed | AbortReason::ParticipantsLost);
    let forfeits = seats.iter().filter(|seat| seat.substituted).count();
    match forfeits {
        0 if !is_finished => return Err(Unrated::NotFinished),
        // Summaries of earlier versions do not say whose.
        0 if summary.substituted => return Err(Unrated::Substituted),
        0 if summary.hinted => return Err(Unrated::Hinted),
        // If all were lost, the network or the server was.
        all if all == seats.len() && reason != AbortReason::Closed => {
            return Err(Unrated::Substituted);
        }
        _ if !is_finished && !is_broken_off => return Err(Unrated::NotFinished),
        _ => {}
    }
    let places: BTreeMap<u32, u32> = (summary.standings.iter())
        .map(|standing| (standing.seat, standing.place))
        .collect();
    let mut results: Vec<RatedSeat> = (seats.iter())
        .map(|seat| RatedSeat {
            identity: Identity::of(seat),
            place: places.get(&seat.seat).copied(),
            forfeited: seat.substituted,
        })
        .collect();
    if is_finished && results.iter().any(|seat| seat.place.is_none()) {
        return Err(Unrated::NotFinished);
    }
    results.sort_by(|one, other| one.identity.cmp(&other.identity));
    Ok(results)
}
