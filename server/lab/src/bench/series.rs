//! `chefshat bench series`: several agents play a task in rounds, each with the same deals for all.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use chefshat_benchmark::{AgentInfo, Task};
use chefshat_cli::error::{CommandError, tell};
use chefshat_cli::numbers::counted;
use chefshat_cli::stops::Stops;
use chefshat_cli::toml_file;
use chefshat_examiner::AgentCommand;
use chefshat_record::language_model::ModelUsage;
use clap::Args;
use rayon::prelude::*;
use tokio::task::spawn_blocking;
use tokio_util::task::TaskTracker;
use toml::de::{DeTable, DeValue};

use super::deals_key::DealsKeyArg;
use super::folder::Folder;
use super::run::{deals_of, task_named};
use super::{hosted, offline, report};
use crate::compare::Entrant;

const HELP: &str = "\
The file names the task and the agents, as `chefshat bench run` takes them:

  task = \"language_model\"

  [[agents]]
  name = \"qwen3\"
  command = [\"chefshat\", \"agent\", \"llm\", \"--endpoint\", \"http://127.0.0.1:8080/v1\", \"--model\", \"qwen3\",
             \"--price\", \"0.4,1.6\", \"--server\", \"{url}\", \"--code\", \"{code}\"]

  [[agents]]
  agent = \"trained\"

In each round, every agent plays the next deals. Each has a folder in --out, which `submit` and `table` accept. The same command resumes an \
interrupted series, and with a higher --budget also one that its budget ended.

Exit code: 0 if all games were played, or all that the budget allows.";

/// Most rounds of a series without a budget, and the least deals of such a round.
const ROUNDS: usize = 20;
const LEAST_DEALS: usize = 10;

/// Play a task with several agents, such as language models, within a budget, and compare them.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Series {
    /// The TOML file with the task and the agents.
    file: PathBuf,
    /// The folder with a folder for each agent.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Play only this many of the deals. No result is valid then.
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    deals: Option<u64>,
    #[command(flatten)]
    deals_key: DealsKeyArg,
    /// Games of an agent that are open at a time; with a budget, also the deals of a round. The time
    /// of a decision runs while the agent is busy with another game.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    parallel: u16,
    /// Stop before the games of all language models cost more than this, by their annotations, in the
    /// currency of --price. Includes the games already in --out.
    #[arg(long, value_name = "COST", value_parser = budget)]
    budget: Option<f64>,
    /// A server to play on; see `chefshat bench run`.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn budget(text: &str) -> Result<f64, &'static str> {
    let number = text.parse::<f64>().ok();
    let number = number.filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or("give a number above 0")
}

impl Series {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let text = fs::read_to_string(&self.file);
        let text = text.map_err(|error| format!("{}: {error}", self.file.display()))?;
        let plan = Plan::parse(&text);
        let plan = plan.map_err(|problem| format!("{}: {problem}", self.file.display()))?;
        let deals = deals_of(plan.task, self.deals)?;
        let task = plan.task.with_deals(self.deals_key.key()?.as_ref());
        let mut players: Vec<Player> = Vec::new();
        for agent in plan.agents {
            let name = agent.label().to_owned();
            let player = agent.player(&task, &self.out);
            let player = player.map_err(|error| format!("{name}: {error}"))?;
            if players.iter().any(|it| it.name() == player.name()) {
                return Err(format!("two agents have the name {}", player.name()).into());
            }
            players.push(player);
        }
        let ending = Ending::default();
        let mut stops = Stops::catch()?;
        let is_complete = tokio::select! {
            is_complete = self.play(&mut players, deals, &ending) => is_complete,
            // Returning ends the agents' processes.
            stop = stops.next() => {
                ending.stopped.store(true, Ordering::Relaxed);
                tell(format_args!("the records are kept; the same command resumes"));
                ending.closing.close();
                ending.closing.wait().await;
                return Ok(stop.exit_code());
            }
        };
        let checking = spawn_blocking(move || self.finish(&task, &players, is_complete));
        tokio::select! {
            finished = checking => finished?,
            stop = stops.next() => Ok(stop.exit_code()),
        }
    }

    /// Plays all deals, or until the budget ends. Returns whether nothing has failed.
    async fn play(&self, players: &mut [Player], deals: usize, ending: &Ending) -> bool {
        let parallel = usize::from(self.parallel);
        let round = match self.budget {
            Some(_) => parallel,
            None => parallel.max(LEAST_DEALS).max(deals.div_ceil(ROUNDS)),
        };
        if self.budget.is_some() {
            for player in &mut *players {
                let kept = (0..deals).filter(|deal| player.folder.record(*deal).exists());
                player.read(kept.collect()).await;
            }
        }
        for first in (0..deals).step_by(round) {
            let until = deals.min(first + round);
            let missing = |player: &Player| {
                let missing = player.folder.missing(until).into_iter();
                missing.filter(|deal| *deal >= first).collect::<Vec<_>>()
            };
            if let Some(budget) = self.budget {
                let spent: f64 = players.iter().map(|player| player.costs.sum()).sum();
                let going_on = players.iter().filter(|player| !player.has_ended);
                let next =
                    going_on.map(|player| missing(player).len() as f64 * player.costs.highest());
                let next: f64 = next.sum();
                if next > 0.0 && spent + next > budget {
                    tell(format_args!(
                        "the budget of {budget} ends the series: {spent:.4} is spent, and the next deals may cost {next:.4}"
                    ));
                    return players.iter().all(|player| player.has_all(first));
                }
            }
            for player in &mut *players {
                let missing = missing(player);
                if player.has_ended || missing.is_empty() {
                    continue;
                }
                let played = player.play(missing.clone(), parallel, self.server.as_deref(), ending);
                let played = played.await;
                if self.budget.is_some() {
                    player.read(missing).await;
                }
                player.note(played, deals);
            }
        }
        players.iter().all(|player| player.has_all(deals))
    }

    /// Checks what was played, and prints the table.
    fn finish(
        &self,
        task: &Task,
        players: &[Player],
        is_complete: bool,
    ) -> Result<ExitCode, CommandError> {
        let (mut results, mut failed) = (Vec::new(), !is_complete);
        for player in players {
            let checked = player.folder.check();
            let written = checked.and_then(|result| {
                let written = player.folder.write_result(&result);
                results.push(result);
                written
            });
            if let Err(error) = written {
                failed = true;
                tell(format_args!("{}: {error}", player.name()));
            }
        }
        if results.is_empty() {
            return Err("no agent has two games".into());
        }
        let versus = offline::reference(task, &Entrant::of(report::VERSUS)?, &results)?;
        report::print_table(&results, &[versus], self.json)?;
        Ok(if failed {
            ExitCode::FAILURE
        } else {
            ExitCode::SUCCESS
        })
    }
}

/// What ends with a series that is stopped.
#[derive(Default)]
struct Ending {
    /// Whether games in this process end.
    stopped: Arc<AtomicBool>,
    /// Closes the rooms of games that do not end.
    closing: TaskTracker,
}

/// How an agent plays.
enum Runner {
    /// In this process.
    Offline(Arc<Entrant>),
    /// Over a connection.
    Connected(AgentCommand),
}

/// An agent of the series, with the folder of its games.
struct Player {
    runner: Runner,
    folder: Arc<Folder>,
    costs: Costs,
    /// Rounds in a row in which it has failed.
    failures: usize,
    /// Whether it plays no further games.
    has_ended: bool,
}

impl Player {
    fn name(&self) -> &str {
        self.folder.name()
    }

    /// Whether there is a record of each of the first deals.
    fn has_all(&self, deals: usize) -> bool {
        self.folder.missing(deals).is_empty()
    }

    /// Plays the games of these deals.
    async fn play(
        &self,
        deals: Vec<usize>,
        parallel: usize,
        server: Option<&str>,
        ending: &Ending,
    ) -> Result<(), CommandError> {
        match &self.runner {
            Runner::Offline(entrant) => {
                let (folder, entrant) = (Arc::clone(&self.folder), Arc::clone(entrant));
                let stopped = Arc::clone(&ending.stopped);
                spawn_blocking(move || offline::play_all(&folder, &entrant, deals, &stopped))
                    .await?
            }
            Runner::Connected(command) => {
                let closing = &ending.closing;
                hosted::play(&self.folder, command, deals, parallel, server, closing).await
            }
        }
    }

    /// Says how a round ended. Several failures in a row, or games whose cost stays unknown, end this
    /// agent's part.
    fn note(&mut self, played: Result<(), CommandError>, deals: usize) {
        let folder = Arc::clone(&self.folder);
        let name = folder.name();
        self.failures = match played {
            Ok(()) => {
                let games = deals - folder.missing(deals).len();
                let cost = self.costs.in_words();
                tell(format_args!(
                    "{name}: {games} of {}{cost}",
                    counted(deals as u64, "game")
                ));
                0
            }
            Err(error) => {
                tell(format_args!("{name}: {error}"));
                self.failures + 1
            }
        };
        if self.costs.are_unknown() {
            tell(format_args!(
                "{name} plays no further games: what they cost is unknown. Add --price to its command and give it another name, \
                 or use an endpoint that reports tokens"
            ));
            self.has_ended = true;
        }
        if self.failures == hosted::FAILURES {
            tell(format_args!("{name} plays no further games"));
            self.has_ended = true;
        }
    }

    /// Reads what the games of these deals have cost. Without a record, or with one that does not count,
    /// that is unknown.
    async fn read(&mut self, deals: Vec<usize>) {
        let folder = Arc::clone(&self.folder);
        let read = move || {
            let usage = |deal: usize| match folder.game(deal) {
                Ok(game) => game.and_then(|game| game.language_model),
                Err(error) => {
                    tell(error);
                    None
                }
            };
            deals.into_par_iter().map(usage).collect::<Vec<_>>()
        };
        if let Ok(games) = spawn_blocking(read).await {
            self.costs.games.extend(games);
        }
    }
}

/// What an agent's games have cost, by their annotations.
#[derive(Debug, Default)]
struct Costs {
    /// Of each game that was begun; `None` without a record that counts, or without tokens in it.
    games: Vec<Option<ModelUsage>>,
}

impl Costs {
    fn known(&self) -> impl Iterator<Item = f64> {
        self.games.iter().filter_map(|game| (*game)?.cost)
    }

    /// The highest known cost of a game.
    fn highest(&self) -> f64 {
        self.known().fold(0.0, f64::max)
    }

    /// The cost of all games. An unknown one counts as the highest known one.
    fn sum(&self) -> f64 {
        let unknown = self.games.len() - self.known().count();
        self.known().sum::<f64>() + unknown as f64 * self.highest()
    }

    /// Whether this is a language model of which several games have no known cost, and none has one.
    fn are_unknown(&self) -> bool {
        let is_model = self.games.iter().any(Option::is_some);
        is_model && self.games.len() >= hosted::FAILURES && self.known().next().is_none()
    }

    fn in_words(&self) -> String {
        let known: f64 = self.known().sum();
        match (known, self.sum() > known) {
            (0.0, _) => String::new(),
            (known, false) => format!(", which cost {known:.4}"),
            (known, true) => format!(", which cost at least {known:.4}"),
        }
    }
}

/// The file of a series.
struct Plan {
    task: &'static Task,
    agents: Vec<Listed>,
}

/// An agent as the file has it.
#[derive(Default)]
struct Listed {
    agent: Option<String>,
    name: Option<String>,
    command: Vec<String>,
    description: String,
    url: String,
}

impl Plan {
    fn parse(text: &str) -> Result<Self, String> {
        let table = toml_file::parse(text).map_err(toml_file::in_words)?;
        let (mut task, mut agents) = (None, Vec::new());
        for (key, value) in table.get_ref() {
            match (key.get_ref().as_ref(), value.get_ref()) {
                ("task", DeValue::String(name)) => task = Some(task_named(name)?),
                ("agents", DeValue::Array(items)) => {
                    for item in items {
                        let item = item.get_ref().as_table();
                        agents.push(Listed::parse(item.ok_or("agents: write [[agents]]")?)?);
                    }
                }
                (key, _) => {
                    return Err(format!(
                        "{key}: a series has task, a text, and [[agents]], nothing else"
                    ));
                }
            }
        }
        let task = task.ok_or("task: name one of those that `chefshat bench tasks` lists")?;
        let mut folders = BTreeSet::new();
        for agent in &agents {
            let (name, folder) = (agent.label(), agent.folder());
            if folder.is_empty() {
                return Err(format!("{name:?}: give a name with a letter or a digit"));
            }
            if !folders.insert(folder) {
                return Err(format!(
                    "{name}: two agents would have one folder; give another name"
                ));
            }
        }
        if agents.is_empty() {
            return Err("[[agents]]: name at least one".into());
        }
        Ok(Self { task, agents })
    }
}

impl Listed {
    fn parse(table: &DeTable<'_>) -> Result<Self, String> {
        let mut listed = Self::default();
        for (key, value) in table {
            let text = || value.get_ref().as_str().map(str::to_owned);
            let words = || {
                let words = value.get_ref().as_array()?.iter();
                words
                    .map(|word| word.get_ref().as_str().map(str::to_owned))
                    .collect()
            };
            let key = key.get_ref().as_ref();
            let is_text = |text: Option<String>| text.ok_or_else(|| format!("{key}: give a text"));
            match key {
                "agent" => listed.agent = Some(is_text(text())?),
                "name" => listed.name = Some(is_text(text())?),
                "description" => listed.description = is_text(text())?,
                "url" => listed.url = is_text(text())?,
                "command" => {
                    let words: Option<Vec<String>> = words();
                    listed.command =
                        words.ok_or("command: give a list of texts, one for each word")?;
                }
                _ => {
                    return Err(format!(
                        "{key}: an agent has agent, or name and command, and perhaps description and url"
                    ));
                }
            }
        }
        match (&listed.agent, &listed.name, listed.command.is_empty()) {
            (Some(_), _, true) | (None, Some(_), false) => Ok(listed),
            _ => Err("each of [[agents]] has agent, or name and command".into()),
        }
    }

    /// The name, or what stands for it.
    fn label(&self) -> &str {
        let given = self.name.as_deref().or(self.agent.as_deref());
        given.unwrap_or_default()
    }

    /// The name of its folder: letters and digits of ASCII, `-` and `_`; empty if the name has none of
    /// them.
    fn folder(&self) -> String {
        let safe = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
        let name = self.label().chars();
        let name: String = name
            .map(|letter| if safe(letter) { letter } else { '-' })
            .collect();
        name.trim_matches('-').to_lowercase()
    }

    fn player(self, task: &Task, out: &Path) -> Result<Player, CommandError> {
        let (runner, command, label) = match &self.agent {
            Some(agent) => {
                let entrant = Entrant::of(agent)?;
                offline::check_fits(task, &entrant)?;
                let label = entrant.label.clone();
                (Runner::Offline(Arc::new(entrant)), agent.clone(), label)
            }
            None => {
                let command = AgentCommand::for_games(self.command.clone())?;
                (
                    Runner::Connected(command),
                    self.command.join(" "),
                    String::new(),
                )
            }
        };
        let path = out.join(self.folder());
        let agent = AgentInfo {
            name: self.name.unwrap_or(label),
            description: self.description,
            url: self.url,
        };
        let connects = matches!(runner, Runner::Connected(_));
        Ok(Player {
            runner,
            folder: Arc::new(Folder::create(&path, task, agent, command, connects)?),
            costs: Costs::default(),
            failures: 0,
            has_ended: false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
        task = "language_model"
        [[agents]]
        name = "qwen3"
        command = ["chefshat", "agent", "llm", "{code}"]
        url = "https://example.org"
        [[agents]]
        agent = "monte_carlo:64"
    "#;

    #[test]
    fn a_file_lists_agents() {
        let plan = Plan::parse(FILE).expect("a plan");
        assert_eq!(plan.task.name, "language_model");
        let folders: Vec<_> = plan.agents.iter().map(Listed::folder).collect();
        assert_eq!(folders, ["qwen3", "monte_carlo-64"]);
        assert_eq!(plan.agents[0].command.len(), 4);
    }

    #[test]
    fn a_wrong_file_says_what_to_do() {
        let problem = |from: &str, to: &str| {
            let text = FILE.replacen(from, to, 1);
            assert_ne!(text, FILE, "{from}");
            Plan::parse(&text)
                .err()
                .unwrap_or_else(|| panic!("{to} is accepted"))
        };
        for (from, to, expected) in [
            ("\"qwen3\"", "qwen3", "line 4: "),
            ("language_model", "chess", "there is no such task"),
            ("task = \"language_model\"", "", "task: name one"),
            ("url", "link", "link: an agent has"),
            ("\"qwen3\"", "7", "name: give a text"),
            ("[\"chefshat\", ", "[7, ", "command: give a list"),
            (
                "agent = \"monte_carlo:64\"",
                "",
                "has agent, or name and command",
            ),
            ("name = \"qwen3\"", "", "has agent, or name and command"),
            (
                "monte_carlo:64",
                "Qwen3",
                "two agents would have one folder",
            ),
            ("monte_carlo:64", "...", "give a name with a letter"),
            ("task =", "deals = 3\ntask =", "deals: a series has"),
        ] {
            let found = problem(from, to);
            assert!(found.contains(expected), "{to}: {found}");
        }
        let none = Plan::parse("task = \"shift\"").err();
        assert!(none.expect("a problem").contains("name at least one"));
    }

    #[test]
    fn an_unknown_cost_counts_as_the_highest() {
        let usage = |cost| Some(ModelUsage { tokens: 100, cost });
        let (priced, unpriced) = (|cost| usage(Some(cost)), usage(None));
        let costs = |games: &[Option<ModelUsage>]| Costs {
            games: games.to_vec(),
        };
        // No record, no model, or a model for which the server took all decisions.
        let no_tokens = None;
        for (games, sum, highest, words) in [
            (costs(&[]), 0.0, 0.0, ""),
            (costs(&[no_tokens, no_tokens]), 0.0, 0.0, ""),
            (
                costs(&[priced(1.0), priced(3.0)]),
                4.0,
                3.0,
                ", which cost 4.0000",
            ),
            (
                costs(&[unpriced, priced(1.0), no_tokens]),
                3.0,
                1.0,
                ", which cost at least 1.0000",
            ),
            (
                costs(&[no_tokens, priced(2.0)]),
                4.0,
                2.0,
                ", which cost at least 2.0000",
            ),
        ] {
            assert_eq!((games.sum(), games.highest()), (sum, highest), "{games:?}");
            assert_eq!(games.in_words(), words, "{games:?}");
            assert!(!games.are_unknown(), "{games:?}");
        }
        assert!(costs(&[unpriced; hosted::FAILURES]).are_unknown());
        assert!(!costs(&[unpriced; hosted::FAILURES - 1]).are_unknown());
        assert!(!costs(&[no_tokens; hosted::FAILURES]).are_unknown());
        assert!(
            !costs(&[[unpriced; hosted::FAILURES].as_slice(), &[priced(1.0)]].concat())
                .are_unknown()
        );
    }
}
