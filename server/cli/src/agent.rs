//! `chefshat agent`: plays as a built-in agent, as the player of a record, or as a language model,
//! through the Rust SDK.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use crate::kind::KindArg;
use crate::name_key::NameKeyArg;
use crate::numbers::{counted, seat_number};
use chefshat_agents::{BuiltInAgent, RecordedPlayer};
use chefshat_client::{Client, Error, Outcome, PlayError, v1};
use chefshat_record::jsonl;
use clap::Args;

use super::connect::{JoinArgs, Pass, ServerArg, free_seats};
use super::error::{plain, tell};
use super::llm::LlmArgs;
use super::player::{Player, PlayerArg, player_arg};
use super::remote::{MAX_PACE_MS, RemoteAgent};
use super::{CommandError, say, ticket_file};
use chefshat_server::convert::recorded_player;

/// Play on a server as a built-in agent or a language model.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat agent greedy --server http://127.0.0.1:50051 --code BCDF2345\n  \
                  chefshat agent random --code-file ./join-code --name Rolf --seed 7\n  \
                  chefshat agent llm --endpoint http://127.0.0.1:8080/v1 --model qwen3 --code BCDF2345\n  \
                  chefshat agent replay --record 5f0c6a4de2b14b7f8a3d9c1e7b60425d.jsonl --seat 2 --code BCDF2345\n\n\
                  replay imitates the player who had that seat in a recorded game: where it sees exactly what the player saw, it takes the \
                  same action, otherwise the action from the most similar situation (docs/branching.md).\n\n\
                  llm lets a language model play, on any server with the usual chat API (docs/mcp.md).\n\n\
                  Exit code: 0 when the game finished, 1 when it was aborted, the seat was lost, a room of several --games had none, or a model's fallback played too much of it."
)]
pub(super) struct AgentCommand {
    /// The agent: random, greedy, trained, monte_carlo (searches on all cores; with a budget:
    /// monte_carlo:50ms), replay (imitates the player of a record), or llm (a language model).
    #[arg(value_parser = agent_arg, value_name = "KIND")]
    agent: AgentArg,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    join_args: JoinArgs,
    /// For replay: the record.
    #[arg(
        long,
        value_name = "FILE",
        required_if_eq("agent", BuiltInAgent::REPLAY)
    )]
    record: Option<PathBuf>,
    /// For replay: the seat in the record, from 0.
    #[arg(
        long,
        value_name = "SEAT",
        required_if_eq("agent", BuiltInAgent::REPLAY)
    )]
    seat: Option<u32>,
    /// Display name. Default: the agent's or model's.
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    name_key: NameKeyArg,
    /// Kind of participant. Default: agent, and model for llm.
    #[arg(long, value_enum)]
    kind_of: Option<KindArg>,
    /// Seed of the agent's choices, for repeatable games.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of games to play in sequence; the file has to get a new join code for each.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    games: u32,
    /// Milliseconds to wait before each decision, so that people can follow the game.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MAX_PACE_MS))]
    pace_ms: u64,
    /// Print one JSON line per game.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    llm: LlmArgs,
}

/// The agent as named on the command line.
#[derive(Debug, Clone, Copy)]
enum AgentArg {
    Player(PlayerArg),
    Replay,
}

impl AgentCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.games > 1 && !self.join_args.has_code_file() {
            return Err("a code or ticket is valid for one game; to play more --games, give a --code-file that gets new codes".into());
        }
        let mut player = self.player().await?;
        let client = self.server.connect_patiently().await?;
        let mut last_code = None;
        let mut all_played = true;
        for _ in 0..self.games {
            let ticket = match self.ticket(&client, &mut last_code).await {
                Ok(ticket) => ticket,
                Err(error) => {
                    let Some(error) = self.without_seat(&error) else {
                        return Err(error);
                    };
                    all_played = false;
                    match self.json {
                        true => say(refused_json(error))?,
                        false => say(plain(format_args!("there was no seat: {error}")))?,
                    }
                    continue;
                }
            };
            player.begin();
            let played = client.play(ticket.as_str(), player.agent()).await;
            if played.is_ok() {
                ticket_file::forget(self.join_args.ticket_file(), &ticket);
            }
            all_played &= matches!(&played, Ok(outcome) if outcome.standing().is_some());
            all_played &= player.has_played();
            match self.json {
                true => say(player.as_json(as_json(&played)))?,
                false => say(player.in_words(&in_words(&played)))?,
            }
        }
        Ok(if all_played {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    async fn player(&self) -> Result<Player, CommandError> {
        let pace = Duration::from_millis(self.pace_ms);
        match (self.agent, &self.record, self.seat) {
            (AgentArg::Player(player), None, None) => {
                let players = player.players(&self.llm, self.seed, pace)?;
                players.check().await?;
                Ok(players.player("chefshat agent"))
            }
            (AgentArg::Player(_), ..) => Err("--record and --seat are for the agent replay".into()),
            (AgentArg::Replay, Some(record), Some(seat)) => {
                let agent = BuiltInAgent::replay(player_of(record, seat)?);
                Ok(RemoteAgent::new(agent, pace).into())
            }
            (AgentArg::Replay, ..) => Err("replay needs --record and --seat".into()),
        }
    }

    /// Why there is no seat in a room, if that of the next game may have one.
    fn without_seat<'a>(&self, error: &'a CommandError) -> Option<&'a Error> {
        let error = error.downcast_ref::<Error>().filter(|_| self.games > 1)?;
        let reasons = ["ROOM_FULL", "GAME_STARTED", "GAME_OVER", "JOIN_CODE_WRONG"];
        (error
            .reason()
            .is_some_and(|reason| reasons.contains(&reason)))
        .then_some(error)
    }

    /// Returns the ticket for the next game.
    async fn ticket(
        &self,
        client: &Client,
        last_code: &mut Option<String>,
    ) -> Result<String, CommandError> {
        let code = match self.join_args.pass(last_code.as_deref()).await? {
            Pass::Ticket(ticket) => return Ok(ticket),
            Pass::Code(code) => code,
        };
        let (default_name, kind) = match self.agent {
            AgentArg::Player(player) => (player.display_name(&self.llm), player.kind()),
            AgentArg::Replay => (BuiltInAgent::REPLAY.to_owned(), KindArg::Agent),
        };
        let name = self.name.clone().unwrap_or(default_name);
        let kind = self.kind_of.unwrap_or(kind);
        *last_code = Some(code.clone());
        let ticket_file = ticket_file::prepare(self.join_args.ticket_file())?;
        let joined = client
            .join(v1::JoinRoomRequest {
                join_code: code,
                name: name.clone(),
                kind: v1::ParticipantKind::from(kind).into(),
                name_key: self.name_key.key()?,
                ..v1::JoinRoomRequest::default()
            })
            .await?;
        let waits = match joined.room.as_ref().map_or(0, free_seats) {
            0 => String::new(),
            free => {
                let others = counted(free as u64, "other seat");
                format!("waits for {others} to be taken, then ")
            }
        };
        let number = seat_number(joined.seat);
        tell(format_args!(
            "{name} has seat {number}; {waits}plays to the end"
        ));
        let resumes = "if this agent stops before the end of its game, resume its seat";
        ticket_file::keep(ticket_file, &joined.ticket, resumes);
        Ok(joined.ticket)
    }
}

fn agent_arg(name: &str) -> Result<AgentArg, String> {
    match name == BuiltInAgent::REPLAY {
        true => Ok(AgentArg::Replay),
        false => player_arg(name)
            .map(AgentArg::Player)
            .map_err(|problem| format!("{problem}, {}", BuiltInAgent::REPLAY)),
    }
}

/// Loads the player of a seat of a record.
fn player_of(record: &Path, seat: u32) -> Result<Arc<RecordedPlayer>, CommandError> {
    let lines = jsonl::read(record)?;
    let name = record.display();
    recorded_player(&lines, seat).map_err(|error| format!("{name}: {error}").into())
}

fn in_words(played: &Result<Outcome, PlayError>) -> String {
    match played {
        Ok(outcome) => outcome_in_words(outcome),
        Err(error) => plain(format_args!("the seat was lost: {error}")),
    }
}

fn as_json(played: &Result<Outcome, PlayError>) -> serde_json::Value {
    match played {
        Ok(outcome) => outcome_json(outcome),
        Err(error) => serde_json::json!({
            "event": "lost", "reason": error.reason(), "message": error.to_string(),
        }),
    }
}

/// A room without a seat, as JSON.
fn refused_json(error: &Error) -> serde_json::Value {
    serde_json::json!({
        "event": "refused", "reason": error.reason(), "message": error.message(),
    })
}

/// The result of a game for a seat, as a line for people.
pub(super) fn outcome_in_words(outcome: &Outcome) -> String {
    let (answers, game) = (outcome.answers, &outcome.game_id);
    match (outcome.standing(), outcome.aborted()) {
        (Some(line), _) => format!(
            "place {} of {}, {} points, {answers} answers, game {game}",
            line.place,
            outcome.standings().len(),
            line.points
        ),
        (None, Some(reason)) => format!("the game was aborted ({}), game {game}", short(reason)),
        (None, None) => format!("the game ended without a place for this seat, game {game}"),
    }
}

/// The result of a game for a seat, as JSON.
pub(super) fn outcome_json(outcome: &Outcome) -> serde_json::Value {
    let (room_id, game_id, seat) = (&outcome.room_id, &outcome.game_id, outcome.seat);
    match (outcome.standing(), outcome.aborted()) {
        (Some(line), _) => serde_json::json!({
            "event": "result", "room_id": room_id, "game_id": game_id, "seat": seat,
            "place": line.place, "players": outcome.standings().len(), "points": line.points,
            "answers": outcome.answers,
        }),
        (None, reason) => serde_json::json!({
            "event": "aborted", "room_id": room_id, "game_id": game_id, "seat": seat,
            "reason": reason.map(short),
        }),
    }
}

/// The name of an abort reason without the prefix of its enum.
fn short(reason: v1::AbortReason) -> &'static str {
    let name = reason.as_str_name();
    name.strip_prefix("ABORT_REASON_").unwrap_or(name)
}
