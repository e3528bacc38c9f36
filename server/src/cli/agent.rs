//! `chefshat agent`: a built-in agent as a remote client, over the Rust SDK like anybody's agent.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_arena::AgentKind;
use chefshat_client::{Client, Outcome, PlayError, v1};
use clap::Args;

use super::connect::{KindArg, ServerArg, code_in, free_seats};
use super::remote::{MAX_PACE_MS, RemoteAgent, agent_kind, seed_for};
use super::{CommandError, say};

/// Play as a built-in agent on a server.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat agent greedy --server http://127.0.0.1:50051 --code BCDF2345\n  \
                  chefshat agent random --code-file ./join-code --name Rolf --seed 7\n\n\
                  Exit code: 0 when the game finished, 1 when it was aborted or the seat was lost."
)]
pub(super) struct AgentCommand {
    /// Which agent: random, random_unmasked or greedy.
    #[arg(value_parser = agent_kind, value_name = "KIND")]
    agent: AgentKind,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    seat: SeatArgs,
    /// Name to show; standard: the agent's.
    #[arg(long)]
    name: Option<String>,
    /// What to take part as.
    #[arg(long, value_enum, default_value_t = KindArg::Agent)]
    kind_of: KindArg,
    /// Makes the agent's choices repeatable.
    #[arg(long)]
    seed: Option<u64>,
    /// Games to play one after the other; each needs a new join code in the file.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    games: u32,
    /// Milliseconds to wait before each decision, so that people can follow.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MAX_PACE_MS))]
    pace_ms: u64,
    /// Print one JSON line a game.
    #[arg(long)]
    json: bool,
}

/// How the seat is come by.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct SeatArgs {
    /// The room's join code.
    #[arg(long)]
    code: Option<String>,
    /// File with the room's join code; waited for if it is not there yet.
    #[arg(long, value_name = "FILE")]
    code_file: Option<PathBuf>,
    /// Ticket for a seat that was taken before.
    #[arg(long, env = "CHEFSHAT_TICKET", hide_env_values = true)]
    ticket: Option<String>,
}

impl AgentCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.games > 1 && self.seat.code_file.is_none() {
            return Err("a code or ticket is for one game; for more --games give a --code-file into which new codes are written".into());
        }
        let client = self.server.connect_patiently().await?;
        let seed = seed_for("chefshat agent", self.seed);
        let pace = Duration::from_millis(self.pace_ms);
        let mut agent = RemoteAgent::new(self.agent, seed, pace);
        let mut last_code = None;
        let mut all_finished = true;
        for _ in 0..self.games {
            let ticket = self.ticket(&client, &mut last_code).await?;
            let played = client.play(ticket, &mut agent).await;
            all_finished &= matches!(&played, Ok(outcome) if outcome.standing().is_some());
            if self.json {
                say(as_json(&played))?;
            } else {
                say(in_words(&played))?;
            }
        }
        Ok(if all_finished {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    /// The ticket for the next game.
    async fn ticket(
        &self,
        client: &Client,
        last_code: &mut Option<String>,
    ) -> Result<String, CommandError> {
        if let Some(ticket) = &self.seat.ticket {
            return Ok(ticket.clone());
        }
        let code = match (&self.seat.code, &self.seat.code_file) {
            (Some(code), _) => code.clone(),
            (None, Some(file)) => code_in(file, last_code.as_deref()).await?,
            (None, None) => return Err("give --code, --code-file or --ticket".into()),
        };
        let name = self.name.as_deref().unwrap_or(self.agent.name());
        let joined = client
            .join(v1::JoinRoomRequest {
                join_code: code.clone(),
                name: name.to_owned(),
                kind: self.kind_of.kind().into(),
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
        Ok(joined.ticket)
    }
}

fn in_words(played: &Result<Outcome, PlayError>) -> String {
    let outcome = match played {
        Ok(outcome) => outcome,
        Err(error) => return format!("the seat was lost: {error}"),
    };
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

fn as_json(played: &Result<Outcome, PlayError>) -> serde_json::Value {
    let outcome = match played {
        Ok(outcome) => outcome,
        Err(error) => {
            return serde_json::json!({
                "event": "lost", "reason": error.reason(), "message": error.to_string(),
            });
        }
    };
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

/// The reason of an abort without the prefix of its enum.
fn short(reason: v1::AbortReason) -> &'static str {
    let name = reason.as_str_name();
    name.strip_prefix("ABORT_REASON_").unwrap_or(name)
}
