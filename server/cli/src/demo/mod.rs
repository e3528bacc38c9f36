//! `chefshat demo`: runs a server, agents that connect to it, and a spectator that narrates the
//! game; at the end prints the standings, whether the deals are verified, and where the record is.
//! The game goes through the protocol like any other.

mod table;
mod verify;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_client::Spectator;
use chefshat_client::v1::{self, game_event::Kind};
use chefshat_record::jsonl;
use clap::Args;

use super::numbers::counted;
use super::remote::{MAX_PACE_MS, named_agent};
use super::rules_args::{RulesArgs, rules_of};
use super::{CommandError, data_dir};
use crate::narration::{Narrator, abort_reason, clean, heading, legend, row};
use chefshat_server::host::Host;
use table::Table;

/// Maximum number of agents: the engine's limit of seats.
const MAX_PLAYERS: usize = 6;
/// The default agents, seated in turn.
const STANDARD_AGENTS: [AgentKind; 2] = [AgentKind::Greedy, AgentKind::Random];

/// Run a server and agents over real connections, and watch their game.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat demo\n  chefshat demo --seed 7 --agents greedy,random,random_unmasked\n  \
                  chefshat demo --pace-ms 300 --preset rulebook\n  chefshat demo --json --data-dir ./chefshat-data\n\n\
                  Exit code: 0 when the game finished and its deals check out."
)]
pub(super) struct Demo {
    /// Seed of the deals and the agents' choices, for a repeatable game.
    #[arg(long)]
    seed: Option<u64>,
    /// The agents, seat by seat: random, random_unmasked, greedy, trained, monte_carlo. Default:
    /// greedy and random in turn.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named_agent)]
    agents: Vec<NamedAgent>,
    /// Milliseconds that each agent waits before a decision.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MAX_PACE_MS))]
    pace_ms: u64,
    /// Data directory for the record (records/GAME-ID.jsonl). Default: chefshat in the user's data
    /// directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print JSON lines: the server's address, every event, the result.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

impl Demo {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let (agents, rules) = self.agents_and_rules()?;
        let data_dir = data_dir::prepare(self.data_dir.clone())?;
        let host = Host::in_memory(Some(data_dir.clone())).await?;
        let mut out = anstream::stdout();
        if self.json {
            let address = host.address().to_string();
            let line = serde_json::json!({"event": "listening", "address": address});
            writeln!(out, "{line}")?;
        }
        let pace = Duration::from_millis(self.pace_ms);
        let table = Table::set(host.address(), agents, rules, self.seed, pace).await?;
        if !self.json {
            self.introduce(&mut out, &host, &table)?;
        }
        let end = self.watch(&mut out, &table).await?;
        let Table { agents, room, .. } = table;
        let outcomes = table::outcomes(agents.players).await;
        // The record is complete when the server has stopped.
        host.stop().await?;
        let end = match end {
            Ending::Finished(end) => end,
            Ending::Aborted(reason) => return Err(format!("the game was aborted: {reason}").into()),
        };
        let path = jsonl::path_of(&data_dir, &room.game_id);
        let record = jsonl::read(&path)?;
        let asked = self.seed.map(table::game_seed);
        let checked = verify::check(&record, &room.seed_commitment, asked, &outcomes?)?;
        if self.json {
            let line = result(&end, &room, &agents.names, &agents.kinds, &checked, &path);
            writeln!(out, "{line}")?;
        } else {
            writeln!(out)?;
            write!(out, "{}", row("the deals", &checked.in_words()))?;
            write!(out, "{}", row("the record", &path.display().to_string()))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Agents and rules: as many seats as agents are given, unless the flags set the number.
    fn agents_and_rules(&self) -> Result<(Vec<NamedAgent>, v1::RuleSet), CommandError> {
        let mut message = self.rules.message();
        if !self.agents.is_empty() && message.players.is_none() {
            let named = self.agents.len();
            if !(2..=MAX_PLAYERS).contains(&named) {
                return Err(format!(
                    "--agents names {}; name 2 to {MAX_PLAYERS}, for instance greedy,random",
                    counted(named as u64, "agent")
                )
                .into());
            }
            message.players = u32::try_from(named).ok();
        }
        let rules = rules_of(&message)?;
        let players = rules.players();
        if self.agents.is_empty() {
            let agents = STANDARD_AGENTS
                .map(NamedAgent::from)
                .into_iter()
                .cycle()
                .take(players);
            return Ok((agents.collect(), message));
        }
        if self.agents.len() != players {
            let named = self.agents.len();
            return Err(format!("--agents names {named} agents, but {players} play").into());
        }
        Ok((self.agents.clone(), message))
    }

    fn introduce(
        &self,
        out: &mut impl Write,
        host: &Host,
        table: &Table,
    ) -> Result<(), CommandError> {
        write!(out, "{}", heading("Chef's Hat"))?;
        write!(out, "{}", row("the server", &host.url()))?;
        write!(out, "{}", row("the room", &table.room.room_id))?;
        let deals = match self.seed {
            Some(seed) => format!("from the seed {seed}"),
            None => {
                let commitment = hex::encode(&table.room.seed_commitment);
                format!("commitment {commitment}")
            }
        };
        write!(out, "{}", row("the deals", &deals))?;
        write!(out, "{}", legend())?;
        Ok(())
    }

    /// Shows each event as it arrives, until the game ends.
    async fn watch(&self, out: &mut impl Write, table: &Table) -> Result<Ending, CommandError> {
        let labels = table.agents.kinds.iter().map(|kind| kind.name());
        let mut narrator = Narrator::default().with_labels(labels);
        let mut spectator: Spectator = table.client.spectate(table.room.room_id.as_str(), 1);
        let mut end = Ending::Aborted("the server gave no reason");
        while let Some(event) = spectator.next().await? {
            if self.json {
                // A message may have values that JSON has not, such as NaN: an error, not a panic.
                let game_event = serde_json::to_value(&event)?;
                let line = serde_json::json!({"event": "game", "game_event": game_event});
                writeln!(out, "{line}")?;
            } else if !matches!(event.kind, Some(Kind::Seated(_))) {
                // The start of the game lists the seats.
                write!(out, "{}", narrator.narrate(&event))?;
                out.flush()?;
            }
            match event.kind {
                Some(Kind::GameEnded(ended)) => end = Ending::Finished(*ended),
                Some(Kind::GameAborted(aborted)) => {
                    end = Ending::Aborted(abort_reason(aborted.reason()));
                }
                _ => {}
            }
        }
        Ok(end)
    }
}

/// The end of the game as the spectator saw it.
enum Ending {
    Finished(v1::GameEnded),
    Aborted(&'static str),
}

/// The last line with --json.
fn result(
    end: &v1::GameEnded,
    room: &v1::Room,
    names: &[String],
    kinds: &[NamedAgent],
    checked: &verify::Checked,
    record: &Path,
) -> serde_json::Value {
    let standings: Vec<serde_json::Value> = end
        .standings
        .iter()
        .map(|line| {
            let seat = usize::try_from(line.seat).unwrap_or(usize::MAX);
            serde_json::json!({
                "place": line.place,
                "seat": line.seat,
                "name": names.get(seat).map(|name| clean(name, 64)),
                "agent": kinds.get(seat).map(|kind| kind.name()),
                "points": line.points,
            })
        })
        .collect();
    serde_json::json!({
        "event": "result",
        "room_id": room.room_id,
        "game_id": room.game_id,
        "standings": standings,
        "deals_checked": checked.deals,
        "seed_committed": checked.committed,
        "record": record,
    })
}
