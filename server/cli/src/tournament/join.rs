//! `chefshat tournament join`: takes part with a built-in agent or a language model, through the
//! Rust SDK, until the tournament is over.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::kind::KindArg;
use crate::name_key::NameKeyArg;
use chefshat_client::{ActionId, Agent, Client, Outcome, PlayOptions, v1};
use clap::Args;

use super::super::agent::{outcome_in_words, outcome_json};
use super::super::connect::{JoinArgs, Pass, ServerArg};
use super::super::error::tell;
use super::super::llm::LlmArgs;
use super::super::numbers::counted;
use super::super::player::{Player, PlayerArg, player_arg};
use super::super::remote::MAX_PACE_MS;
use super::super::{CommandError, say, ticket_file};
use super::tables::{NO_GAME_COUNTED, place_in_words};
use super::words::state;

/// Take part with a built-in agent or a language model, until the tournament is over.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament join --agent greedy --name Gustav --code BCDF2345\n  \
                  chefshat tournament join --agent trained --games 8 --code-file ./join-code --json\n  \
                  chefshat tournament join --agent llm --endpoint http://127.0.0.1:8080/v1 --model qwen3 --code BCDF2345\n\n\
                  Exit code: 0 when the tournament finished, 1 when it was closed, the place in it was lost, or a model's fallback played too much of a game."
)]
pub(super) struct Join {
    /// The agent: random, greedy, trained, monte_carlo, or llm (a language model, which plays one
    /// game at a time).
    #[arg(long, value_parser = player_arg, value_name = "KIND")]
    agent: PlayerArg,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    join_args: JoinArgs,
    /// Display name, unique in the tournament. Default: the agent's.
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    name_key: NameKeyArg,
    /// Kind of participant. Default: agent, and model for llm.
    #[arg(long, value_enum)]
    kind_of: Option<KindArg>,
    /// Maximum number of games at a time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    games: u32,
    /// Seed of the agent's choices, for repeatable games.
    #[arg(long)]
    seed: Option<u64>,
    /// Milliseconds to wait before each decision, so that people can follow the game.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MAX_PACE_MS))]
    pace_ms: u64,
    /// Print one JSON line per game, and one at the end.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    llm: LlmArgs,
}

impl Join {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.games > 1 && matches!(self.agent, PlayerArg::Llm) {
            return Err("a language model plays one game at a time: leave out --games".into());
        }
        let pace = Duration::from_millis(self.pace_ms);
        let players = self.agent.players(&self.llm, self.seed, pace)?;
        players.check().await?;
        let client = self.server.connect_patiently().await?;
        let ticket = match self.join_args.pass(None).await? {
            Pass::Ticket(ticket) => ticket,
            Pass::Code(code) => self.take_place(&client, code).await?,
        };
        let mut games = 0_u64;
        let all_played = Arc::new(AtomicBool::new(true));
        let make = |_: &v1::Attached| {
            let player = players.player(&format!("chefshat tournament join {games}"));
            games += 1;
            Teller {
                player,
                json: self.json,
                all_played: Arc::clone(&all_played),
            }
        };
        // The tournament may be private.
        let client = client.with_secrets([&ticket])?;
        let played = client
            .take_part(ticket.as_str(), make, &PlayOptions::default())
            .await;
        let (entered, outcomes) = played.map_err(|error| format!("the place was lost: {error}"))?;
        ticket_file::forget(self.join_args.ticket_file(), &ticket);
        let ended = match entered {
            Some(place) => self.tell_end(&client, &place).await?,
            None => {
                let games = counted(outcomes.len() as u64, "game");
                tell(format_args!(
                    "the ticket was that of a seat; played here: {games}"
                ));
                ExitCode::SUCCESS
            }
        };
        Ok(match all_played.load(Ordering::Relaxed) {
            true => ended,
            false => ExitCode::FAILURE,
        })
    }

    /// Joins, and returns the ticket.
    async fn take_place(&self, client: &Client, code: String) -> Result<String, CommandError> {
        let name = self.name.clone();
        let name = name.unwrap_or_else(|| self.agent.display_name(&self.llm));
        let kind = self.kind_of.unwrap_or(self.agent.kind());
        let ticket_file = ticket_file::prepare(self.join_args.ticket_file())?;
        let joined = client
            .join_tournament(v1::JoinTournamentRequest {
                join_code: code,
                name: name.clone(),
                kind: v1::ParticipantKind::from(kind).into(),
                max_games: self.games,
                // Each game has its own agent.
                stateless: true,
                name_key: self.name_key.key()?,
                ..v1::JoinTournamentRequest::default()
            })
            .await?;
        let tournament = joined.tournament.unwrap_or_default();
        let (participant, id) = (joined.participant, tournament.tournament_id);
        tell(format_args!(
            "{name} takes part in tournament {id} as participant {participant}"
        ));
        let resumes = "if this agent stops before the tournament ends, resume its place";
        ticket_file::keep(ticket_file, &joined.ticket, resumes);
        Ok(joined.ticket)
    }

    async fn tell_end(
        &self,
        client: &Client,
        place: &v1::Entered,
    ) -> Result<ExitCode, CommandError> {
        let results = client
            .tournament_results(place.tournament_id.as_str())
            .await?;
        let end = results.tournament.unwrap_or_default().state();
        let participants = results.standings.len();
        let standing = (results.standings.into_iter())
            .find(|standing| standing.participant == place.participant)
            .ok_or("the server's standings lack this participant")?;
        if self.json {
            let state = state(end);
            say(serde_json::json!({"event": "over", "state": state, "standing": standing}))?;
        } else {
            let place = place_in_words(&standing, participants);
            let place = place.as_deref().unwrap_or(NO_GAME_COUNTED);
            say(format_args!("the tournament is {}: {place}", state(end)))?;
        }
        Ok(match end {
            v1::TournamentState::Finished => ExitCode::SUCCESS,
            _ => ExitCode::FAILURE,
        })
    }
}

/// A player that reports the ends of its games.
struct Teller {
    player: Player,
    json: bool,
    /// Whether no game of this program was played by a fallback instead of its model.
    all_played: Arc<AtomicBool>,
}

impl Agent for Teller {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.player.agent().decide(request)
    }

    fn try_decide(&mut self, request: &v1::DecisionRequest) -> Option<ActionId> {
        self.player.agent().try_decide(request)
    }

    fn annotate(&mut self) -> Option<v1::Annotations> {
        self.player.agent().annotate()
    }

    fn on_attached(&mut self, attached: &v1::Attached) {
        self.player.agent().on_attached(attached);
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        self.player.agent().on_event(event);
    }

    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        self.player.agent().on_snapshot(snapshot);
    }

    fn on_result(&mut self, result: &v1::AnswerResult) {
        self.player.agent().on_result(result);
    }

    fn on_game_over(&mut self, outcome: &Outcome) {
        self.player.agent().on_game_over(outcome);
        if !self.player.has_played() {
            self.all_played.store(false, Ordering::Relaxed);
        }
        let printed = match self.json {
            true => say(self.player.as_json(outcome_json(outcome))),
            false => say(self.player.in_words(&outcome_in_words(outcome))),
        };
        if let Err(error) = printed {
            // The agent plays on even if nobody listens.
            tracing::debug!(%error, "cannot print the result of a game");
        }
    }
}
