//! An agent in any language plays on a server, in a room for each deal. The records are the server's.

use std::future::ready;
use std::pin::pin;
use std::time::Duration;

use chefshat_benchmark::check;
use chefshat_cli::connect::ServerArg;
use chefshat_cli::error::CommandError;
use chefshat_cli::progress;
use chefshat_client::Client;
use chefshat_examiner::{AgentCommand, AgentProcess, Places};
use chefshat_record::jsonl;
use chefshat_server::host::Host;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use tokio::io::AsyncWriteExt as _;
use tokio::process::ChildStdin;
use tokio::sync::Mutex;
use tokio::time::timeout;

use super::folder::Folder;

/// Display name of the agent, for commands that take one.
const NAME: &str = "entrant";
/// Lines of the agent's output that an error shows.
const LAST_LINES: usize = 8;
/// How long an agent may take to exit after its last game.
const EXIT: Duration = Duration::from_secs(10);
/// How long a game may take to end after the process of its agent has.
const END: Duration = Duration::from_secs(5);

/// Plays the games that the folder has not.
pub(super) async fn play(
    folder: &Folder,
    command: &AgentCommand,
    deals: usize,
    parallel: usize,
    server: Option<&ServerArg>,
) -> Result<(), CommandError> {
    let missing = folder.missing(deals);
    if missing.is_empty() {
        return Ok(());
    }
    let host = match server {
        Some(_) => None,
        None => Some(Host::in_memory(None).await?),
    };
    let (client, url) = match (server, &host) {
        (Some(server), _) => (server.connect().await?, server.url().to_owned()),
        (None, Some(host)) => (Client::connect(host.url()).await?, host.url()),
        (None, None) => unreachable!("without a server there is a host"),
    };
    let address = url.split_once("://").map_or(url.as_str(), |(_, rest)| rest);
    let games = Games {
        folder,
        command,
        client: &client,
        address: address.trim_end_matches('/'),
    };
    games.play(missing, parallel).await?;
    drop(client);
    if let Some(host) = host {
        host.stop().await?;
    }
    Ok(())
}

/// The games of a run.
struct Games<'a> {
    folder: &'a Folder,
    command: &'a AgentCommand,
    client: &'a Client,
    /// `host:port` of the server.
    address: &'a str,
}

impl Games<'_> {
    /// Plays the games of these deals, some at a time.
    async fn play(&self, deals: Vec<usize>, parallel: usize) -> Result<(), CommandError> {
        if !self.command.reads_games() {
            return self.play_each(deals, parallel, None).await;
        }
        let mut process = self.start(String::new()).await?;
        let games = process.games().map(Mutex::new);
        let failed = tokio::select! {
            played = self.play_each(deals, parallel, games.as_ref()) => played.err(),
            status = process.ended() => {
                Some(format!("the agent exited before its last game: {}", status?).into())
            }
        };
        if let Some(error) = failed {
            return Err(explained(error, process).await);
        }
        drop(games);
        // One that does not notice that there are no more games is killed.
        let _exited = timeout(EXIT, process.ended()).await;
        Ok(())
    }

    async fn play_each(
        &self,
        deals: Vec<usize>,
        parallel: usize,
        reads: Option<&Mutex<ChildStdin>>,
    ) -> Result<(), CommandError> {
        let bar = progress::of_items(deals.len() as u64, "games");
        let games = stream::iter(deals).map(|deal| self.game(deal, reads));
        let played = games.buffer_unordered(parallel).try_for_each(|()| {
            bar.inc(1);
            ready(Ok(()))
        });
        played.await?;
        bar.finish_and_clear();
        Ok(())
    }

    /// Plays the game of a deal, and writes its record if it counts.
    async fn game(
        &self,
        deal: usize,
        reads: Option<&Mutex<ChildStdin>>,
    ) -> Result<(), CommandError> {
        let created = self.client.create_room(self.folder.task.room(deal)).await?;
        let room = created.room.unwrap_or_default();
        let over = self.until_over(&room.room_id);
        match reads {
            Some(reads) => {
                let line = format!("{} {}\n", self.address, created.join_code);
                let written = reads.lock().await.write_all(line.as_bytes()).await;
                written.map_err(|error| format!("the agent reads no more games: {error}"))?;
                over.await?;
            }
            None => {
                let mut process = self.start(created.join_code).await?;
                if let Err(error) = until_both_over(over, &mut process).await {
                    let error = format!("the game of deal {deal}: {error}").into();
                    return Err(explained(error, process).await);
                }
            }
        }
        let lines = self.client.record(&room.game_id).await?;
        let text = jsonl::text(&lines)?;
        let path = self.folder.record(deal);
        let record = jsonl::read_text(&path, text.as_slice())?;
        check(self.folder.task, deal, &record)
            .map_err(|problem| format!("the game of deal {deal} does not count: {problem}"))?;
        Ok(jsonl::write(&path, &lines)?)
    }

    async fn start(&self, code: String) -> Result<AgentProcess, CommandError> {
        let places = Places {
            address: self.address.to_owned(),
            code,
            name: NAME.to_owned(),
        };
        let started = AgentProcess::start(self.command, &places, None).await;
        let program = self.command.words().first();
        Ok(started.map_err(|error| format!("{}: {error}", program.map_or("", String::as_str)))?)
    }

    async fn until_over(&self, room_id: &str) -> Result<(), CommandError> {
        let mut spectator = self.client.spectate(room_id, 0);
        while spectator.next().await?.is_some() {}
        Ok(())
    }
}

/// Waits until a game is over and the process that played it has exited, or was given time to.
async fn until_both_over(
    over: impl Future<Output = Result<(), CommandError>>,
    process: &mut AgentProcess,
) -> Result<(), CommandError> {
    let mut over = pin!(over);
    tokio::select! {
        ended = &mut over => {
            ended?;
            let _exited = timeout(EXIT, process.ended()).await;
            Ok(())
        }
        status = process.ended() => {
            let status = status?;
            let ended = timeout(END, over).await;
            ended.map_err(|_| format!("the agent exited before its end: {status}"))?
        }
    }
}

/// An error with the last lines that the agent printed.
async fn explained(error: CommandError, process: AgentProcess) -> CommandError {
    let lines = process.finish(LAST_LINES).await;
    let lines: String = lines.iter().map(|line| format!("\n  | {line}")).collect();
    match lines.is_empty() {
        true => error,
        false => format!("{error}; the agent's last lines:{lines}").into(),
    }
}
