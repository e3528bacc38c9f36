//! `chefshat play`: a person plays in a terminal: a seat of a server, a local game, or a
//! tournament. This file has the arguments; `join` gets the ticket, `run` plays, `ending` prints
//! the result.

mod app;
mod ending;
mod follow;
mod join;
#[cfg(test)]
mod key_tests;
mod keys;
mod link;
mod lobby;
mod lobby_view;
mod part;
mod pick;
mod run;
#[cfg(test)]
mod several_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tournament_session;
#[cfg(test)]
mod tournament_tests;
mod view;

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_agents::NamedAgent;
use chefshat_client::Client;
use chefshat_client::v1::{self, seat_config::FilledBy};
use chefshat_record::jsonl;
use clap::Args;

use crate::CommandError;
use crate::connect::{ServerArg, TICKET, in_environment, ticket_in_environment};
use crate::data_dir;
use crate::error::tell;
use crate::name_key::NameKeyArg;
use crate::remote::named_agent;
use crate::rules_args::{RulesArgs, rules_of};
use crate::ticket_file;
use crate::tui::screen::missing;
use chefshat_server::host::Host;
use ending::{Hints, print_end};
use run::{Taken, play};

/// Maximum wait of built-in agents before a decision, in milliseconds.
const MAX_PACE_MS: i64 = 60_000;

/// Play in this terminal.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  chefshat play --local\n  \
                  chefshat play --server http://127.0.0.1:50051 --code BCDF2345 --name Ada\n  \
                  chefshat play --local --agents trained,trained,trained --target-shifts 3\n\n\
                  The code of a tournament works, too: your games start by themselves, with the standings between them, until the \
                  tournament is over.\n\n\
                  Press ? for the keys. A ticket is printed before the game: with it you resume if you leave, or the connection or the terminal is lost.\n\n\
                  Exit code: 0 when the game or tournament finished, 1 when it was aborted, closed, left or lost, 2 without a terminal.")]
pub(crate) struct Play {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    seat: SeatArgs,
    /// Display name. Default: that of CHEFSHAT_NAME, or else Guest.
    #[arg(long, conflicts_with = "ticket")]
    name: Option<String>,
    #[command(flatten)]
    name_key: NameKeyArg,
    /// With --local: the built-in agents, in turn: random, greedy, trained, monte_carlo.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named_agent,
          default_values = ["trained", "greedy", "random"])]
    agents: Vec<NamedAgent>,
    /// With --local: milliseconds that each agent waits before a decision.
    #[arg(long, default_value_t = 900, value_parser = clap::value_parser!(u32).range(0..=MAX_PACE_MS))]
    pace_ms: u32,
    /// With --local: data directory for the record (records/GAME-ID.jsonl). Default: chefshat in
    /// the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Record with each decision how long it was on screen, as the annotation
    /// person_decision_time_ms.
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

/// How to get a seat.
#[derive(Debug, Args)]
#[group(required = ticket_in_environment().is_none(), multiple = true)]
struct SeatArgs {
    /// Join code of a room or tournament.
    #[arg(long, conflicts_with_all = ["ticket", "local"])]
    code: Option<String>,
    /// Ticket of a seat or place to resume. CHEFSHAT_TICKET does the same, unless another flag says what
    /// to play, and does not show in lists of processes.
    #[arg(long)]
    ticket: Option<String>,
    /// File that keeps the ticket, readable only by you, until the game or tournament is over. If it has
    /// one, you resume.
    #[arg(long, value_name = "FILE", conflicts_with = "ticket")]
    ticket_file: Option<PathBuf>,
    /// Run a server in this process and play against built-in agents.
    #[arg(long, conflicts_with_all = ["ticket", "ticket_file"])]
    local: bool,
}

impl Play {
    pub(crate) async fn run(self) -> Result<ExitCode, CommandError> {
        if let Some(code) = missing(
            "use `chefshat agent` to play with a built-in agent, `chefshat demo` to see a game",
        ) {
            return Ok(code);
        }
        if !self.seat.local && !self.rules.are_standard() {
            return Err(
                "the creator of a room or tournament sets its rules; flags for rules need --local"
                    .into(),
            );
        }
        let Some(data_dir) = (self.seat.local)
            .then(|| data_dir::prepare(self.data_dir.clone()))
            .transpose()?
        else {
            let taken = self.take().await?;
            let there = self.server.flags();
            let file = self.seat.ticket_file.as_deref();
            let back = match file {
                Some(file) => format!("chefshat play {there} --ticket-file {}", file.display()),
                None => self.server.with_ticket(TICKET, &taken.ticket, "play"),
            };
            // It stays above the screen, whatever ends that.
            tell(format_args!("to resume: {back}"));
            let hints = Hints {
                back: Some(back),
                results: format!("chefshat tournament results {there}"),
                page: Some(self.server.page()),
                record: Box::new(move |game| format!("chefshat records get {game} {there}")),
            };
            let ticket = taken.ticket.clone();
            let part = play(taken, self.times).await?;
            if part.has_result() {
                ticket_file::forget(file, &ticket);
            }
            return print_end(&part, &hints);
        };
        let host = Host::in_memory(Some(data_dir.clone())).await?;
        let played = async { play(self.take_local(&host).await?, self.times).await }.await;
        // The record is complete when the server has stopped.
        host.stop().await?;
        let hints = Hints {
            // The server has stopped.
            back: None,
            results: String::new(),
            page: None,
            record: Box::new(move |game| {
                format!(
                    "chefshat watch {}",
                    jsonl::path_of(&data_dir, game).display()
                )
            }),
        };
        print_end(&played?, &hints)
    }

    async fn take(&self) -> Result<Taken, CommandError> {
        let client = self.server.connect().await?;
        let file = self.seat.ticket_file.as_deref();
        let kept = ticket_file::kept(file)?;
        if let (Some(code), None) = (&self.seat.code, &kept) {
            let file = ticket_file::prepare(file)?;
            let taken = join::by_code(client, code, &self.name(), self.name_key.key()?).await?;
            if let Some(Err(error)) = file.map(|file| file.write(&taken.ticket)) {
                let back = self.server.with_ticket(TICKET, &taken.ticket, "play");
                tell(format_args!("{error}; to resume: {back}"));
            }
            return Ok(taken);
        }
        let ticket = kept.or_else(|| self.seat.ticket.clone());
        let ticket = ticket.or_else(ticket_in_environment);
        Ok(Taken {
            client,
            ticket: ticket.ok_or("there is no ticket yet: give --code")?,
            game: None,
        })
    }

    fn name(&self) -> String {
        let name = self
            .name
            .clone()
            .or_else(|| in_environment("CHEFSHAT_NAME"));
        name.unwrap_or_else(|| "Guest".to_owned())
    }

    /// A seat in a new room with built-in agents.
    async fn take_local(&self, host: &Host) -> Result<Taken, CommandError> {
        let rules = self.rules.message();
        let players = rules_of(&rules)?.players();
        let client = Client::connect(host.url()).await?;
        let person = FilledBy::ReservedFor(v1::ParticipantKind::Human.into());
        let agents = self.agents.iter().cycle();
        let agents = agents.map(|kind| FilledBy::BuiltInAgent(kind.name()));
        let seats = std::iter::once(person).chain(agents).take(players);
        let seats = seats.map(|filled_by| v1::SeatConfig {
            filled_by: Some(filled_by),
            ..v1::SeatConfig::default()
        });
        let room = join::own_room(rules, seats.collect(), self.pace_ms);
        let made = client.create_room(room).await?;
        join::by_code(client, &made.join_code, &self.name(), self.name_key.key()?).await
    }
}
