//! The result of an agent in a task: what is published, and compared with those of others.

use std::collections::BTreeSet;

use chefshat_agents::NamedAgent;
use chefshat_record::language_model::ModelUsage;
use chefshat_record::outcome::Identity;
use chefshat_record::words::has_invisible;
use chefshat_tournament::statistics::{Moments, wilson95};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::check::{GameScore, repeatable};
use crate::task::{BENCHMARK, Commitment, Task};

/// The share of choices in a valid result that may be fallback decisions, from 0 to 1.
const MAX_FALLBACKS: f64 = 0.01;

/// What an agent says about itself.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentInfo {
    /// Its name in tables.
    pub name: String,
    /// How it plays and was made.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Where to read about it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub url: String,
}

impl AgentInfo {
    /// Whether its texts may be shown: a name of 1..=64 characters without invisible ones or blanks
    /// around it, which would make it look like another, and others of at most 2000 characters, none of
    /// which are control characters.
    pub fn is_printable(&self) -> bool {
        let fits =
            |text: &str, most| text.chars().count() <= most && !text.chars().any(char::is_control);
        !self.name.is_empty()
            && fits(&self.name, 64)
            && self.name.trim() == self.name
            && !has_invisible(&self.name)
            && fits(&self.description, 2000)
            && fits(&self.url, 2000)
    }
}

/// A mean over the games with its 95 % interval: 1.96 standard errors to either side, or Wilson's for
/// a share. The games have different deals, so they are independent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanWithInterval {
    /// The mean.
    pub mean: f64,
    /// The ends of the interval.
    pub interval95: [f64; 2],
}

impl MeanWithInterval {
    /// A share of games, with the interval of Wilson.
    fn of_share(successes: usize, trials: usize) -> Self {
        let interval = wilson95(successes as u64, trials as u64);
        Self {
            mean: successes as f64 / trials.max(1) as f64,
            interval95: [interval.low, interval.high],
        }
    }

    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut moments = Moments::default();
        values.for_each(|value| moments.add(value));
        let interval = moments.interval95();
        Self {
            mean: moments.mean(),
            interval95: [interval.low, interval.high],
        }
    }
}

/// The result of an agent in a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskResult {
    /// Name and version of the benchmark.
    pub benchmark: String,
    /// Name of the task.
    pub task: String,
    /// The commitment to the key of hidden deals; absent for the published ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deals_commitment: Option<Commitment>,
    /// The agent.
    pub agent: AgentInfo,
    /// Number of games that count.
    pub deals: usize,
    /// What makes it invalid; empty for a valid one.
    pub problems: Vec<String>,
    /// The mean of the games' points a Shift.
    pub points_per_shift: MeanWithInterval,
    /// Share of games won, from 0 to 1.
    pub games_won: MeanWithInterval,
    /// Place in the game, from 1.
    pub place: MeanWithInterval,
    /// The participants at the agent's seat, by the records; one in a valid result.
    pub played_by: Vec<String>,
    /// Decisions of the agent's seat.
    pub decisions: u64,
    /// Those of them with more than one legal action.
    pub choices: u64,
    /// Choices that the agent did not take itself: defaults after timeouts or invalid attempts,
    /// decisions of the room's substitute, and those of its own fallback.
    pub fallback_decisions: u64,
    /// Its invalid attempts.
    pub invalid_attempts: u64,
    /// Tokens and cost of a language model in all games, by its own account; absent for other agents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub language_model: Option<ModelUsage>,
    /// Median and 99th percentile of its decision times in milliseconds; null if none was measured.
    pub decision_ms: Option<[f64; 2]>,
    /// The keys of the servers that signed records, and "unsigned".
    pub signed_by: Vec<String>,
    /// SHA-256 of the hashes of the records' texts, in the order of the deals, in hexadecimal digits.
    pub records_sha256: String,
    /// Points a Shift of each deal, from the first; null where no game counts.
    pub by_deal: Vec<Option<f64>>,
}

impl TaskResult {
    /// The result of games, by deal; `None` where there is none, or one that does not count. At least
    /// two count.
    pub fn of(task: &Task, agent: AgentInfo, by_deal: &[Option<GameScore>]) -> Self {
        let games: Vec<&GameScore> = by_deal.iter().flatten().collect();
        let per_shift = |game: &GameScore| game.points as f64 / f64::from(game.shifts.max(1));
        let sum = |of: fn(&GameScore) -> u64| games.iter().copied().map(of).sum::<u64>();
        let choices = sum(|game| game.choices);
        let fallback_decisions = sum(|game| game.fallback_decisions);
        let played_by = distinct(games.iter().map(|game| in_words(&game.player)));
        let mut problems = Vec::new();
        if games.len() < task.deals {
            problems.push(format!("{} of {} deals", games.len(), task.deals));
        }
        if let [first, second, ..] = &*played_by {
            problems.push(format!(
                "several participants played, such as {first} and {second}"
            ));
        }
        let named = agent.name.parse::<NamedAgent>().ok();
        if let Some(named) = named.map(|named| named.name())
            && let Some(other) = (games.iter().map(|game| &game.player))
                .find(|player| !player.built_in || player.name != named)
        {
            let other = in_words(other);
            problems.push(format!(
                "{named} is the name of a built-in agent, but {other} played"
            ));
        }
        if fallback_decisions as f64 > MAX_FALLBACKS * choices as f64 {
            problems.push(format!(
                "{fallback_decisions} of {choices} choices were fallback decisions; at most one in a hundred may be"
            ));
        }
        let keys = games.iter().map(|game| game.signed_by);
        let signed_by =
            keys.map(|key| key.map_or_else(|| "unsigned".to_owned(), |key| key.to_string()));
        Self {
            benchmark: BENCHMARK.to_owned(),
            task: task.name.clone(),
            deals_commitment: task.deals_commitment(),
            agent,
            deals: games.len(),
            problems,
            points_per_shift: MeanWithInterval::of(games.iter().copied().map(per_shift)),
            games_won: MeanWithInterval::of_share(
                games.iter().filter(|game| game.place == 1).count(),
                games.len(),
            ),
            place: MeanWithInterval::of(games.iter().map(|game| f64::from(game.place))),
            played_by,
            decisions: sum(|game| game.decisions),
            choices,
            fallback_decisions,
            invalid_attempts: sum(|game| game.invalid_attempts),
            language_model: ModelUsage::sum(games.iter().map(|game| game.language_model)),
            decision_ms: times(&games),
            signed_by: distinct(signed_by),
            records_sha256: {
                let digests = games.iter().map(|game| game.record.bytes());
                let all = digests.fold(Sha256::new(), |all, digest| all.chain_update(digest));
                hex::encode(all.finalize())
            },
            by_deal: (by_deal.iter())
                .map(|game| game.as_ref().map(per_shift))
                .collect(),
        }
    }

    /// Whether it has all deals of the task, and nearly all decisions are the agent's.
    pub fn is_valid(&self) -> bool {
        self.problems.is_empty()
    }

    /// Whether both are results of the same task with the same deals.
    pub fn is_comparable(&self, other: &Self) -> bool {
        (&self.benchmark, &self.task, &self.deals_commitment)
            == (&other.benchmark, &other.task, &other.deals_commitment)
    }

    /// How many more points a Shift this agent has than another one, over the deals that both played:
    /// with the same cards, seat and opponents. `None` for results that are not comparable, or with fewer
    /// than two such deals.
    pub fn paired_difference(&self, other: &Self) -> Option<PairedDifference> {
        if !self.is_comparable(other) {
            return None;
        }
        let pairs = self.by_deal.iter().zip(&other.by_deal);
        let differences = pairs.filter_map(|(own, others)| Some((*own)? - (*others)?));
        let differences: Vec<f64> = differences.collect();
        (differences.len() > 1).then(|| PairedDifference {
            deals: differences.len(),
            points_per_shift: MeanWithInterval::of(differences.into_iter()),
        })
    }
}

/// The difference of two results, deal by deal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairedDifference {
    /// Number of deals that both played.
    pub deals: usize,
    /// Difference of points a Shift.
    pub points_per_shift: MeanWithInterval,
}

/// A participant, without what could not be shown.
fn in_words(player: &Identity) -> String {
    let name: String = (player.name.chars())
        .filter(|letter| !letter.is_control())
        .collect();
    let key = &player.name_fingerprint;
    match player.built_in {
        true if repeatable(player).is_some() => format!("the built-in agent {name}"),
        true => format!("{name}, built in, by its own account"),
        false if key.is_empty() => name,
        false => format!("{name} ({key})"),
    }
}

/// The texts without repetitions, in alphabetical order.
fn distinct(texts: impl Iterator<Item = String>) -> Vec<String> {
    let texts: BTreeSet<String> = texts.collect();
    texts.into_iter().collect()
}

/// Median and 99th percentile of the decision times, in milliseconds.
fn times(games: &[&GameScore]) -> Option<[f64; 2]> {
    let all = games.iter().flat_map(|game| &game.decision_times_us);
    let mut all: Vec<u64> = all.copied().collect();
    all.sort_unstable();
    let last = all.len().checked_sub(1)?;
    Some([50, 99].map(|percent| all[last * percent / 100] as f64 / 1000.0))
}
