//! The folder of a submission: `manifest.json` says what it is, `records/` has the record of each
//! deal (`0000.jsonl`, …), and `result.json` what they show.

use std::fmt::Display;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use chefshat_benchmark::{
    AgentInfo, BENCHMARK, Commitment, DealsKey, GameScore, Task, TaskResult, check,
};
use chefshat_cli::error::CommandError;
use chefshat_cli::progress;
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::jsonl;
use chefshat_record::words::printable;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const MANIFEST: &str = "manifest.json";
const RESULT: &str = "result.json";
/// Bytes of the longest record that is read: a Shift has 30,000, a game of ten thousand turns a few
/// millions.
const MAX_RECORD: u64 = 64 << 20;
/// Lines of the longest record that is read: a game of ten thousand turns has 25,000. Those of all deals
/// are in memory on as many cores as there are.
const MAX_LINES: usize = 100_000;
/// Bytes of the longest other file.
const MAX_JSON: u64 = 4 << 20;
/// What is wrong with a result that is read from a file.
const NOT_CHECKED: &str = "read from a file and not checked; name the folder";
/// Records that are named one by one when they do not count.
const NAMED: usize = 5;

/// What a folder is a result of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    benchmark: String,
    task: String,
    /// The commitment to the key of hidden deals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deals_commitment: Option<Commitment>,
    agent: AgentInfo,
    /// The built-in agent, network file or command that plays.
    command: String,
}

impl Manifest {
    /// The manifest of a folder, and its task.
    fn read(folder: &Path) -> Result<(Self, &'static Task), CommandError> {
        let manifest: Self = read_json(&folder.join(MANIFEST)).map_err(|error| {
            format!("{error}; a submission is a folder that `chefshat bench run` wrote")
        })?;
        check_agent(folder, &manifest.agent)?;
        let task = task_of(&manifest.benchmark, &manifest.task)?;
        Ok((manifest, task))
    }
}

/// A folder of records with its manifest.
pub(super) struct Folder {
    path: PathBuf,
    pub(super) task: Task,
    manifest: Manifest,
    /// Held by the run that adds records.
    lock: Option<File>,
}

impl Folder {
    /// Opens the folder of a submission with the deals of a key, or with the published ones.
    pub(super) fn open(path: &Path, key: Option<&DealsKey>) -> Result<Self, CommandError> {
        let (manifest, task) = Manifest::read(path)?;
        Self::of(path, manifest, task.with_deals(key))
    }

    fn of(path: &Path, manifest: Manifest, task: Task) -> Result<Self, CommandError> {
        check_deals(path, manifest.deals_commitment.as_ref(), &task)?;
        Ok(Self {
            path: path.to_owned(),
            task,
            manifest,
            lock: None,
        })
    }

    /// Opens the folder, or creates it. One that has games of something else, or to which another run
    /// adds games, is refused. An agent that connects may join with its name, so it keeps that.
    pub(super) fn create(
        path: &Path,
        task: &Task,
        agent: AgentInfo,
        command: String,
        connects: bool,
    ) -> Result<Self, CommandError> {
        check_agent(path, &agent)?;
        let named = |error| format!("{}: {error}; name another with --out", path.display());
        fs::create_dir_all(path).map_err(named)?;
        let folder = Self {
            lock: locked(path)?,
            path: path.to_owned(),
            task: task.clone(),
            manifest: Manifest {
                benchmark: BENCHMARK.to_owned(),
                task: task.name.clone(),
                deals_commitment: task.deals_commitment(),
                agent,
                command,
            },
        };
        let file = path.join(MANIFEST);
        if file.exists()
            && let (earlier, _) = Manifest::read(path)?
            && folder.played() > 0
        {
            check_deals(path, earlier.deals_commitment.as_ref(), task)?;
            let is_same =
                earlier.task == folder.manifest.task && earlier.command == folder.manifest.command;
            if !is_same {
                let (task, by) = (&earlier.task, &earlier.command);
                return Err(format!(
                    "{} has games of the task {task}, played by {by}; name another folder with --out",
                    path.display()
                )
                .into());
            }
            if connects && earlier.agent.name != folder.manifest.agent.name {
                let (path, name) = (path.display(), &earlier.agent.name);
                return Err(format!(
                    "{path} has games of {name:?}; give that with --name, or name another folder with --out"
                )
                .into());
            }
        }
        if folder.lock.is_some() {
            // Files that a killed run left half written would be published with the folder.
            jsonl::remove_unfinished(path).map_err(named)?;
        }
        write_json(&file, &folder.manifest)?;
        Ok(folder)
    }

    /// The file of a deal's record.
    pub(super) fn record(&self, deal: usize) -> PathBuf {
        self.path.join("records").join(format!("{deal:04}.jsonl"))
    }

    /// The name of the agent.
    pub(super) fn name(&self) -> &str {
        &self.manifest.agent.name
    }

    /// The number of deals with a record.
    pub(super) fn played(&self) -> usize {
        self.task.deals - self.missing(self.task.deals).len()
    }

    /// The deals without a record, of the first `deals`.
    pub(super) fn missing(&self, deals: usize) -> Vec<usize> {
        (0..deals)
            .filter(|deal| !self.record(*deal).exists())
            .collect()
    }

    /// The game of a deal, if it has a record.
    pub(super) fn game(&self, deal: usize) -> Result<Option<GameScore>, CommandError> {
        let path = self.record(deal);
        let Ok(metadata) = fs::metadata(&path) else {
            return Ok(None);
        };
        if !metadata.is_file() || metadata.len() > MAX_RECORD {
            let path = path.display();
            return Err(format!("{path}: no game of a task has such a record").into());
        }
        let record = jsonl::read_record_of(&path, MAX_LINES)?;
        let score = check(&self.task, deal, &record);
        Ok(Some(score.map_err(|problem| {
            format!("{}: {problem}", path.display())
        })?))
    }

    /// Checks all records. Those that do not count are named in the result.
    pub(super) fn check(&self) -> Result<TaskResult, CommandError> {
        let bar = progress::of_items(self.task.deals as u64, "deals");
        let games: Vec<_> = (0..self.task.deals)
            .into_par_iter()
            .map(|deal| {
                let game = self.game(deal);
                bar.inc(1);
                game
            })
            .collect();
        bar.finish_and_clear();
        let mut refused = Vec::new();
        let mut by_deal = Vec::new();
        for game in games {
            by_deal.push(game.unwrap_or_else(|error| {
                refused.push(error.to_string());
                None
            }));
        }
        let last = by_deal.iter().rposition(Option::is_some);
        by_deal.truncate(last.map_or(0, |last| last + 1));
        if by_deal.iter().flatten().count() < 2 {
            let folder = self.path.display();
            return Err(match refused.first() {
                None => format!("{folder} has fewer than two records: play first").into(),
                Some(first) => {
                    format!("{folder} has fewer than two records that count: {first}").into()
                }
            });
        }
        let mut result = TaskResult::of(&self.task, self.manifest.agent.clone(), &by_deal);
        let more = refused.len().saturating_sub(NAMED);
        refused.truncate(NAMED);
        result.problems.extend(refused);
        if more > 0 {
            result
                .problems
                .push(format!("{more} more records do not count"));
        }
        Ok(result)
    }

    /// Writes the result beside the records.
    pub(super) fn write_result(&self, result: &TaskResult) -> Result<(), CommandError> {
        write_json(&self.path.join(RESULT), result)
    }
}

/// The result of a folder, checked now, with the key if its deals are hidden; or that of a file, which
/// is marked.
pub(super) fn read_result(path: &Path, key: Option<&DealsKey>) -> Result<TaskResult, CommandError> {
    if path.is_dir() {
        let (manifest, task) = Manifest::read(path)?;
        let key = key.filter(|_| manifest.deals_commitment.is_some());
        return Folder::of(path, manifest, task.with_deals(key))?.check();
    }
    let mut result: TaskResult = read_json(path)?;
    check_agent(path, &result.agent)?;
    let task = task_of(&result.benchmark, &result.task)?;
    // The agent that it is compared with plays as many.
    if result.by_deal.len() > task.deals {
        let (path, deals) = (path.display(), task.deals);
        return Err(format!("{path}: the task has {deals} deals").into());
    }
    result.problems = vec![NOT_CHECKED.to_owned()];
    Ok(result)
}

/// The task of a manifest or a result.
fn task_of(benchmark: &str, task: &str) -> Result<&'static Task, CommandError> {
    let named = Task::named(task).filter(|_| benchmark == BENCHMARK);
    Ok(named.ok_or_else(|| {
        format!("this version of chefshat has no task {task:?} of a benchmark {benchmark:?}")
    })?)
}

/// Refuses a folder with other deals than those of the task.
fn check_deals(path: &Path, deals: Option<&Commitment>, task: &Task) -> Result<(), CommandError> {
    let wanted = task.deals_commitment();
    if deals == wanted.as_ref() {
        return Ok(());
    }
    let path = path.display();
    Err(match (deals, wanted) {
        (Some(deals), None) => format!(
            "{path} has hidden deals; name the file of their key with --deals-key (commitment {deals})"
        ),
        (Some(deals), Some(other)) => format!(
            "{path} has the hidden deals of another key, with the commitment {deals}, not {other}"
        ),
        (None, _) => format!("{path} has the published deals, not those of --deals-key"),
    }
    .into())
}

/// Refuses texts that cannot be shown.
fn check_agent(path: &Path, agent: &AgentInfo) -> Result<(), CommandError> {
    if agent.is_printable() {
        return Ok(());
    }
    let path = path.display();
    Err(format!(
        "{path}: the name of an agent has 1 to 64 characters, none of them invisible, and no blanks around them; \
         its description and its url have at most 2000, and no control characters"
    )
    .into())
}

fn read_json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T, String> {
    let problem = |error: &dyn Display| format!("{}: {error}", path.display());
    let metadata = fs::metadata(path).map_err(|error| problem(&error))?;
    if !metadata.is_file() || metadata.len() > MAX_JSON {
        return Err(problem(&"not a file of a submission"));
    }
    let text = fs::read(path).map_err(|error| problem(&error))?;
    // An error quotes the file.
    serde_json::from_slice(&text).map_err(|error| problem(&printable(&error.to_string())))
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CommandError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(&serde_json::to_vec_pretty(value)?)?;
    file.write_all(b"\n")?;
    Ok(file.finish()?)
}

/// Locks a folder, where folders can be opened and locked.
fn locked(path: &Path) -> Result<Option<File>, CommandError> {
    if !cfg!(unix) {
        return Ok(None);
    }
    let folder = File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    match folder.try_lock() {
        Err(TryLockError::WouldBlock) => Err(format!(
            "another run adds games to {}; wait for it, or name another with --out",
            path.display()
        )
        .into()),
        Ok(()) => Ok(Some(folder)),
        // Some file systems have no locks.
        Err(TryLockError::Error(_)) => Ok(None),
    }
}
