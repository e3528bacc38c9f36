//! `chefshat bench run`: plays the games that are missing in a folder, and prints the result of all.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use chefshat_benchmark::{AgentInfo, Task, tasks};
use chefshat_cli::error::{CommandError, tell};
use chefshat_cli::numbers::counted;
use chefshat_cli::stops::Stops;
use chefshat_examiner::AgentCommand;
use clap::Args;
use tokio_util::task::TaskTracker;

use super::deals_key::DealsKeyArg;
use super::folder::Folder;
use super::{hosted, offline, report};
use crate::compare::Entrant;

const HELP: &str = "\
A command without {code} is started once. It reads a line for each game from its standard input: the server's address, a join code and the \
name of the agent, separated by spaces; in Python, chefshat.benchmark.play does that. A command with {code} is started for each game; {address} \
stands for host:port, {url} for http://host:port, {name} for the name.

A run that was interrupted continues: games with a record are not played again.";

/// Play a task, and keep the records of its games in a folder.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Run {
    /// The task; `chefshat bench tasks` lists them.
    #[arg(value_parser = task_named)]
    task: &'static Task,
    /// The folder: manifest.json, records/ and result.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A built-in agent or a network file, which plays in this process.
    #[arg(long, conflicts_with_all = ["command", "server"])]
    agent: Option<String>,
    /// Name of the agent in tables; required with a command. Default with --agent: that agent.
    #[arg(long)]
    name: Option<String>,
    /// How the agent plays and was trained, in a sentence.
    #[arg(long, default_value = "")]
    description: String,
    /// Where to read about it.
    #[arg(long, default_value = "")]
    url: String,
    /// Play only this many of the deals. The result is not valid then.
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    deals: Option<u64>,
    #[command(flatten)]
    deals_key: DealsKeyArg,
    /// Games that are open at a time, for a command. The time of a decision runs while the agent is
    /// busy with another game.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    parallel: u16,
    /// A server to play on, which signs the records if it has a key; CHEFSHAT_TOKEN and CHEFSHAT_CA
    /// are for it and for the agent. Default: one in this process.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Command that starts the agent, in any language.
    #[arg(last = true, value_name = "COMMAND")]
    command: Vec<String>,
}

impl Run {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.agent.is_none() && self.command.is_empty() {
            return Err("who plays? Give --agent, or a command after --".into());
        }
        if self.agent.is_none() && self.name.is_none() {
            return Err("name the agent of the command with --name".into());
        }
        let task = self.task.with_deals(self.deals_key.key()?.as_ref());
        if self.agent.is_some() {
            return self.finish(self.play_offline(&task)?);
        }
        let mut stops = Stops::catch()?;
        let closing = TaskTracker::new();
        let folder = tokio::select! {
            folder = self.play_hosted(&task, &closing) => folder?,
            // Returning ends the agent's processes, which are in a process group of their own.
            stop = stops.next() => {
                self.say_what_is_kept(&task);
                closing.close();
                closing.wait().await;
                return Ok(stop.exit_code());
            }
        };
        let checking = tokio::task::spawn_blocking(move || self.finish(folder));
        tokio::select! {
            finished = checking => finished?,
            stop = stops.next() => Ok(stop.exit_code()),
        }
    }

    /// Says that a run that has ended early can be resumed.
    fn say_what_is_kept(&self, task: &Task) {
        let played =
            Folder::open(&self.out, task.deals_key.as_ref()).map_or(0, |folder| folder.played());
        if played > 0 {
            let games = counted(played as u64, "game");
            tell(format_args!(
                "the records of {games} are kept; the same command plays the others"
            ));
        }
    }

    /// Checks the records, and prints the result.
    fn finish(&self, folder: Folder) -> Result<ExitCode, CommandError> {
        let result = folder.check()?;
        let printed = report::print(&result, self.json);
        folder.write_result(&result)?;
        printed
    }

    /// The number of deals to play.
    fn deals(&self) -> Result<usize, CommandError> {
        deals_of(self.task, self.deals)
    }

    /// Plays with an agent in this process.
    fn play_offline(&self, task: &Task) -> Result<Folder, CommandError> {
        let agent = self.agent.as_deref().unwrap_or_default();
        let entrant = Entrant::of(agent)?;
        offline::check_fits(task, &entrant)?;
        let deals = self.deals()?;
        let folder = self.folder(agent, Some(&entrant.label), task)?;
        let missing = folder.missing(deals);
        offline::play_all(&folder, &entrant, missing, &AtomicBool::new(false))?;
        Ok(folder)
    }

    /// Plays with an agent that connects to a server.
    async fn play_hosted(
        &self,
        task: &Task,
        closing: &TaskTracker,
    ) -> Result<Folder, CommandError> {
        let command = AgentCommand::for_games(self.command.clone())?;
        let deals = self.deals()?;
        let folder = self.folder(&self.command.join(" "), None, task)?;
        let parallel = usize::from(self.parallel);
        let server = self.server.as_deref();
        let missing = folder.missing(deals);
        let played = hosted::play(&folder, &command, missing, parallel, server, closing).await;
        if played.is_err() {
            self.say_what_is_kept(task);
        }
        played.map(|()| folder)
    }

    /// The folder of an agent that connects, or of one with this label that plays in this process.
    fn folder(
        &self,
        command: &str,
        label: Option<&str>,
        task: &Task,
    ) -> Result<Folder, CommandError> {
        let agent = AgentInfo {
            name: (self.name.clone()).unwrap_or_else(|| label.unwrap_or_default().to_owned()),
            description: self.description.clone(),
            url: self.url.clone(),
        };
        let folder = Folder::create(&self.out, task, agent, command.to_owned(), label.is_none())?;
        let (played, missing) = (folder.played(), folder.missing(self.deals()?).len());
        if played > 0 {
            let (path, games) = (self.out.display(), counted(played as u64, "game"));
            tell(format_args!(
                "{path} has the records of {games}, {missing} are played now; for a changed agent use another --out"
            ));
        }
        Ok(folder)
    }
}

/// The number of deals of a task that are played.
pub(super) fn deals_of(task: &Task, given: Option<u64>) -> Result<usize, CommandError> {
    let deals = given.map_or(task.deals, |deals| deals as usize);
    match deals > task.deals {
        true => Err(format!("--deals: the task has {} deals", task.deals).into()),
        false => Ok(deals),
    }
}

/// The task of this name, for clap.
pub(super) fn task_named(name: &str) -> Result<&'static Task, String> {
    Task::named(name).ok_or_else(|| {
        let names: Vec<&str> = tasks().iter().map(|task| task.name.as_str()).collect();
        format!("there is no such task; use one of {}", names.join(", "))
    })
}
