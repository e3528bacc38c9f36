//! The log of a room as events of the protocol, as a viewer may see them. What of the engine's events a viewer may see is decided by
//! `Event::seen_by`; rewards are withheld here, because only rooms have them.

use chefshat_engine::SeedPlan;
use chefshat_engine::{Event, Game, Seat, Viewer};
use chefshat_proto::v1::{self, game_event::Kind};
use chefshat_record::convert::{
    By, action_space, event_kind, final_table, rules_to_proto, seat_number,
};
use prost::Message as _;

use super::decision::source_to_proto;
use super::policy::policy_of;
use super::room::{kind_to_proto, participants};
use chefshat_room::Core;
use chefshat_room::journal::AbortReason;
use chefshat_room::log::{ByWhom, Happening, LogEntry};

/// The event at a position of the log (from 0), as `viewer` may see it; `None` beyond the end.
pub fn view(core: &Core, position: usize, viewer: Viewer) -> Option<v1::GameEvent> {
    let entry = core.log().get(position)?;
    Some(v1::GameEvent {
        sequence: u64::try_from(position).expect("a log fits memory") + 1,
        elapsed_ms: entry.at_ms.into(),
        rewards: rewards(entry, viewer),
        kind: Some(kind(core, &entry.happening, viewer)),
    })
}

fn kind(core: &Core, happening: &Happening, viewer: Viewer) -> Kind {
    let space = core.header().rules.actions();
    let engine_event = |event: Event, by: &ByWhom| {
        event_kind(&event.seen_by(viewer), space, by_to_proto(by))
            .expect("a room tells the end of its game itself")
    };
    match happening {
        Happening::Seated(seat, participant) => Kind::Seated(Box::new(v1::Seated {
            seat: seat_number(*seat),
            name: participant.name.clone(),
            kind: kind_to_proto(Some(participant.kind)),
        })),
        Happening::Vacated(seat) => Kind::Vacated(v1::Vacated {
            seat: seat_number(*seat),
        }),
        Happening::Disconnected(seat) => Kind::Disconnected(v1::Disconnected {
            seat: seat_number(*seat),
        }),
        Happening::Returned(seat) => Kind::Returned(v1::Returned {
            seat: seat_number(*seat),
        }),
        Happening::Substituted(seat) => Kind::Substituted(v1::Substituted {
            seat: seat_number(*seat),
            built_in_agent: core.header().policy.substitute.name().into(),
        }),
        Happening::GameStarted => {
            let mut started = game_started(core);
            for seat in &mut started.seats {
                // The same for everybody who reads the log, whenever: what changes later has events of its own.
                seat.connected = true;
                seat.substituted = false;
            }
            Kind::GameStarted(Box::new(started))
        }
        Happening::Game(game) => engine_event(game.event, &game.by),
        Happening::Played {
            seat,
            action,
            cards_left,
            by,
        } => {
            let (face, quantity, jokers) = played(core, *action);
            engine_event(
                Event::Played {
                    seat: *seat,
                    action: *action,
                    face,
                    quantity,
                    jokers,
                    cards_left: *cards_left,
                },
                by,
            )
        }
        Happening::Passed {
            seat,
            cards_left,
            by,
        } => engine_event(
            Event::Passed {
                seat: *seat,
                cards_left: *cards_left,
            },
            by,
        ),
        Happening::PizzaDone {
            pizza,
            last_to_play,
            next_leader,
        } => engine_event(
            Event::PizzaDone {
                pizza: *pizza,
                last_to_play: *last_to_play,
                next_leader: *next_leader,
            },
            &UNDECIDED,
        ),
        Happening::SeatFinished { seat, place } => engine_event(
            Event::SeatFinished {
                seat: *seat,
                place: *place,
            },
            &UNDECIDED,
        ),
        Happening::GameEnded => Kind::GameEnded(Box::new(v1::GameEnded {
            standings: standings(core),
            reveal: reveal(core, viewer),
        })),
        Happening::GameAborted(reason) => Kind::GameAborted(Box::new(v1::GameAborted {
            reason: abort_reason(*reason).into(),
            reveal: reveal(core, viewer),
        })),
        Happening::ServerRestarted => Kind::ServerRestarted(v1::ServerRestarted {}),
        Happening::Expressed(seat, expression) => {
            Kind::ExpressionShown(Box::new(v1::ExpressionShown {
                seat: seat_number(*seat),
                expression: v1::Expression::decode(expression.as_ref()).ok(),
            }))
        }
    }
}

/// The protocol's name for why a game has no result.
pub(super) fn abort_reason(reason: AbortReason) -> v1::AbortReason {
    match reason {
        AbortReason::Closed => v1::AbortReason::Closed,
        AbortReason::Shutdown => v1::AbortReason::Shutdown,
        AbortReason::ParticipantsLost => v1::AbortReason::ParticipantsLost,
        AbortReason::NeverStarted => v1::AbortReason::NeverStarted,
        AbortReason::TooLong => v1::AbortReason::TooLong,
    }
}

/// For events that no decision stands behind alone.
const UNDECIDED: ByWhom = ByWhom {
    source: chefshat_room::journal::Source::Agent,
    time_us: 0,
    reward: None,
};

/// The start of a game, with its seats as they stand now.
pub fn game_started(core: &Core) -> v1::GameStarted {
    let header = core.header();
    v1::GameStarted {
        game_id: header.game_id.to_string(),
        rules: Some(rules_to_proto(&header.rules)),
        rules_version: header.rules_version,
        policy: Some(policy_of(core)),
        seats: participants(core),
        action_space: Some(action_space(&header.rules.actions())),
        hand_size: header.rules.hand_size().into(),
        seed_commitment: header
            .seed
            .commitment(&header.game_id.0)
            .map_or_else(Vec::new, |hash| hash.to_vec()),
    }
}

pub(super) fn standings(core: &Core) -> Vec<v1::Standing> {
    core.game()
        .and_then(Game::standings)
        .map_or_else(Vec::new, |standings| final_table(&standings))
}

/// The seed, which everybody may know once a game has ended; of a series of games that are dealt alike it stands in the record alone, which is
/// closed as long as one of them is played.
fn reveal(core: &Core, viewer: Viewer) -> Option<v1::SeedReveal> {
    let game = core.game()?;
    if core.header().series().is_some() && viewer != Viewer::Everything {
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

/// The rewards of an event that a viewer may see: a seat its own, the record all, spectators none.
fn rewards(entry: &LogEntry, viewer: Viewer) -> Vec<v1::SeatReward> {
    let visible = |seat: Seat| match viewer {
        Viewer::Seat(own) => own == seat,
        Viewer::Spectator => false,
        Viewer::Everything => true,
    };
    let one = |seat: Seat, value: f32| v1::SeatReward {
        seat: seat_number(seat),
        value,
    };
    match &entry.happening {
        Happening::Played { seat, by, .. } | Happening::Passed { seat, by, .. }
            if visible(*seat) =>
        {
            by.reward
                .map(|value| one(*seat, value))
                .into_iter()
                .collect()
        }
        Happening::Game(game) => game
            .rewards
            .iter()
            .filter(|(seat, _)| visible(*seat))
            .map(|(seat, value)| one(*seat, *value))
            .collect(),
        _ => Vec::new(),
    }
}

/// Face, quantity and jokers of a play, from its action.
fn played(core: &Core, action: chefshat_engine::ActionId) -> (u8, u8, u8) {
    use chefshat_engine::Action;
    let rules = &core.header().rules;
    match rules.actions().decode(action) {
        Some(Action::Play {
            face,
            quantity,
            jokers,
        }) => (face.get(), quantity, jokers),
        _ => (rules.faces() + 1, 0, 1),
    }
}

fn by_to_proto(by: &ByWhom) -> By {
    By {
        source: source_to_proto(by.source),
        decision_time_us: by.time_us,
    }
}
