//! `chefshat play`: a person at a terminal takes a seat of a server, or of one started for this game. This file gets the seat and carries
//! keys, messages and pictures to and fro; what they mean is in `app` and `pick`, how it looks in `view`, the connection in `link`.

mod app;
mod link;
mod pick;
#[cfg(test)]
mod tests;
mod view;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use chefshat_arena::AgentKind;
use chefshat_client::v1::{self, seat_command::Command, seat_config::FilledBy};
use chefshat_client::{Client, ENTROPY_BYTES};
use chefshat_records::jsonl;
use clap::Args;
use tokio::sync::mpsc;
use tokio::time::{Instant, MissedTickBehavior, interval};

use super::connect::ServerArg;
use super::host::Host;
use super::narrator::{MAX_NAME, abort_reason, ordinal};
use super::numbers::counted;
use super::remote::agent_kind;
use super::rules_args::{RulesArgs, rules_of};
use super::terminal::look::Look;
use super::terminal::screen::{Key, Screen, asked_to_end, missing};
use super::terminal::table::{End, Table};
use super::terminal::view::padded;
use super::{CommandError, data_dir, say};
use crate::ids::random_bytes;
use app::{App, Do, EXPRESSIONS, Input, Link};

/// Messages that may wait to be taken.
const INPUTS: usize = 64;
/// Commands that may wait for the connection.
const COMMANDS: usize = 16;
/// How often the clock is drawn.
const TICK: Duration = Duration::from_millis(250);
/// Time for a decision at a table of one's own: nobody waits but built-in agents.
const OWN_DECISION_MS: u32 = 3_600_000;
/// Longest wait of built-in agents before they decide, milliseconds.
const MAX_PACE_MS: i64 = 60_000;
/// Key under which the time before the person's eyes is recorded with a decision, as the page for browsers does it.
const PERSON_TIME_KEY: &str = "person_decision_time_ms";

/// Play as a person at this terminal.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  chefshat play --local\n  \
                  chefshat play --server http://127.0.0.1:50051 --code BCDF2345 --name Ada\n  \
                  chefshat play --local --agents trained,trained,trained --target-shifts 3\n\n\
                  Press ? at the table for the keys.\n\n\
                  Exit code: 0 when the game finished, 1 when it was aborted, left or lost, 2 without a terminal.")]
pub(super) struct Play {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    seat: SeatArgs,
    /// Name to show.
    #[arg(
        long,
        env = "CHEFSHAT_NAME",
        default_value = "Guest",
        conflicts_with = "ticket"
    )]
    name: String,
    /// With --local: the built-in agents at the table, in turn: random, random_unmasked, greedy, trained.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = agent_kind,
          default_values = ["trained", "greedy", "random"])]
    agents: Vec<AgentKind>,
    /// With --local: milliseconds that each of them waits before it decides.
    #[arg(long, default_value_t = 900, value_parser = clap::value_parser!(u32).range(0..=MAX_PACE_MS))]
    pace_ms: u32,
    /// With --local: folder for the record (records/GAME-ID.jsonl). Standard: chefshat in the user's data folder.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Record with each decision how long it was before your eyes, as the annotation person_decision_time_ms.
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

/// How a seat is come by.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct SeatArgs {
    /// The join code of a room.
    #[arg(long)]
    code: Option<String>,
    /// Ticket of a seat that was taken before.
    #[arg(long, env = "CHEFSHAT_TICKET", hide_env_values = true)]
    ticket: Option<String>,
    /// Start a server in this process and play against built-in agents.
    #[arg(long)]
    local: bool,
}

/// A seat, and the table as it was when it was taken.
struct Taken {
    client: Client,
    ticket: String,
    seat: Option<u32>,
    table: Table,
}

impl Play {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if let Some(code) =
            missing("`chefshat agent` plays without one, `chefshat demo` shows a game")
        {
            return Ok(code);
        }
        if !self.seat.local && !self.rules.are_standard() {
            return Err(
                "a room has its rules from who made it; flags for rules go with --local".into(),
            );
        }
        let Some(data_dir) = (self.seat.local)
            .then(|| data_dir::prepare(self.data_dir.clone()))
            .transpose()?
        else {
            let taken = self.take().await?;
            let app = play(taken, self.times).await?;
            let hint = format!(
                "chefshat records get {} --server {}",
                app.table.game_id,
                self.server.url()
            );
            return told(&app, &hint);
        };
        let host = Host::start(data_dir.clone()).await?;
        let played = async { play(self.take_local(&host).await?, self.times).await }.await;
        // The record is written when the server has ended.
        host.stop().await?;
        let app = played?;
        let path = jsonl::path_of(&data_dir, &app.table.game_id);
        told(&app, &format!("chefshat watch {}", path.display()))
    }

    async fn take(&self) -> Result<Taken, CommandError> {
        let client = self.server.connect().await?;
        match (&self.seat.ticket, &self.seat.code) {
            (Some(ticket), _) => Ok(Taken {
                client,
                ticket: ticket.clone(),
                seat: None,
                table: Table::default(),
            }),
            (None, code) => {
                let code = code.clone().unwrap_or_default();
                join(client, code, self.name.clone()).await
            }
        }
    }

    /// A room of this person and built-in agents.
    async fn take_local(&self, host: &Host) -> Result<Taken, CommandError> {
        let rules = self.rules.message();
        let players = rules_of(&rules)?.players();
        let client = Client::connect(host.url()).await?;
        let person = FilledBy::ReservedFor(v1::ParticipantKind::Human.into());
        let agents = self.agents.iter().cycle();
        let agents = agents.map(|kind| FilledBy::BuiltInAgent(kind.name().to_owned()));
        let made = client
            .create_room(v1::CreateRoomRequest {
                name: "your table".into(),
                rules: Some(rules),
                seats: std::iter::once(person)
                    .chain(agents)
                    .take(players)
                    .map(|filled_by| v1::SeatConfig {
                        filled_by: Some(filled_by),
                    })
                    .collect(),
                policy: Some(v1::RoomPolicy {
                    decision_time_ms: Some(OWN_DECISION_MS),
                    pace_ms: Some(self.pace_ms),
                    ..v1::RoomPolicy::default()
                }),
                ..v1::CreateRoomRequest::default()
            })
            .await?;
        join(client, made.join_code, self.name.clone()).await
    }
}

async fn join(client: Client, join_code: String, name: String) -> Result<Taken, CommandError> {
    let joined = client
        .join(v1::JoinRoomRequest {
            join_code,
            name,
            kind: v1::ParticipantKind::Human.into(),
            ..v1::JoinRoomRequest::default()
        })
        .await?;
    let room = joined.room.unwrap_or_default();
    Ok(Taken {
        client,
        ticket: joined.ticket,
        seat: Some(joined.seat),
        table: Table::of_room(&room),
    })
}

/// Plays until the person has seen the end or leaves; with `times`, the person's own times are recorded.
async fn play(taken: Taken, times: bool) -> Result<App, CommandError> {
    let Taken {
        client,
        ticket,
        seat,
        table,
    } = taken;
    let (inputs, mut from_server) = mpsc::channel(INPUTS);
    let (commands, for_server) = mpsc::channel(COMMANDS);
    let entropy = random_bytes::<ENTROPY_BYTES>().to_vec();
    let connection = link::Seat::new(client.clone(), ticket.clone(), entropy);
    let serving = tokio::spawn(connection.serve(for_server, inputs));

    let look = Look::of_environment();
    let mut app = App::new(table, seat);
    let begun = Instant::now();
    let now = || u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let ended = asked_to_end()?;
    tokio::pin!(ended);
    let mut screen = Screen::open()?;
    let mut listening = true;
    while !app.left {
        screen.draw(|frame| view::draw(frame, look, &app, now()))?;
        let input = tokio::select! {
            key = screen.keys.recv() => Input::Key(key.unwrap_or(Key::Interrupt)),
            input = from_server.recv(), if listening => match input {
                Some(input) => input,
                None => {
                    listening = false;
                    continue;
                }
            },
            _ = ticks.tick() => continue,
            _ = &mut ended => Input::Key(Key::Interrupt),
        };
        let Some(what) = app.take(input, now()) else {
            continue;
        };
        match what {
            Do::Leave => {}
            Do::Express(index) => express(&client, &ticket, index),
            what => {
                // One that finds no connection is not needed: the decision is put anew.
                if let Some(command) = command(what, times) {
                    let _ = commands.try_send(command);
                }
            }
        }
    }
    drop(screen);
    drop(commands);
    drop(from_server);
    serving.await?;
    Ok(app)
}

/// What the server is told. How long a person took is told only where that was asked for.
fn command(what: Do, times: bool) -> Option<Command> {
    match what {
        Do::Answer {
            decision_id,
            action,
            took_ms,
        } => Some(Command::Answer(v1::Answer {
            decision_id,
            action,
            annotations: (times && took_ms > 0).then(|| v1::Annotations {
                extra: BTreeMap::from([(PERSON_TIME_KEY.to_owned(), took_ms.to_string())])
                    .into_iter()
                    .collect(),
                ..v1::Annotations::default()
            }),
        })),
        Do::Resume => Some(Command::Resume(v1::ResumeSeat {})),
        Do::Express(_) | Do::Leave => None,
    }
}

/// Shows a feeling to the table, beside whatever else goes on.
fn express(client: &Client, ticket: &str, index: usize) {
    let Some((label, valence, arousal)) = EXPRESSIONS.get(index).copied() else {
        return;
    };
    let (client, ticket) = (client.clone(), ticket.to_owned());
    let expression = v1::Expression {
        label: label.to_owned(),
        valence: Some(valence),
        arousal: Some(arousal),
        source: v1::ExpressionSource::SelfReport.into(),
        ..v1::Expression::default()
    };
    // Everybody sees it in the story, the person too; one that is refused is not seen.
    tokio::spawn(async move { client.express(ticket, expression).await });
}

/// The end in a few lines for after the screen is gone.
fn told(app: &App, record: &str) -> Result<ExitCode, CommandError> {
    let mine = |standings: &[v1::Standing]| {
        let me = app.me;
        standings.iter().find(|line| Some(line.seat) == me).copied()
    };
    match &app.table.end {
        Some(End::Finished(standings)) => {
            for line in standings {
                let name = padded(&app.table.name(line.seat), MAX_NAME);
                let points = counted(line.points, "point");
                say(format_args!(
                    "{}  {name}  {points:>10}",
                    ordinal(line.place)
                ))?;
            }
            if let Some(line) = mine(standings) {
                say(format_args!(
                    "you have place {} of {}",
                    line.place,
                    standings.len()
                ))?;
            }
            say(format_args!("the record: {record}"))?;
            Ok(ExitCode::SUCCESS)
        }
        Some(End::Aborted(reason)) => {
            let why = abort_reason(*reason);
            say(format_args!(
                "the game was aborted and has no result: {why}"
            ))?;
            Ok(ExitCode::FAILURE)
        }
        None => {
            if let Link::Over(Some(why)) = &app.link {
                return Err(format!("the seat is lost: {why}").into());
            }
            say("you left the table before the game ended")?;
            Ok(ExitCode::FAILURE)
        }
    }
}
