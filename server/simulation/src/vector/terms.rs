//! The part of a setup that the state of a game depends on, and what differs between two.

use std::num::NonZeroU32;

use chefshat_agents::AgentKind;
use chefshat_engine::{BySeat, RewardScheme, RuleSet};
use thiserror::Error;

use super::opponent::Opponent;

/// Which decisions of its seats the client takes.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum Decisions {
    /// All.
    #[default]
    All,
    /// Only turns.
    Turns {
        /// The agent for other decisions; `None` for the default decision.
        others: Option<AgentKind>,
    },
}

/// How illegal actions of the client are handled. The limit of attempts applies to built-in agents
/// too.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum InvalidActions {
    /// The step fails.
    #[default]
    Error,
    /// The action counts as an invalid attempt, and the decision is asked again.
    AskAgain {
        /// Attempts after which the default decision is taken; `None` for no limit.
        limit: Option<NonZeroU32>,
    },
}

/// What differs between the terms of a state and those of other games.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
#[error("the state is from games with another {field}: {saved}, here {here}")]
pub struct Difference {
    /// What differs.
    pub field: &'static str,
    /// Its value in the state.
    pub saved: String,
    /// Its value in these games.
    pub here: String,
}

/// The options that decide what a state contains, or which of its values are valid. Episodes, the
/// number of games, seeds, starts, and whether forced decisions are skipped are not among them: they
/// may differ where a state is restored, and apply from there. So may the agents, unless games are
/// recorded.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub(super) struct Terms {
    pub(super) rules: RuleSet,
    pub(super) agents: BySeat<Option<Opponent>>,
    pub(super) scheme: Option<RewardScheme>,
    pub(super) decisions: Decisions,
    pub(super) invalid: InvalidActions,
    pub(super) statistics: bool,
    pub(super) records: bool,
    /// Width of the history column.
    pub(super) history: u16,
}

impl Terms {
    /// The first difference to the terms of other games, with both values.
    pub(super) fn difference(&self, here: &Terms) -> Option<Difference> {
        let (saved_rules, rules) = (self.rules.spec(), here.rules.spec());
        let agents = |terms: &Terms| {
            let names = terms.agents.values();
            let names =
                names.map(|agent| agent.map_or("client".to_owned(), |agent| agent.to_string()));
            names.collect::<Vec<_>>().join(", ")
        };
        let scheme = |terms: &Terms| terms.scheme.map_or("none", RewardScheme::name);
        macro_rules! differs {
            ($field:literal, $saved:expr, $here:expr) => {
                if $saved != $here {
                    return Some(Difference {
                        field: $field,
                        saved: format!("{:?}", $saved),
                        here: format!("{:?}", $here),
                    });
                }
            };
        }
        differs!("number of players", saved_rules.players, rules.players);
        differs!("number of faces", saved_rules.faces, rules.faces);
        differs!("number of jokers", saved_rules.jokers, rules.jokers);
        differs!("target", saved_rules.stop, rules.stop);
        differs!("list of points", saved_rules.points, rules.points);
        differs!("exchange", saved_rules.exchange, rules.exchange);
        let specials = (saved_rules.special_actions, rules.special_actions);
        differs!("special_actions", specials.0, specials.1);
        differs!("opening", saved_rules.opening, rules.opening);
        differs!("opening_pass", saved_rules.opening_pass, rules.opening_pass);
        differs!("pass_scope", saved_rules.pass_scope, rules.pass_scope);
        let idle = (saved_rules.max_idle_pizzas, rules.max_idle_pizzas);
        differs!("max_idle_pizzas", idle.0, idle.1);
        differs!("max_turns", saved_rules.max_turns, rules.max_turns);
        if here.records {
            differs!("list of seats", agents(self), agents(here));
        }
        differs!("reward scheme", scheme(self), scheme(here));
        differs!("choice of decisions", self.decisions, here.decisions);
        differs!("rule for invalid actions", self.invalid, here.invalid);
        differs!("shift_statistics", self.statistics, here.statistics);
        differs!("records", self.records, here.records);
        differs!("history", self.history, here.history);
        None
    }
}
