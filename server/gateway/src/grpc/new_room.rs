//! Checks requests for new rooms and reads the recorded games they name.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_agents::{NamedAgent, RecordedPlayer};
use chefshat_engine::{RuleSet, Stop};
use chefshat_proto::v1::{self, create_room_request::Start};
use chefshat_record::branch::{BranchError, branch_of};
use chefshat_record::convert::{FieldProblem, rules_from_proto, script_from_proto, seat_number};
use chefshat_referee::Referee;
use prost::Message as _;
use tonic::{Code, Status};

use super::fields::{checked_name, request_id};
use super::forward::Gateway;
use super::recorded::Recorded;
use super::status::{field, invalid, status};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{Key, Payer};
use chefshat_hosting::rooms::NewRoom;
use chefshat_room::ids::{Id, RequestKey};
use chefshat_room::journal::{Branch, Fill, GameStart};
use chefshat_room::policy::{Durability, Policy};
use chefshat_wire::convert;
use chefshat_wire::convert::MAX_HOSTED_SHIFTS;

/// Rules, start and fixed game seed of a new room.
struct Beginning {
    rules: RuleSet,
    start: GameStart,
    game_seed: Option<[u8; 32]>,
}

/// Checks a request for a new room.
pub(super) async fn new_room(
    (recorded, caller, gateway): (&Recorded, &Caller, Option<&Gateway>),
    mut request: v1::CreateRoomRequest,
    charged: Key,
) -> Result<NewRoom, Status> {
    let request_id = request_id(&std::mem::take(&mut request.request_id), caller)?;
    let request_key = request_id.map(|id| RequestKey::new(id, &request.encode_to_vec()));
    let name = checked_name("name", &request.name, 0)?;
    let policy = supported_policy(recorded, &request.policy.clone().unwrap_or_default())
        .map_err(|problem| field("POLICY_REFUSED", &problem))?;
    let game_seed = game_seed(&request.game_seed)?;
    let beginning = match &request.start {
        Some(Start::Branch(point)) => {
            branched(
                (recorded, caller, gateway),
                point,
                request.rules.as_ref(),
                game_seed,
            )
            .await?
        }
        start => {
            let rules = hosted_rules(&request.rules.clone().unwrap_or_default())?;
            let script = match start {
                Some(Start::Scripted(script)) => Some(
                    script_from_proto(script, &rules)
                        .map_err(|problem| field("SCRIPT_REFUSED", &problem))?,
                ),
                _ => None,
            };
            Beginning {
                rules,
                start: GameStart {
                    script,
                    branch: None,
                },
                game_seed,
            }
        }
    };
    let refused = |problem: FieldProblem| field("SEATS_REFUSED", &problem);
    let fills = convert::fills_from_proto(&request.seats, &beginning.rules).map_err(refused)?;
    check_table(&request, &fills, &beginning.rules)?;
    for agent in built_in(&fills) {
        convert::check_budget("seats", agent).map_err(refused)?;
    }
    if request.physical && !convert::wizards_from_proto(&request.seats).is_empty() {
        let problem = "a person cannot play as another kind at a table with real cards";
        return Err(refused(FieldProblem::new("seats", problem)));
    }
    if request.physical {
        check_agents(&policy, &fills)?;
        if policy.hints {
            let problem = "hints are not given at tables with real cards";
            return Err(invalid("POLICY_REFUSED", "hints", problem));
        }
    }
    let display_names = convert::display_names_from_proto(&request.seats).map_err(refused)?;
    Ok(NewRoom {
        name,
        // Last: no record is read for a request that is refused.
        recorded: recorded_players((recorded, caller, gateway), &fills).await?,
        rules: beginning.rules,
        policy,
        fills,
        wizards: convert::wizards_from_proto(&request.seats),
        display_names,
        start: beginning.start,
        game_seed: beginning.game_seed,
        physical: request.physical,
        seating: None,
        request: request_key,
        charged,
        creator: Some(Payer::of_caller(caller)),
    })
}

/// Checks the seats, rules and start of a room with real cards, and that only such a room has
/// players at the table.
fn check_table(
    request: &v1::CreateRoomRequest,
    fills: &[Fill],
    rules: &RuleSet,
) -> Result<(), Status> {
    let refused = |reason, name, message: &str| Err(invalid(reason, name, message.to_owned()));
    let any_at_table = (fills.iter()).any(|fill| matches!(fill, Fill::AtTable(_)));
    if !request.physical {
        return match any_at_table {
            true => refused(
                "SEATS_REFUSED",
                "seats",
                "only a physical room has players at the table; set `physical`",
            ),
            false => Ok(()),
        };
    }
    if !any_at_table {
        let problem = "a physical room needs at least one seat with `at_table`";
        return refused("SEATS_REFUSED", "seats", problem);
    }
    if !request.game_seed.is_empty() {
        let problem = "leave it unset: in a physical room the server deals nothing";
        return refused("SEED_REFUSED", "game_seed", problem);
    }
    let problem = "leave it unset: the game of a physical room starts with real cards";
    match &request.start {
        Some(Start::Scripted(_)) => return refused("SCRIPT_REFUSED", "scripted", problem),
        Some(Start::Branch(_)) => return refused("BRANCH_REFUSED", "branch", problem),
        None => {}
    }
    Referee::check_rules(rules).or_else(|problem| refused("RULE_SET_REFUSED", "rules", problem))
}

/// Checks that the built-in agents of a room with real cards can play there.
fn check_agents(policy: &Policy, fills: &[Fill]) -> Result<(), Status> {
    convert::check_real_cards("substitute", policy.substitute)
        .map_err(|problem| field("POLICY_REFUSED", &problem))?;
    for agent in built_in(fills) {
        convert::check_real_cards("seats", agent)
            .map_err(|problem| field("SEATS_REFUSED", &problem))?;
    }
    Ok(())
}

fn built_in(fills: &[Fill]) -> impl Iterator<Item = NamedAgent> {
    fills.iter().filter_map(|fill| match fill {
        Fill::BuiltIn(agent) => Some(*agent),
        _ => None,
    })
}

/// A policy that promises no more than the server's store supports, with a substitute that a server
/// has time for.
pub(super) fn supported_policy(
    recorded: &Recorded,
    message: &v1::RoomPolicy,
) -> Result<Policy, FieldProblem> {
    let mut policy = convert::requested_policy(message)?;
    convert::check_budget("substitute", policy.substitute)?;
    if !recorded.rooms().store().outlives_server() {
        if message.durability() == v1::Durability::Durable {
            let problem = "this server stores games in memory only; leave it unset";
            return Err(FieldProblem::new("durability", problem));
        }
        policy.durability = Durability::Ephemeral;
    }
    Ok(policy)
}

fn hosted_rules(message: &v1::RuleSet) -> Result<RuleSet, Status> {
    let rules = rules_from_proto(message).map_err(|problem| field("RULE_SET_REFUSED", &problem))?;
    check_length(&rules)?;
    Ok(rules)
}

/// Checks that a game by these rules is short enough to be hosted.
fn check_length(rules: &RuleSet) -> Result<(), Status> {
    let Some(problem) = too_long(rules) else {
        return Ok(());
    };
    Err(status(
        Code::InvalidArgument,
        "RULE_SET_REFUSED",
        problem.message,
        [
            ("field", problem.field),
            ("max_shifts", &MAX_HOSTED_SHIFTS.to_string()),
        ],
    ))
}

/// The problem with rules whose games are too long to be hosted, if any.
pub(super) fn too_long(rules: &RuleSet) -> Option<FieldProblem> {
    let (stop_field, length) = match rules.stop() {
        Stop::Points(points) => ("target_points", points),
        Stop::Shifts(shifts) => ("target_shifts", shifts),
    };
    (length > MAX_HOSTED_SHIFTS).then(|| {
        let problem = format!(
            "a hosted game ends after at most {MAX_HOSTED_SHIFTS} points or Shifts, not {length}"
        );
        FieldProblem::new(stop_field, problem)
    })
}

fn game_seed(bytes: &[u8]) -> Result<Option<[u8; 32]>, Status> {
    if bytes.is_empty() {
        return Ok(None);
    }
    bytes.try_into().map(Some).map_err(|_| {
        let message = format!("{} bytes; give 32, or none", bytes.len());
        invalid("SEED_REFUSED", "game_seed", message)
    })
}

/// A game that branches from a recorded one.
async fn branched(
    (recorded, caller, gateway): (&Recorded, &Caller, Option<&Gateway>),
    point: &v1::BranchPoint,
    rules: Option<&v1::RuleSet>,
    game_seed: Option<[u8; 32]>,
) -> Result<Beginning, Status> {
    let refused = |name: &'static str, message: String| invalid("BRANCH_REFUSED", name, message);
    if rules.is_some_and(|rules| *rules != v1::RuleSet::default()) {
        let message = "leave it unset: the rules are those of the recorded game";
        return Err(refused("rules", message.to_owned()));
    }
    if point.same_deals && game_seed.is_some() {
        let message =
            "with `same_deals` the seed is that of the recorded game; leave one of them unset";
        return Err(refused("game_seed", message.to_owned()));
    }
    let decisions = point.decisions;
    let lines = recorded.lines(caller, gateway, &point.game_id, |lines, _| lines);
    let lines = lines.await?;
    let branch = recorded
        .with_place(Key::of_caller(caller), move || branch_of(&lines, decisions))
        .await?
        .map_err(|error| branch_refused(&error))?;
    check_length(&branch.rules)?;
    let game_seed = match (point.same_deals, branch.later_deals) {
        (false, _) => game_seed,
        (true, Some(seed)) => Some(seed.0),
        (true, None) => {
            let message = "the later Shifts of this game were not dealt from one seed";
            return Err(refused("same_deals", message.to_owned()));
        }
    };
    let game = Id::parse(&point.game_id).expect("a record was found by it");
    Ok(Beginning {
        rules: branch.rules,
        start: GameStart {
            script: branch.script,
            branch: Some(Branch {
                game,
                same_deals: point.same_deals,
                taken_over: branch.taken_over,
            }),
        },
        game_seed,
    })
}

/// The status for a point from which no game can continue.
pub(super) fn branch_refused(error: &BranchError) -> Status {
    let name = match error {
        BranchError::TooFar { .. } | BranchError::Over(_) => "decisions",
        _ => "game_id",
    };
    invalid("BRANCH_REFUSED", name, error.to_string())
}

/// The recorded players of seats that replay one.
async fn recorded_players(
    (recorded, caller, gateway): (&Recorded, &Caller, Option<&Gateway>),
    fills: &[Fill],
) -> Result<BTreeMap<usize, Arc<RecordedPlayer>>, Status> {
    let mut players = BTreeMap::new();
    for (index, fill) in fills.iter().enumerate() {
        let Fill::Replay(seat) = fill else { continue };
        let number = seat_number(seat.seat);
        let game = seat.game.to_string();
        let lines = recorded.lines(caller, gateway, &game, |lines, _| lines);
        let lines = lines.await?;
        let player = recorded
            .with_place(Key::of_caller(caller), move || {
                convert::recorded_player(&lines, number)
            })
            .await?
            .map_err(|error| invalid("SEATS_REFUSED", "seats", error.to_string()))?;
        players.insert(index, player);
    }
    Ok(players)
}
