//! What is shown of the participants of a room whose study hides them: to everybody, in every message
//! about the room but its record. Which labels a room has is part of its header.

use std::sync::Arc;

use chefshat_engine::{Event, Seat};
use chefshat_proto::v1;
use chefshat_record::convert::By;
use chefshat_room::Core;
use chefshat_room::journal::{Fill, GameHeader, ParticipantKind, SeatLabels, Source, StudyGame};

use super::mirrored::{Mirrored as _, kind_to_proto};
use super::policy::policy_of;

/// The seats of a room, labelled as its study wants.
pub(super) fn labelled(core: &Core, mut seats: Vec<v1::Participant>) -> Vec<v1::Participant> {
    if core.header().labels() == SeatLabels::AsTheyAre {
        return seats;
    }
    for (seat, shown) in core.all_seats().zip(&mut seats) {
        let standing = core.standing(seat);
        let kind = match (standing.participant, standing.fill) {
            (Some(participant), _) => Some(participant.kind),
            // A seat of which nobody may know whether a built-in agent plays there is never free.
            (None, Fill::Open { reserved_for }) if core.header().is_hidden(seat) => reserved_for,
            (None, fill) => fill.is_built_in().then_some(ParticipantKind::Agent),
        };
        let (name, kind) = shown_name(core, seat, &shown.name, kind);
        *shown = v1::Participant {
            seat: shown.seat,
            name,
            kind: kind_to_proto(kind),
            // A built-in agent always is, and has no substitute.
            connected: shown.connected || core.header().is_hidden(seat),
            substituted: shown.substituted && !core.header().is_hidden(seat),
            ..v1::Participant::default()
        };
    }
    seats
}

/// The policy of a room, without the name of the substitute if the names of agents are hidden.
pub(super) fn shown_policy(core: &Core) -> v1::RoomPolicy {
    v1::RoomPolicy {
        substitute: shown_substitute(core),
        ..policy_of(core)
    }
}

/// The name of the agent that substitutes seats; empty if the names of agents are hidden.
pub(super) fn shown_substitute(core: &Core) -> String {
    let header = core.header();
    match header.labels() {
        SeatLabels::AsTheyAre => header.policy.substitute.name(),
        SeatLabels::Kinds | SeatLabels::Players => String::new(),
    }
}

/// The name and kind of the participant of a seat, as they are shown. The participant of the study
/// keeps its own; those of a group do not, because all see the same.
pub(super) fn shown_name(
    core: &Core,
    seat: Seat,
    name: &str,
    kind: Option<ParticipantKind>,
) -> (String, Option<ParticipantKind>) {
    let number = seat.index() + 1;
    match (core.header().labels(), kind) {
        (_, kind) if !core.header().is_hidden(seat) => (name.to_owned(), kind),
        (SeatLabels::AsTheyAre, _) => (name.to_owned(), kind),
        (SeatLabels::Players, _) => (format!("Player {number}"), None),
        // The seat is free.
        (SeatLabels::Kinds, None) => (String::new(), None),
        (SeatLabels::Kinds, Some(kind)) => {
            let word = match kind {
                ParticipantKind::Agent => "Agent",
                ParticipantKind::Human => "Player",
                ParticipantKind::Robot => "Robot",
                ParticipantKind::Model => "Model",
            };
            (format!("{word} {number}"), Some(kind))
        }
    }
}

/// Who or what took the decision that an event states, and in what time. Of a seat whose participant
/// is hidden neither is shown: the time of a built-in agent is not measured, and none runs out.
pub(super) fn shown_by(core: &Core, event: &Event, (source, time_us): (Source, u64)) -> By {
    let seat = match *event {
        Event::Played { seat, .. }
        | Event::Passed { seat, .. }
        | Event::SpecialActionDeclared { seat, .. } => Some(seat),
        _ => None,
    };
    match seat.is_some_and(|seat| core.header().is_hidden(seat)) {
        true => By {
            source: Source::Agent.to_proto(),
            decision_time_us: 0,
        },
        false => By {
            source: source.to_proto(),
            decision_time_us: time_us,
        },
    }
}

/// The header of a game with the names of its participants, for its record.
pub(super) fn without_labels(header: &Arc<GameHeader>) -> Arc<GameHeader> {
    let Some(game) = header.study.as_deref() else {
        return Arc::clone(header);
    };
    let game = StudyGame {
        labels: SeatLabels::AsTheyAre,
        ..game.clone()
    };
    Arc::new(GameHeader {
        study: Some(Arc::new(game)),
        ..GameHeader::clone(header)
    })
}
