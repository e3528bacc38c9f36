//! `chefshat tournament join`: takes part with a built-in agent, through the Rust SDK, until the
//! tournament is over.

use std::process::ExitCode;
use std::time::Duration;

use crate::kind::KindArg;
use chefshat_agents::NamedAgent;
use chefshat_client::{ActionId, Agent, Client, Outcome, v1};
use clap::Args;

use super::super::agent::{outcome_in_words, outcome_json};
use super::super::connect::{JoinArgs, Pass, ServerArg};
use super::super::numbers::counted;
use super::super::remote::{MAX_PACE_MS, RemoteAgent, named_agent, seed_for};
use super::super::{CommandError, say};
use super::tables::{NO_GAME_COUNTED, place_in_words};
use super::words::state;

/// Take part with a built-in agent, until the tournament is over.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament join --agent greedy --name Gustav --code BCDF2345\n  \
                  chefshat tournament join --agent trained --games 8 --code-file ./join-code --json\n\n\
                  Exit code: 0 when the tournament finished, 1 when it was closed or the place in it was lost."
)]
pub(super) struct Join {
    /// The agent: random, random_unmasked, greedy or trained.
    #[arg(long, value_parser = named_agent, value_name = "KIND")]
    agent: NamedAgent,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    join_args: JoinArgs,
    /// Display name, unique in the tournament. Default: the agent's.
    #[arg(long)]
    name: Option<String>,
    /// Kind of participant.
    #[arg(long, value_enum, default_value_t = KindArg::Agent)]
    kind_of: KindArg,
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
}

/// A new place in a tournament.
struct Place {
    tournament_id: String,
    participant: u32,
}

impl Join {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_patiently().await?;
        let (ticket, place) = match self.join_args.pass(None).await? {
            Pass::Ticket(ticket) => (ticket, None),
            Pass::Code(code) => {
                let (ticket, place) = self.take_place(&client, code).await?;
                (ticket, Some(place))
            }
        };
        let mut games = 0_u64;
        let make = |_: &v1::Attached| {
            let seed = seed_for(&format!("chefshat tournament join {games}"), self.seed);
            games += 1;
            Teller {
                agent: RemoteAgent::named(self.agent, seed, Duration::from_millis(self.pace_ms)),
                json: self.json,
            }
        };
        // The tournament may be private.
        let client = client.with_secrets([&ticket])?;
        let played = client.play_tournament(ticket, make).await;
        let outcomes = played.map_err(|error| format!("the place was lost: {error}"))?;
        match place {
            Some(place) => self.tell_end(&client, &place).await,
            None => {
                let games = counted(outcomes.len() as u64, "game");
                anstream::eprintln!("the tournament is over; played here: {games}");
                Ok(ExitCode::SUCCESS)
            }
        }
    }

    async fn take_place(
        &self,
        client: &Client,
        code: String,
    ) -> Result<(String, Place), CommandError> {
        let name = self.name.clone().unwrap_or_else(|| self.agent.name());
        let joined = client
            .join_tournament(v1::JoinTournamentRequest {
                join_code: code,
                name: name.clone(),
                kind: v1::ParticipantKind::from(self.kind_of).into(),
                max_games: self.games,
                // Each game has its own agent.
                stateless: true,
                ..v1::JoinTournamentRequest::default()
            })
            .await?;
        let tournament = joined.tournament.unwrap_or_default();
        let (participant, id) = (joined.participant, tournament.tournament_id);
        anstream::eprintln!("{name} takes part in tournament {id} as participant {participant}");
        // The ticket grants the place: it is shown only here, to the person who started the agent.
        anstream::eprintln!(
            "if this agent stops before the tournament ends, resume its place with --ticket {}",
            joined.ticket
        );
        let place = Place {
            tournament_id: id,
            participant,
        };
        Ok((joined.ticket, place))
    }

    async fn tell_end(&self, client: &Client, place: &Place) -> Result<ExitCode, CommandError> {
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

/// An agent that reports the ends of its games.
struct Teller {
    agent: RemoteAgent,
    json: bool,
}

impl Agent for Teller {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.agent.decide(request)
    }

    fn on_attached(&mut self, attached: &v1::Attached) {
        self.agent.on_attached(attached);
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        self.agent.on_event(event);
    }

    fn on_game_over(&mut self, outcome: &Outcome) {
        let printed = match self.json {
            true => say(outcome_json(outcome)),
            false => say(outcome_in_words(outcome)),
        };
        if let Err(error) = printed {
            // The agent plays on even if nobody listens.
            tracing::debug!(%error, "cannot print the result of a game");
        }
    }
}
