//! An agent in any language plays on a server, in a room for each deal. The records are the server's.

use std::pin::pin;
use std::time::Duration;

use chefshat_benchmark::check;
use chefshat_cli::error::{CommandError, tell};
use chefshat_cli::numbers::counted;
use chefshat_cli::progress;
use chefshat_client::Client;
use chefshat_examiner::{AgentCommand, AgentProcess};
use chefshat_proto::v1::{self, game_event::Kind};
use chefshat_record::jsonl;
use futures::{StreamExt as _, stream};
use tokio::io::AsyncWriteExt as _;
use tokio::process::ChildStdin;
use tokio::sync::Mutex;
use tokio::time::timeout;
use tokio_util::task::TaskTracker;

use super::folder::Folder;
use crate::agent_host::{AgentHost, END, EXIT, exited, explained, game_line, patience, record};
use crate::open_room::OpenRoom;

/// How long no game may end until the person at the terminal is asked about the agent.
const QUIET: Duration = Duration::from_secs(30);
/// Failures in a row that end a run.
pub(super) const FAILURES: usize = 5;

/// Plays the games of these deals. Games that fail are named and leave the others alone, unless several
/// fail in a row. The rooms of games that do not end are closed by tasks of `closing`. Wait for them
/// after the future was dropped.
pub(super) async fn play(
    folder: &Folder,
    command: &AgentCommand,
    deals: Vec<usize>,
    parallel: usize,
    server: Option<&str>,
    closing: &TaskTracker,
) -> Result<(), CommandError> {
    if deals.is_empty() {
        return Ok(());
    }
    let host = AgentHost::open(server).await?;
    let games = Games {
        folder,
        command,
        host: &host,
        closing,
    };
    let played = games.play(deals, parallel).await;
    closing.close();
    closing.wait().await;
    played?;
    host.close().await
}

/// The games of a run.
struct Games<'a> {
    folder: &'a Folder,
    command: &'a AgentCommand,
    host: &'a AgentHost,
    closing: &'a TaskTracker,
}

impl Games<'_> {
    /// Plays the games of these deals, some at a time.
    async fn play(&self, deals: Vec<usize>, parallel: usize) -> Result<(), CommandError> {
        if !self.command.reads_games() {
            return self.play_each(deals, parallel, None).await;
        }
        let mut process = self.start(String::new()).await?;
        let games = process.games().map(Mutex::new);
        let played = tokio::select! {
            played = self.play_each(deals, parallel, games.as_ref()) => played,
            status = process.ended() => Err(exited(status?)),
        };
        if let Err(error) = played {
            // Games fail when the agent has exited: then that is what to say.
            let error = match timeout(END, process.ended()).await {
                Ok(Ok(status)) => exited(status),
                _ => error,
            };
            return Err(explained(error, process).await);
        }
        // The agent reads no more games, and exits. If it does not, it is killed.
        drop(games);
        let _exited = timeout(EXIT, process.ended()).await;
        Ok(())
    }

    async fn start(&self, code: String) -> Result<AgentProcess, CommandError> {
        self.host
            .start(self.command, self.folder.name(), code)
            .await
    }

    async fn play_each(
        &self,
        deals: Vec<usize>,
        parallel: usize,
        reads: Option<&Mutex<ChildStdin>>,
    ) -> Result<(), CommandError> {
        let bar = progress::of_items(deals.len() as u64, "games");
        let games =
            stream::iter(deals).map(|deal| async move { (deal, self.game(deal, reads).await) });
        let mut games = pin!(games.buffer_unordered(parallel));
        let (mut failed, mut in_a_row) = (0, 0);
        loop {
            let next = match timeout(QUIET, games.next()).await {
                Ok(next) => next,
                Err(_) => {
                    let words =
                        "no game has ended for half a minute; does the agent join and decide?";
                    bar.suspend(|| tell(words));
                    games.next().await
                }
            };
            let Some((deal, played)) = next else { break };
            bar.inc(1);
            let Err(error) = played else {
                in_a_row = 0;
                continue;
            };
            failed += 1;
            in_a_row += 1;
            if in_a_row == FAILURES || bar.length() == Some(failed) {
                let games = counted(in_a_row as u64, "game");
                return Err(
                    format!("{games} failed in a row; that of deal {deal}: {error}").into(),
                );
            }
            bar.suspend(|| tell(format_args!("the game of deal {deal}: {error}")));
        }
        bar.finish_and_clear();
        if failed > 0 {
            let games = counted(failed, "game");
            tell(format_args!(
                "{games} failed; the same command plays what is missing"
            ));
        }
        Ok(())
    }

    /// Plays the game of a deal, and writes its record if it counts.
    async fn game(
        &self,
        deal: usize,
        reads: Option<&Mutex<ChildStdin>>,
    ) -> Result<(), CommandError> {
        let request = self.folder.task.room(deal);
        let (created, open) = OpenRoom::create(&self.host.client, self.closing, request).await?;
        let room = created.room.unwrap_or_default();
        // Games of hidden deals are private.
        let owner = self.host.client.with_secrets([&created.owner_token])?;
        self.until_over(&owner, &room, created.join_code, reads)
            .await?;
        open.leave_open();
        let lines = record(&owner, &room.game_id).await?;
        let text = jsonl::text(&lines)?;
        let path = self.folder.record(deal);
        let record = jsonl::read_text(&path, text.as_slice())?;
        check(&self.folder.task, deal, &record)?;
        Ok(jsonl::write(&path, &lines)?)
    }

    /// Lets the agent play in a room, until its game is over.
    async fn until_over(
        &self,
        owner: &Client,
        room: &v1::Room,
        code: String,
        reads: Option<&Mutex<ChildStdin>>,
    ) -> Result<(), CommandError> {
        let over = until_ended(owner, &room.room_id);
        if let Some(reads) = reads {
            let line = game_line(&self.host.address, &code, self.folder.name());
            let written = reads.lock().await.write_all(line.as_bytes()).await;
            written.map_err(|error| format!("the agent reads no more games: {error}"))?;
            return over.await;
        }
        let mut process = self.start(code).await?;
        let mut over = pin!(over);
        let ended = tokio::select! {
            ended = &mut over => ended,
            status = process.ended() => {
                let status = status?;
                timeout(patience(status), over).await.unwrap_or_else(|_| Err(exited(status)))
            }
        };
        if let Err(error) = ended {
            return Err(explained(error, process).await);
        }
        let _exited = timeout(EXIT, process.ended()).await;
        Ok(())
    }
}

/// Waits until a game has ended.
async fn until_ended(client: &Client, room_id: &str) -> Result<(), CommandError> {
    let mut spectator = client.spectate(room_id, 0);
    let mut has_ended = false;
    while let Some(event) = spectator.next().await? {
        has_ended = matches!(event.kind, Some(Kind::GameEnded(_)));
    }
    match has_ended {
        true => Ok(()),
        false => Err("the room was closed; the agent has an hour to join".into()),
    }
}
