//! `chefshat agent`: plays as a built-in agent, as the player of a record, or as a language model,
//! through the Rust SDK.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use crate::kind::KindArg;
use chefshat_agents::{AgentNameError, BuiltInAgent, MonteCarlo, NamedAgent, RecordedPlayer};
use chefshat_client::{Client, Outcome, PlayError, v1};
use chefshat_record::jsonl;
use clap::Args;

use super::connect::{JoinArgs, Pass, ServerArg, free_seats};
use super::llm::{self, LanguageModel, LlmArgs};
use super::remote::{MAX_PACE_MS, RemoteAgent, seed_for};
use super::{CommandError, say};
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
                  Exit code: 0 when the game finished, 1 when it was aborted or the seat was lost."
)]
pub(super) struct AgentCommand {
    /// The agent: random, random_unmasked, greedy, trained, monte_carlo (searches on all cores; with
    /// a budget: monte_carlo:50ms), replay (imitates the player of a record), or llm (a language
    /// model).
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
    /// Kind of participant.
    #[arg(long, value_enum, default_value_t = KindArg::Agent)]
    kind_of: KindArg,
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
    Named(NamedAgent),
    Replay,
    Llm,
}

/// Who plays.
enum Player {
    BuiltIn(Box<RemoteAgent>),
    Model(Box<LanguageModel>),
}

impl AgentArg {
    fn name(self) -> &'static str {
        match self {
            Self::Named(NamedAgent::Kind(kind)) => kind.name(),
            Self::Named(NamedAgent::MonteCarlo(_)) => MonteCarlo::NAME,
            Self::Replay => BuiltInAgent::REPLAY,
            Self::Llm => llm::NAME,
        }
    }
}

impl AgentCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.games > 1 && !self.join_args.has_code_file() {
            return Err("a code or ticket is valid for one game; to play more --games, give a --code-file that gets new codes".into());
        }
        let mut player = self.player()?;
        let client = self.server.connect_patiently().await?;
        let mut last_code = None;
        let mut all_finished = true;
        for _ in 0..self.games {
            let ticket = self.ticket(&client, &mut last_code).await?;
            let played = match &mut player {
                Player::BuiltIn(agent) => client.play(ticket, agent.as_mut()).await,
                Player::Model(model) => client.play(ticket, model.as_mut()).await,
            };
            all_finished &= matches!(&played, Ok(outcome) if outcome.standing().is_some());
            let spent = match &player {
                Player::BuiltIn(_) => None,
                Player::Model(model) => Some(model.spent()),
            };
            if self.json {
                let mut line = as_json(&played);
                if let Some(spent) = spent {
                    line["tokens"] = spent.tokens.into();
                    line["decisions"] = spent.decisions.into();
                    line["fallbacks"] = spent.fallbacks.into();
                }
                say(line)?;
            } else {
                let spent =
                    spent.map_or_else(String::new, |spent| format!(", {}", spent.in_words()));
                say(format!("{}{spent}", in_words(&played)))?;
            }
        }
        Ok(if all_finished {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    fn player(&self) -> Result<Player, CommandError> {
        if let AgentArg::Llm = self.agent {
            if self.record.is_some() || self.seat.is_some() {
                return Err("--record and --seat are for the agent replay".into());
            }
            let seed = seed_for("chefshat agent llm", self.seed);
            let pace = Duration::from_millis(self.pace_ms);
            let model = self.llm.agent(seed, self.seed, pace)?;
            return Ok(Player::Model(Box::new(model)));
        }
        if self.llm.names_a_model() {
            return Err("--endpoint and --model are for the agent llm".into());
        }
        self.remote_agent().map(Box::new).map(Player::BuiltIn)
    }

    fn remote_agent(&self) -> Result<RemoteAgent, CommandError> {
        let (seed, pace) = (
            seed_for("chefshat agent", self.seed),
            Duration::from_millis(self.pace_ms),
        );
        match (self.agent, &self.record, self.seat) {
            (AgentArg::Named(agent), None, None) => Ok(RemoteAgent::named(agent, seed, pace)),
            (AgentArg::Named(_), ..) => Err("--record and --seat are for the agent replay".into()),
            (AgentArg::Replay, Some(record), Some(seat)) => {
                let agent = BuiltInAgent::replay(player_of(record, seat)?);
                Ok(RemoteAgent::new(agent, pace))
            }
            (AgentArg::Replay | AgentArg::Llm, ..) => {
                Err("replay needs --record and --seat".into())
            }
        }
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
        let name = match (&self.name, self.agent) {
            (Some(name), _) => name.clone(),
            (None, AgentArg::Llm) => self.llm.display_name(),
            (None, agent) => agent.name().to_owned(),
        };
        let joined = client
            .join(v1::JoinRoomRequest {
                join_code: code.clone(),
                name: name.clone(),
                kind: v1::ParticipantKind::from(self.kind_of).into(),
                ..v1::JoinRoomRequest::default()
            })
            .await?;
        *last_code = Some(code);
        let waits = match joined.room.as_ref().map_or(0, free_seats) {
            0 => String::new(),
            1 => "waits for 1 other seat to be taken, then ".to_owned(),
            free => format!("waits for {free} other seats to be taken, then "),
        };
        anstream::eprintln!("{name} has seat {}; {waits}plays to the end", joined.seat);
        // The ticket grants the seat: it is shown only here, to the person who started the agent.
        anstream::eprintln!(
            "if this agent stops before the end of its game, resume its seat with --ticket {}",
            joined.ticket
        );
        Ok(joined.ticket)
    }
}

fn agent_arg(name: &str) -> Result<AgentArg, String> {
    if name == BuiltInAgent::REPLAY {
        return Ok(AgentArg::Replay);
    }
    if name == llm::NAME {
        return Ok(AgentArg::Llm);
    }
    name.parse()
        .map(AgentArg::Named)
        .map_err(|error| match error {
            AgentNameError::Unknown(_) => {
                let known = NamedAgent::NAMES.join(", ");
                format!(
                    "use one of {known}, {}, {}",
                    BuiltInAgent::REPLAY,
                    llm::NAME
                )
            }
            AgentNameError::MonteCarlo(error) => error.to_string(),
        })
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
        Err(error) => format!("the seat was lost: {error}"),
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
