//! The events of a room as messages, redacted for a viewer. `Event::seen_by` redacts the engine's
//! events; rewards are redacted here, because only rooms have them.

use chefshat_engine::SeedPlan;
use chefshat_engine::{Game, Seat, Viewer};
use chefshat_proto::v1::{self, game_event::Kind};
use chefshat_record::convert::{
    action_space, event_kind, final_table, rules_to_proto, seat_cards, seat_number,
};
use prost::Message as _;

use super::labels::{shown_by, shown_name, shown_policy, shown_substitute};
use super::mirrored::{Mirrored as _, kind_to_proto};
use super::room::{seed_commitment, shown_participants};
use super::table::violation_to_proto;
use chefshat_room::Core;
use chefshat_room::log::RoomEvent;

/// The event at a position of the log (from 0), redacted for `viewer`. `None` beyond the end.
pub fn event_to_proto(core: &Core, position: usize, viewer: Viewer) -> Option<v1::GameEvent> {
    let entry = core.log().get(position)?;
    Some(v1::GameEvent {
        sequence: u64::try_from(position).expect("a log fits memory") + 1,
        elapsed_ms: entry.at_ms.into(),
        rewards: rewards(&entry.event, viewer),
        kind: Some(kind(core, &entry.event, viewer)),
    })
}

fn kind(core: &Core, event: &RoomEvent, viewer: Viewer) -> Kind {
    match event {
        RoomEvent::Seated(seat, participant) => {
            let (name, kind) = shown_name(core, *seat, &participant.name, Some(participant.kind));
            Kind::Seated(Box::new(v1::Seated {
                seat: seat_number(*seat),
                name,
                kind: kind_to_proto(kind),
            }))
        }
        RoomEvent::Vacated(seat) => Kind::Vacated(v1::Vacated {
            seat: seat_number(*seat),
        }),
        RoomEvent::Disconnected { seat, with_node } => Kind::Disconnected(v1::Disconnected {
            seat: seat_number(*seat),
            with_node: *with_node,
        }),
        RoomEvent::Returned(seat) => Kind::Returned(v1::Returned {
            seat: seat_number(*seat),
        }),
        RoomEvent::Substituted(seat) | RoomEvent::Retired(seat) => {
            Kind::Substituted(v1::Substituted {
                seat: seat_number(*seat),
                built_in_agent: shown_substitute(core),
                for_good: matches!(event, RoomEvent::Retired(_)),
            })
        }
        RoomEvent::GameStarted => {
            let mut started = game_started(core);
            for seat in &mut started.seats {
                // The same at any time and for all viewers: later changes have their own events.
                seat.connected = true;
                seat.substituted = false;
            }
            Kind::GameStarted(Box::new(started))
        }
        RoomEvent::Game(game) => {
            let by = shown_by(core, &game.event, (game.source, game.time_us));
            // The engine's final event does not reveal the seed; the room's does.
            event_kind(
                &game.event.seen_by(viewer),
                core.header().rules.actions(),
                by,
            )
            .unwrap_or_else(|| {
                Kind::GameEnded(Box::new(v1::GameEnded {
                    standings: standings(core),
                    reveal: reveal(core, viewer),
                }))
            })
        }
        RoomEvent::GameAborted(reason) => Kind::GameAborted(Box::new(v1::GameAborted {
            reason: reason.to_proto().into(),
            reveal: reveal(core, viewer),
        })),
        RoomEvent::ServerRestarted => Kind::ServerRestarted(v1::ServerRestarted {}),
        RoomEvent::Expressed(seat, expression) => {
            Kind::ExpressionShown(Box::new(v1::ExpressionShown {
                seat: seat_number(*seat),
                expression: v1::Expression::decode(expression.as_ref()).ok(),
            }))
        }
        RoomEvent::HandReported(reported) => {
            let (seat, faces) = (reported.seat, core.header().rules.faces());
            Kind::HandReported(Box::new(v1::HandReported {
                hand: Some(match event.shows_more_to(viewer) {
                    true => seat_cards(seat, reported.cards, faces),
                    false => v1::SeatCards {
                        seat: seat_number(seat),
                        ..v1::SeatCards::default()
                    },
                }),
                dealt: reported.dealt,
            }))
        }
        RoomEvent::Violation(violation) => {
            let (report, violation) = &**violation;
            let name = violation.seat.map(|seat| core.name_of(seat));
            Kind::Violation(Box::new(v1::Violation {
                text: violation.public_text(name.as_deref()),
                ..violation_to_proto(*report, violation)
            }))
        }
        RoomEvent::Correction(correction) => Kind::Correction(Box::new(v1::Correction {
            first_void: correction.first_void,
            text: correction.text.clone(),
            report: correction.report,
        })),
        RoomEvent::Paused(paused) => Kind::TablePaused(v1::TablePaused { paused: *paused }),
    }
}

/// The start of a game, with the current state of its seats.
pub fn game_started(core: &Core) -> v1::GameStarted {
    let header = core.header();
    v1::GameStarted {
        game_id: header.game_id.to_string(),
        rules: Some(rules_to_proto(&header.rules)),
        rules_version: header.rules_version,
        policy: Some(shown_policy(core)),
        seats: shown_participants(core),
        action_space: Some(action_space(&header.rules.actions())),
        hand_size: header.rules.hand_size().into(),
        seed_commitment: seed_commitment(header),
    }
}

pub(super) fn standings(core: &Core) -> Vec<v1::Standing> {
    core.game()
        .and_then(Game::standings)
        .map_or_else(Vec::new, |standings| final_table(&standings))
}

/// The seed, public once a game has ended; nothing in a physical room. In a series of games with the same deals it is only in
/// the record, which stays closed until all of them have ended. In a study the seeds are known to its owner alone.
fn reveal(core: &Core, viewer: Viewer) -> Option<v1::SeedReveal> {
    let game = core.game().filter(|_| !core.header().is_physical())?;
    let header = core.header();
    let is_withheld = header.series().is_some() || header.study.is_some();
    if is_withheld && viewer != Viewer::Everything {
        return None;
    }
    let (server_seed, nonce, seat_entropy) = match core.header().seed {
        SeedPlan::Committed { server_seed, nonce } => (
            server_seed.to_vec(),
            nonce.to_vec(),
            core.entropy().to_vec(),
        ),
        SeedPlan::Fixed { .. } => (Vec::new(), Vec::new(), Vec::new()),
    };
    Some(v1::SeedReveal {
        server_seed,
        nonce,
        seat_entropy,
        game_seed: game.seed().0.to_vec(),
    })
}

/// The rewards of an event that a viewer may see: a seat sees its own, a record all, a spectator
/// none.
fn rewards(event: &RoomEvent, viewer: Viewer) -> Vec<v1::SeatReward> {
    let RoomEvent::Game(game) = event else {
        return Vec::new();
    };
    let visible = |seat: Seat| match viewer {
        Viewer::Seat(own) => own == seat,
        Viewer::Spectator => false,
        Viewer::Everything => true,
    };
    (game.rewards.iter())
        .filter(|(seat, _)| visible(*seat))
        .map(|(seat, value)| v1::SeatReward {
            seat: seat_number(*seat),
            value: *value,
        })
        .collect()
}
