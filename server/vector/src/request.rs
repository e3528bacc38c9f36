//! Requests after the setup: actions, resets, and states.

use chefshat_engine::ActionId;
use chefshat_proto::v1::{self, vector_reset};
use chefshat_record::convert::FieldProblem;
use chefshat_simulation::vector::{Batch, Seeds, StateError, VectorGames};

use crate::error::RequestError;
use crate::setup::{Limits, seeds_from_proto};
use crate::states::{numbers, states_from_proto};

/// A request after the setup whose answer is a batch.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// The decisions of a batch.
    Actions(Vec<ActionId>),
    /// Games to begin again.
    Reset(Reset),
    /// Games to replace by saved ones.
    Restore(v1::VectorRestore),
}

/// The games to reset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reset {
    /// Some games, which continue with their next seeds.
    Some(Vec<u32>),
    /// All games: with the first of these seeds, or with their next ones.
    All(Option<Seeds>),
}

impl Request {
    /// Reads the decisions of a batch.
    ///
    /// # Errors
    /// The column has a partial entry.
    pub fn actions(message: &v1::VectorActions) -> Result<Self, RequestError> {
        let (actions, rest) = message.actions.as_chunks::<2>();
        if !rest.is_empty() {
            let words = "the column is incomplete: 2 bytes for each action";
            let problem = FieldProblem::new("actions", words);
            return Err(RequestError::field("ACTIONS_REFUSED", &problem));
        }
        let actions = actions.iter();
        Ok(Self::Actions(
            actions
                .map(|bytes| ActionId::new(u16::from_le_bytes(*bytes)))
                .collect(),
        ))
    }

    /// Reads a reset.
    ///
    /// # Errors
    /// The column of games has a partial entry, or a field for all games comes with a list of
    /// games.
    pub fn reset(message: &v1::VectorReset, limits: &Limits) -> Result<Self, RequestError> {
        reset_from_proto(message, limits)
            .map(Self::Reset)
            .map_err(|problem| RequestError::field("RESET_REFUSED", &problem))
    }

    /// Executes the request and returns the next batch.
    ///
    /// # Errors
    /// The actions, games or states cannot be used.
    pub fn execute(self, games: &mut VectorGames) -> Result<Batch, RequestError> {
        match self {
            Self::Actions(actions) => Ok(games.step(&actions)?),
            Self::Reset(Reset::All(seeds)) => Ok(games.reset(seeds)),
            Self::Reset(Reset::Some(some)) => Ok(games.reset_some(&some)?),
            Self::Restore(message) => restore(&message, games),
        }
    }
}

fn restore(message: &v1::VectorRestore, games: &mut VectorGames) -> Result<Batch, RequestError> {
    let refused = |problem| RequestError::field("STATES_REFUSED", &problem);
    let chosen = numbers("games", &message.games).map_err(refused)?;
    let (given, states) = (chosen.len(), message.states.len());
    if given != states {
        // Before any is read.
        return Err(StateError::Count {
            games: given,
            states,
        }
        .into());
    }
    let states = states_from_proto(&message.states).map_err(refused)?;
    Ok(games.restore(&chosen, states)?)
}

fn reset_from_proto(message: &v1::VectorReset, limits: &Limits) -> Result<Reset, FieldProblem> {
    let games = numbers("games", &message.games)?;
    let seeds = match &message.seeds {
        None => None,
        Some(_) if !message.all => {
            let words = "seeds can only be given for a reset of all games; set `all`";
            return Err(FieldProblem::new("seeds", words));
        }
        Some(vector_reset::Seeds::BaseSeed(base)) => Some(Seeds::Base(*base)),
        Some(vector_reset::Seeds::GameSeeds(seeds)) => Some(seeds_from_proto(seeds, limits)?),
    };
    if message.all && !games.is_empty() {
        let words = "list games or set `all`, not both";
        return Err(FieldProblem::new("games", words));
    }
    if message.all {
        return Ok(Reset::All(seeds));
    }
    Ok(Reset::Some(games))
}
