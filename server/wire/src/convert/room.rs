//! A room and its seats as messages.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{MAX_SEATS, RuleSet, Seat};
use chefshat_proto::v1::{self, seat_config::FilledBy};
use chefshat_record::convert::{FieldProblem, rules_to_proto, seat_number};

use super::agent::agent_from_proto;
use super::labels::{labelled, shown_policy};
use super::mirrored::{Mirrored as _, kind_to_proto};
use super::name::checked_name;
use super::policy::millis;
use super::start::{branch_point, origin};
use chefshat_room::ids::Id;
use chefshat_room::journal::{Fill, GameHeader, ParticipantKind, RecordedSeat};
use chefshat_room::{Awaited, Core, State};

/// The participants of a new room's seats. An empty list leaves all seats open.
///
/// # Errors
/// The number of seats is not the rule set's, or a seat is invalid.
pub fn fills_from_proto(
    seats: &[v1::SeatConfig],
    rules: &RuleSet,
) -> Result<Vec<Fill>, FieldProblem> {
    let players = rules.players();
    if seats.is_empty() {
        return Ok(vec![Fill::Open { reserved_for: None }; players]);
    }
    if seats.len() != players {
        return Err(FieldProblem::new(
            "seats",
            format!(
                "{} seats are described, but the rule set has {players} players; describe all or none",
                seats.len()
            ),
        ));
    }
    seats
        .iter()
        .map(|seat| match &seat.filled_by {
            None => Ok(Fill::Open { reserved_for: None }),
            Some(FilledBy::ReservedFor(kind)) => Ok(Fill::Open {
                reserved_for: ParticipantKind::from_proto("seats", *kind)?,
            }),
            Some(FilledBy::Wizard(kind)) => match ParticipantKind::from_proto("seats", *kind)? {
                Some(ParticipantKind::Human) | None => Err(FieldProblem::new(
                    "seats",
                    "`wizard` is the kind that others see: ROBOT, AGENT or MODEL",
                )),
                shown => Ok(Fill::Open {
                    reserved_for: shown,
                }),
            },
            Some(FilledBy::Replay(player)) => recorded_seat(player).map(Fill::Replay),
            Some(FilledBy::AtTable(kind)) => ParticipantKind::from_proto("seats", *kind)?
                .map(Fill::AtTable)
                .ok_or_else(|| {
                    FieldProblem::new("seats", "set the kind of the player at the table")
                }),
            Some(FilledBy::BuiltInAgent(name)) => agent_from_proto("seats", name)?
                .map(Fill::BuiltIn)
                .ok_or_else(|| FieldProblem::new("seats", "a built-in agent has no name")),
        })
        .collect()
}

/// The seats that a person plays as another kind.
pub fn wizards_from_proto(seats: &[v1::SeatConfig]) -> BTreeSet<usize> {
    let is_wizard = |config: &v1::SeatConfig| matches!(config.filled_by, Some(FilledBy::Wizard(_)));
    let seats = seats.iter().enumerate();
    seats
        .filter(|(_, config)| is_wizard(config))
        .map(|(seat, _)| seat)
        .collect()
}

/// The display names of built-in agents and players at the table, by seat.
///
/// # Errors
/// An open seat with a name, a player at the table without one, or a name that is not allowed.
pub fn display_names_from_proto(
    seats: &[v1::SeatConfig],
) -> Result<BTreeMap<usize, String>, FieldProblem> {
    let named = seats
        .iter()
        .enumerate()
        .filter(|(_, it)| !it.name.is_empty() || is_at_table(it));
    named
        .map(|(seat, config)| {
            if matches!(config.filled_by, None | Some(FilledBy::ReservedFor(_) | FilledBy::Wizard(_))) {
                let problem = "only a built-in agent or a player at the table takes a name here; participants choose theirs when they join";
                return Err(FieldProblem::new("seats", problem));
            }
            Ok((seat, checked_name("seats", &config.name, 1)?))
        })
        .collect()
}

fn is_at_table(config: &v1::SeatConfig) -> bool {
    matches!(config.filled_by, Some(FilledBy::AtTable(_)))
}

/// How the seats of a room were requested to be filled.
pub fn seats_to_proto(header: &GameHeader) -> Vec<v1::SeatConfig> {
    let seats = header.fills.iter().enumerate();
    seats
        .map(|(seat, fill)| v1::SeatConfig {
            name: header.display_names.get(&seat).cloned().unwrap_or_default(),
            ..match fill {
                Fill::Open { reserved_for } if header.wizards.contains(&seat) => v1::SeatConfig {
                    filled_by: Some(FilledBy::Wizard(kind_to_proto(*reserved_for))),
                    ..v1::SeatConfig::default()
                },
                _ => fill_to_proto(fill),
            }
        })
        .collect()
}

/// What fills a seat, as requested.
fn fill_to_proto(fill: &Fill) -> v1::SeatConfig {
    v1::SeatConfig {
        name: String::new(),
        filled_by: Some(match fill {
            Fill::Open { reserved_for } => FilledBy::ReservedFor(kind_to_proto(*reserved_for)),
            Fill::BuiltIn(kind) => FilledBy::BuiltInAgent(kind.name()),
            Fill::Replay(player) => FilledBy::Replay(player_to_proto(*player)),
            Fill::AtTable(kind) => FilledBy::AtTable(kind_to_proto(Some(*kind))),
        }),
    }
}

fn recorded_seat(player: &v1::RecordedPlayer) -> Result<RecordedSeat, FieldProblem> {
    let problem = |message: String| FieldProblem::new("seats", message);
    let game = Id::parse(&player.game_id)
        .ok_or_else(|| problem(format!("{:?} is not a game id", player.game_id)))?;
    let seat = usize::try_from(player.seat)
        .ok()
        .filter(|index| *index < MAX_SEATS)
        .map(Seat::new)
        .ok_or_else(|| problem(format!("seat {} does not exist", player.seat)))?;
    Ok(RecordedSeat { game, seat })
}

fn player_to_proto(player: RecordedSeat) -> v1::RecordedPlayer {
    v1::RecordedPlayer {
        game_id: player.game.to_string(),
        seat: seat_number(player.seat),
    }
}

/// The public view of a room, with whom its game waits for if spectators may see that at once.
/// In a series, it would show others of the same deal who opens and who passes.
pub fn describe_at(core: &Core, now: Duration) -> v1::Room {
    let header = core.header();
    let (policy, in_series) = (&header.policy, header.series().is_some());
    let watched = policy.spectators && policy.spectator_delay_decisions == 0 && !in_series;
    let awaited = core.awaited_in_public().filter(|_| watched);
    v1::Room {
        awaited: awaited.map(|awaited| awaited_to_proto(Some(awaited), now)),
        ..describe(core)
    }
}

/// Whom a game waits for, as everybody may know.
pub fn awaited_to_proto(awaited: Option<Awaited>, now: Duration) -> v1::Awaited {
    awaited.map_or_else(v1::Awaited::default, |awaited| v1::Awaited {
        seat: Some(seat_number(awaited.seat)),
        away: awaited.away,
        waited_ms: millis(now.saturating_sub(awaited.since)),
        left_ms: (awaited.until).map(|until| millis(until.saturating_sub(now))),
    })
}

/// The public view of a room, at no particular time.
pub fn describe(core: &Core) -> v1::Room {
    let header = core.header();
    let seed_commitment = seed_commitment(header);
    v1::Room {
        room_id: header.room_id.to_string(),
        game_id: header.game_id.to_string(),
        name: header.name.clone(),
        state: state_to_proto(core.state()).into(),
        rules: Some(rules_to_proto(&header.rules)),
        policy: Some(shown_policy(core)),
        seats: shown_participants(core),
        seed_fixed: seed_commitment.is_empty() && !header.is_physical(),
        seed_commitment,
        created_at_ms: header.created_at_ms,
        origin: origin(header).into(),
        branched_from: header.start.branch.as_ref().map(branch_point),
        abort_reason: aborted_because(core.state()).into(),
        tournament_id: tournament_id(header),
        series_id: series_id(header),
        awaited: None,
        spectators: 0,
        next_join_code: String::new(),
    }
}

/// The commitment to the seed of a game; empty if its creator fixed the seed, or if nothing is
/// dealt.
pub(super) fn seed_commitment(header: &GameHeader) -> Vec<u8> {
    let commitment = header.seed.commitment(header.game_id.bytes());
    commitment
        .filter(|_| !header.is_physical())
        .map_or_else(Vec::new, |hash| hash.to_vec())
}

/// The id of the game's tournament, or an empty string.
pub fn tournament_id(header: &GameHeader) -> String {
    (header.tournament).map_or_else(String::new, |game| game.tournament.to_string())
}

/// The id of the game's series, or an empty string.
pub(super) fn series_id(header: &GameHeader) -> String {
    (header.series()).map_or_else(String::new, |series| series.to_string())
}

/// Why the game has no result; unspecified if it has one.
pub(super) fn aborted_because(state: State) -> v1::AbortReason {
    match state {
        State::Aborted(reason) => reason.to_proto(),
        _ => v1::AbortReason::Unspecified,
    }
}

/// The state of a room, as a message.
pub(super) fn state_to_proto(state: State) -> v1::RoomState {
    match state {
        State::Waiting => v1::RoomState::Waiting,
        State::Playing => v1::RoomState::Playing,
        State::Finished => v1::RoomState::Finished,
        State::Aborted(_) => v1::RoomState::Aborted,
    }
}

/// The seats of a room, as everybody sees them.
pub(super) fn shown_participants(core: &Core) -> Vec<v1::Participant> {
    labelled(core, participants(core))
}

/// The seats of a room, as its record has them.
pub fn participants(core: &Core) -> Vec<v1::Participant> {
    core.all_seats()
        .map(|seat| {
            let standing = core.standing(seat);
            let (reserved_for, built_in) = match standing.fill {
                Fill::Open { reserved_for } => (reserved_for, None),
                Fill::BuiltIn(agent) => (None, Some(agent.name())),
                Fill::Replay(_) => (None, Some(BuiltInAgent::REPLAY.to_owned())),
                Fill::AtTable(_) => (None, None),
            };
            let participant = standing.participant;
            let at_table = matches!(standing.fill, Fill::AtTable(_));
            v1::Participant {
                seat: seat_number(seat),
                name: core.name_of(seat),
                kind: kind_to_proto(
                    participant
                        .map(|participant| participant.kind)
                        .or(built_in.as_ref().map(|_| ParticipantKind::Agent)),
                ),
                reserved_for: kind_to_proto(reserved_for),
                connected: standing.connected || built_in.is_some() || at_table,
                built_in_agent: built_in.unwrap_or_default(),
                substituted: standing.substituted,
                replay: match standing.fill {
                    Fill::Replay(player) => Some(player_to_proto(player)),
                    _ => None,
                },
                at_table,
                shown_kind: v1::ParticipantKind::Unspecified.into(),
                name_fingerprint: participant.map_or_else(String::new, |participant| {
                    participant.name_fingerprint.clone()
                }),
            }
        })
        .collect()
}

/// The seats of a room for its record, which says whom a person played as another kind.
pub(super) fn recorded_participants(core: &Core) -> Vec<v1::Participant> {
    let mut seats = participants(core);
    for (index, seat) in seats.iter_mut().enumerate() {
        if core.header().wizards.contains(&index) && !seat.name.is_empty() {
            seat.shown_kind = seat.kind;
            seat.kind = v1::ParticipantKind::Human.into();
        }
    }
    seats
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use chefshat_room::journal::TournamentGame;
    use chefshat_room::policy::Policy;
    use chefshat_room::testing::{OPEN, Table};

    use super::*;

    #[test]
    fn a_room_shows_whom_it_waits_for_only_where_spectators_see_it_at_once() {
        for (spectators, delay, series, shown) in [
            (true, 0, false, true),
            (false, 0, false, false),
            (true, 1, false, false),
            (true, 0, true, false),
        ] {
            let policy = Policy {
                spectators,
                spectator_delay_decisions: delay,
                ..Policy::default()
            };
            let mut table = Table::empty(policy, vec![OPEN; 4]);
            let mut header = GameHeader::clone(table.core.header());
            header.tournament = Some(TournamentGame {
                tournament: Id::from_bytes([3; 16]),
                series: series.then_some(Id::from_bytes([4; 16])),
            });
            table.core = Core::new(Arc::new(header));
            table.fill();
            assert!(table.core.awaited_in_public().is_some());
            let described = describe_at(&table.core, table.now);
            assert_eq!(
                described.awaited.is_some(),
                shown,
                "{spectators} {delay} {series}"
            );
        }
    }
}
