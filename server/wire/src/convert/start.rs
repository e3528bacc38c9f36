//! The start of a game as a message, and back: scripted hands, and branches of other games.

use chefshat_engine::{ActionId, RuleSet, Seed};
use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, script_from_proto, script_to_proto};

use chefshat_room::ids::Id;
use chefshat_room::journal::{Branch, GameHeader, GameStart, TakenOver};

/// Where a game comes from.
pub(super) fn origin(header: &GameHeader) -> v1::GameOrigin {
    if header.is_physical() {
        v1::GameOrigin::Physical
    } else if header.start.branch.is_some() {
        v1::GameOrigin::Branched
    } else if header.start.script.is_some() {
        v1::GameOrigin::Scripted
    } else if header.seed.commitment(header.game_id.bytes()).is_some() {
        v1::GameOrigin::Dealt
    } else {
        v1::GameOrigin::FixedSeed
    }
}

/// The point from which a game branches.
pub(super) fn branch_point(branch: &Branch) -> v1::BranchPoint {
    v1::BranchPoint {
        game_id: branch.game.to_string(),
        decisions: (branch.taken_over.iter()).map(length).sum(),
        same_deals: branch.same_deals,
    }
}

/// The start of a game with this number of faces; `None` if it is simply dealt.
pub fn start_to_proto(start: &GameStart, faces: u8) -> Option<v1::GameStart> {
    let taken_over = start.branch.iter().flat_map(|branch| &branch.taken_over);
    (*start != GameStart::default()).then(|| v1::GameStart {
        scripted: (start.script.as_ref()).map(|script| script_to_proto(script, faces)),
        branched_from: start.branch.as_ref().map(branch_point),
        taken_over: taken_over
            .map(|part| v1::TakenOver {
                decisions: length(part),
                game_seed: part.seed.0.to_vec(),
            })
            .collect(),
    })
}

/// The start of a game that takes over these actions.
///
/// # Errors
/// The first invalid field.
pub fn start_from_proto(
    start: &v1::GameStart,
    actions: &[ActionId],
    rules: &RuleSet,
) -> Result<GameStart, FieldProblem> {
    let script = (start.scripted.as_ref())
        .map(|script| script_from_proto(script, rules))
        .transpose()?;
    let branch = (start.branched_from.as_ref())
        .map(|point| branch(point, &start.taken_over, actions))
        .transpose()?;
    Ok(GameStart { script, branch })
}

fn branch(
    point: &v1::BranchPoint,
    parts: &[v1::TakenOver],
    mut actions: &[ActionId],
) -> Result<Branch, FieldProblem> {
    let problem = |message: &str| FieldProblem::new("taken_over", message);
    let mut taken_over = Vec::with_capacity(parts.len());
    for part in parts {
        let count = usize::try_from(part.decisions).unwrap_or(usize::MAX);
        let (own, rest) = actions
            .split_at_checked(count)
            .ok_or_else(|| problem("it has fewer decisions than it states"))?;
        actions = rest;
        let seed = part.game_seed.as_slice().try_into();
        taken_over.push(TakenOver {
            seed: Seed(seed.map_err(|_| problem("a game seed has 32 bytes"))?),
            actions: own.to_vec(),
        });
    }
    if taken_over.is_empty() || !actions.is_empty() {
        return Err(problem("it has more decisions than it states"));
    }
    Ok(Branch {
        game: Id::parse(&point.game_id)
            .ok_or_else(|| FieldProblem::new("game_id", "32 hexadecimal digits"))?,
        same_deals: point.same_deals,
        taken_over,
    })
}

fn length(part: &TakenOver) -> u64 {
    u64::try_from(part.actions.len()).unwrap_or(u64::MAX)
}
