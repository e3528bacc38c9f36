//! The result of an agent in a task: what is published, and compared with those of others.

use chefshat_tournament::statistics::{Moments, wilson95};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::check::GameScore;
use crate::task::{BENCHMARK, Task};

/// The share of fallback decisions in a valid result, from 0 to 1.
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

/// A mean over the games with its 95 % interval: 1.96 standard errors to either side, or Wilson's for
/// a share. The games have different deals, so they are independent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The mean.
    pub mean: f64,
    /// The ends of the interval.
    pub interval95: [f64; 2],
}

impl Figure {
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
    /// The agent.
    pub agent: AgentInfo,
    /// Number of deals, the first of the task.
    pub deals: usize,
    /// What makes it invalid; empty for a valid one.
    pub problems: Vec<String>,
    /// Points a Shift.
    pub points_per_shift: Figure,
    /// Share of games won, from 0 to 1.
    pub games_won: Figure,
    /// Place in the game, from 1.
    pub place: Figure,
    /// Decisions of the agent's seat.
    pub decisions: u64,
    /// Those that it did not take itself: defaults after timeouts or invalid attempts, decisions of
    /// the room's substitute, and those of its own fallback.
    pub fallback_decisions: u64,
    /// Its invalid attempts.
    pub invalid_attempts: u64,
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
    /// The result of games, by deal; `None` where there is none, or one that does not count.
    pub fn of(task: &Task, agent: AgentInfo, by_deal: &[Option<GameScore>]) -> Self {
        let games: Vec<&GameScore> = by_deal.iter().flatten().collect();
        let per_shift = |game: &GameScore| game.points as f64 / f64::from(game.shifts.max(1));
        let sum = |of: fn(&GameScore) -> u64| games.iter().copied().map(of).sum::<u64>();
        let (decisions, fallback_decisions) = (
            sum(|game| game.decisions),
            sum(|game| game.fallback_decisions),
        );
        let mut problems = Vec::new();
        if games.len() < task.deals {
            problems.push(format!("{} of {} deals", games.len(), task.deals));
        }
        if fallback_decisions as f64 > MAX_FALLBACKS * decisions as f64 {
            problems.push(format!(
                "{fallback_decisions} of {decisions} decisions were taken for it; at most one in a hundred may be"
            ));
        }
        let mut signed_by: Vec<String> = games
            .iter()
            .map(|game| {
                (game.signed_by).map_or_else(|| "unsigned".to_owned(), |key| key.to_string())
            })
            .collect();
        signed_by.sort_unstable();
        signed_by.dedup();
        Self {
            benchmark: BENCHMARK.to_owned(),
            task: task.name.clone(),
            agent,
            deals: games.len(),
            problems,
            points_per_shift: Figure::of(games.iter().copied().map(per_shift)),
            games_won: Figure::of_share(
                games.iter().filter(|game| game.place == 1).count(),
                games.len(),
            ),
            place: Figure::of(games.iter().map(|game| f64::from(game.place))),
            decisions,
            fallback_decisions,
            invalid_attempts: sum(|game| game.invalid_attempts),
            decision_ms: times(&games),
            signed_by,
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

    /// How many more points a Shift this agent has than another one, over the deals that both played:
    /// with the same cards, seat and opponents. `None` for results of different tasks.
    pub fn paired_difference(&self, other: &Self) -> Option<PairedDifference> {
        if (&self.benchmark, &self.task) != (&other.benchmark, &other.task) {
            return None;
        }
        let pairs = self.by_deal.iter().zip(&other.by_deal);
        let differences = pairs.filter_map(|(own, others)| Some((*own)? - (*others)?));
        let differences: Vec<f64> = differences.collect();
        Some(PairedDifference {
            deals: differences.len(),
            points_per_shift: Figure::of(differences.into_iter()),
        })
    }
}

/// The difference of two results, deal by deal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairedDifference {
    /// Number of deals that both played.
    pub deals: usize,
    /// Difference of points a Shift.
    pub points_per_shift: Figure,
}

/// Median and 99th percentile of the decision times, in milliseconds.
fn times(games: &[&GameScore]) -> Option<[f64; 2]> {
    let all = games.iter().flat_map(|game| &game.decision_times_us);
    let mut all: Vec<u64> = all.copied().collect();
    all.sort_unstable();
    let last = all.len().checked_sub(1)?;
    Some([50, 99].map(|percent| all[last * percent / 100] as f64 / 1000.0))
}
