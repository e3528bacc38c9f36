//! The players of `chefshat agent` and `chefshat tournament join`: a built-in agent or a language
//! model.

use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::{AgentNameError, MonteCarlo, NamedAgent};
use chefshat_client::Agent;
use serde_json::Value;

use crate::CommandError;
use crate::kind::KindArg;
use crate::llm::{self, Endpoint, LanguageModel, LlmArgs};
use crate::numbers::grouped;
use crate::remote::{RemoteAgent, offered_agents, seed_for};

/// A player as named on the command line.
#[derive(Debug, Clone, Copy)]
pub(super) enum PlayerArg {
    BuiltIn(NamedAgent),
    Llm,
}

/// A player of one or more games.
pub(super) enum Player {
    BuiltIn(Box<RemoteAgent>),
    Model(Box<LanguageModel>),
}

impl PlayerArg {
    /// The kind of participant that it is.
    pub(super) fn kind(self) -> KindArg {
        match self {
            Self::BuiltIn(_) => KindArg::Agent,
            Self::Llm => KindArg::Model,
        }
    }

    /// Its display name if none is given.
    pub(super) fn display_name(self, llm: &LlmArgs) -> String {
        match self {
            Self::BuiltIn(NamedAgent::Kind(kind)) => kind.name().to_owned(),
            Self::BuiltIn(NamedAgent::MonteCarlo(_)) => MonteCarlo::NAME.to_owned(),
            Self::Llm => llm.display_name(),
        }
    }

    /// What makes the players of games. `seed`: for repeatable games; `pace`: how long a built-in
    /// agent waits before each decision.
    ///
    /// # Errors
    /// What is said about the model fits no built-in agent, or cannot be used.
    pub(super) fn players(
        self,
        llm: &LlmArgs,
        seed: Option<u64>,
        pace: Duration,
    ) -> Result<Players<'_>, CommandError> {
        let source = match self {
            Self::BuiltIn(_) if llm.names_a_model() => {
                return Err("--endpoint and --model are for the agent llm".into());
            }
            Self::BuiltIn(agent) => Source::BuiltIn(agent),
            Self::Llm => Source::Model(llm, llm.endpoint(seed)?),
        };
        Ok(Players { source, seed, pace })
    }
}

/// Makes players.
pub(super) struct Players<'a> {
    source: Source<'a>,
    seed: Option<u64>,
    pace: Duration,
}

enum Source<'a> {
    BuiltIn(NamedAgent),
    Model(&'a LlmArgs, Arc<Endpoint>),
}

impl Players<'_> {
    /// Asks a model a first question, before it takes a seat.
    ///
    /// # Errors
    /// It cannot be asked.
    pub(super) async fn check(&self) -> Result<(), CommandError> {
        match &self.source {
            Source::BuiltIn(_) => Ok(()),
            Source::Model(_, endpoint) => Ok(endpoint.check().await?),
        }
    }

    /// A player; its choices depend on `purpose` and the seed.
    pub(super) fn player(&self, purpose: &str) -> Player {
        let seed = seed_for(purpose, self.seed);
        match &self.source {
            Source::BuiltIn(agent) => RemoteAgent::named(*agent, seed, self.pace).into(),
            Source::Model(llm, endpoint) => {
                let model = llm.agent(endpoint.clone(), seed);
                Player::Model(model.into())
            }
        }
    }
}

/// Parses a player; the names of built-in agents and `llm`.
pub(super) fn player_arg(name: &str) -> Result<PlayerArg, String> {
    if name == llm::NAME {
        return Ok(PlayerArg::Llm);
    }
    name.parse()
        .map(PlayerArg::BuiltIn)
        .map_err(|error| match error {
            AgentNameError::Unknown(_) => {
                format!("use one of {}, {}", offered_agents(), llm::NAME)
            }
            AgentNameError::MonteCarlo(error) => error.to_string(),
        })
}

impl From<RemoteAgent> for Player {
    fn from(agent: RemoteAgent) -> Self {
        Self::BuiltIn(agent.into())
    }
}

impl Player {
    /// Begins a game, which may end before its first event.
    pub(super) fn begin(&mut self) {
        if let Self::Model(model) = self {
            model.begin();
        }
    }

    /// The result of its last game in words, with what that has taken.
    pub(super) fn in_words(&self, result: &str) -> String {
        match self {
            Self::BuiltIn(_) => result.to_owned(),
            Self::Model(model) => {
                let spent = model.spent();
                let verdict = match model.has_played() {
                    true => "",
                    false => ": too many to call it the model's game",
                };
                let unrequested = match spent.unrequested {
                    0 => String::new(),
                    count => format!(", and {} that it was not asked for", grouped(count)),
                };
                let cost = (model.cost()).map_or_else(String::new, |cost| format!(" ({cost:.4})"));
                format!(
                    "{result}, {} tokens{cost} for {} decisions, {} of them without its answer{unrequested}{verdict}",
                    grouped(spent.tokens),
                    grouped(spent.decisions),
                    grouped(spent.fallbacks)
                )
            }
        }
    }

    /// The result of its last game for programs, with what that has taken.
    pub(super) fn as_json(&self, mut result: Value) -> Value {
        if let Self::Model(model) = self {
            let spent = model.spent();
            result["tokens"] = spent.tokens.into();
            result["decisions"] = spent.decisions.into();
            result["fallbacks"] = spent.fallbacks.into();
            result["unrequested"] = spent.unrequested.into();
            result["played_by_model"] = model.has_played().into();
            if let Some(cost) = model.cost() {
                result["cost"] = cost.into();
            }
        }
        result
    }

    /// Whether the last game is that of this player, and not of a fallback.
    pub(super) fn has_played(&self) -> bool {
        match self {
            Self::BuiltIn(_) => true,
            Self::Model(model) => model.has_played(),
        }
    }

    /// The agent that decides.
    pub(super) fn agent(&mut self) -> &mut dyn Agent {
        match self {
            Self::BuiltIn(agent) => agent.as_mut(),
            Self::Model(model) => model.as_mut(),
        }
    }
}
