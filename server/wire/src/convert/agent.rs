//! The built-in agents of rooms and tournaments by name, with the bounds of their searches.

use std::time::Duration;

use chefshat_agents::{AgentNameError, Budget, NamedAgent};
use chefshat_record::convert::FieldProblem;

/// The largest budget of a search of a built-in agent in a room, as time.
pub const MAX_SEARCH_BUDGET: Duration = Duration::from_secs(1);
/// The largest budget of a search of a built-in agent in a room, as rollouts.
pub const MAX_SEARCH_ROLLOUTS: u64 = 5_000;

/// The built-in agent with this name; `None` for the empty name. Its budget is not checked: what is
/// stored stays readable if the bounds of requests change.
///
/// # Errors
/// There is no such agent.
pub fn agent_from_proto(
    field: &'static str,
    name: &str,
) -> Result<Option<NamedAgent>, FieldProblem> {
    if name.is_empty() {
        return Ok(None);
    }
    let agent = (name.parse())
        .map_err(|error: AgentNameError| FieldProblem::new(field, error.to_string()))?;
    Ok(Some(agent))
}

/// Checks the budget of an agent that a request names.
///
/// # Errors
/// It is too large for a server.
pub fn check_budget(field: &'static str, agent: NamedAgent) -> Result<(), FieldProblem> {
    let fits = match agent.search().map(|plays| plays.budget) {
        None => true,
        Some(Budget::Time(time)) => time <= MAX_SEARCH_BUDGET,
        Some(Budget::Rollouts(rollouts)) => rollouts <= MAX_SEARCH_ROLLOUTS,
    };
    if fits {
        return Ok(());
    }
    let ms = MAX_SEARCH_BUDGET.as_millis();
    let words = format!(
        "{agent}: on a server a search takes at most {ms}ms or {MAX_SEARCH_ROLLOUTS} rollouts"
    );
    Err(FieldProblem::new(field, words))
}

/// Checks that an agent can play where cards are real.
///
/// # Errors
/// It searches, which needs to know how the cards were dealt.
pub fn check_real_cards(field: &'static str, agent: NamedAgent) -> Result<(), FieldProblem> {
    match agent.search() {
        None => Ok(()),
        Some(_) => Err(FieldProblem::new(
            field,
            "monte_carlo does not play at tables with real cards; choose trained",
        )),
    }
}
