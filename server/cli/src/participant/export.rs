//! `chefshat participant export`: writes a participant's data as JSON Lines, without what others
//! did in the same games.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::pseudonym::ParticipantSeats;
use chefshat_record::replay::replay;
use chefshat_record::summary::summary;
use chefshat_tournament::Change;
use clap::Args;
use serde_json::{Value, json};

use super::super::numbers::counted;
use super::super::{CommandError, say};
use super::stored::{Skipped, Who, records_with};
use chefshat_room::ids::Id;
use chefshat_server::convert;
use chefshat_server::store::tournaments::TournamentEntry;
use chefshat_server::store::{Part, SqliteStore, Store};

const HELP: &str = "\
The first line says whose data these are. Then, for each game that is over: a line `game` (when, the room, its rules, the seat, the \
place), a line `decision` for each of the participant's decisions with its times and annotations, a line `expression` for each of its \
expressions. Then a line `tournament` for each tournament it joined. docs/playing.md describes the fields. The server must be stopped.

Examples:
  chefshat participant export P07 --out p07.jsonl --data-dir ./chefshat-data
  chefshat participant export \"Rosa L.\" --out rosa.jsonl --json";

/// Page size of the list of records.
const AT_A_TIME: usize = 100;

/// Export everything stored about a participant as JSON Lines.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Export {
    #[command(flatten)]
    who: Who,
    /// File to write; it is written atomically.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The lines to write, and their counts.
#[derive(Default)]
struct Sheet {
    lines: Vec<Value>,
    games: u64,
    tournaments: u64,
    decisions: u64,
    expressions: u64,
    skipped: Skipped,
}

impl Export {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let data_dir = self.who.data_dir()?;
        if self.out.exists() && !self.force {
            let out = self.out.display();
            return Err(format!("{out} exists already; --force replaces it").into());
        }
        let store = SqliteStore::open(&data_dir).await?;
        let gathered = gather(&store, &data_dir, &self.who.name).await;
        store.close().await;
        let sheet = gathered?;
        if sheet.games + sheet.tournaments == 0 {
            sheet.skipped.check(&self.who.name)?;
            let name = &self.who.name;
            return Err(format!(
                "nothing is stored about {name:?} in {}: give the exact name the participant played under",
                data_dir.display()
            )
            .into());
        }
        let mut file = AtomicFile::create(&self.out)?;
        let head = json!({ "participant": { "format_version": 1, "name": self.who.name, "server_version": env!("CARGO_PKG_VERSION") } });
        for line in std::iter::once(&head).chain(&sheet.lines) {
            file.write_all(line.to_string().as_bytes())?;
            file.write_all(b"\n")?;
        }
        file.finish()?;
        if self.json {
            say(json!({
                "out": self.out.display().to_string(),
                "games": sheet.games,
                "tournaments": sheet.tournaments,
                "decisions": sheet.decisions,
                "expressions": sheet.expressions,
            }))?;
        } else {
            say(format_args!(
                "{}: {}, {}, {}, {}",
                self.out.display(),
                counted(sheet.games, "game"),
                counted(sheet.decisions, "decision"),
                counted(sheet.expressions, "expression"),
                counted(sheet.tournaments, "tournament"),
            ))?;
        }
        sheet.skipped.check(&self.who.name)?;
        Ok(ExitCode::SUCCESS)
    }
}

/// Everything stored about a name.
async fn gather(store: &SqliteStore, data_dir: &Path, name: &str) -> Result<Sheet, CommandError> {
    let mut sheet = Sheet::default();
    let mut known = BTreeSet::new();
    let filter = v1::RecordFilter {
        participant: name.to_owned(),
        ..v1::RecordFilter::default()
    };
    let mut after = 0;
    loop {
        let found = store.list(&filter, Part::After(after), AT_A_TIME).await?;
        let Some((last, _)) = found.last() else { break };
        after = *last;
        for (_, summary) in found {
            if let Some(game) = Id::parse(&summary.game_id)
                && let Some(stored) = store.finished(game).await?
            {
                sheet.add_game(&summary, &convert::lines_of(&stored), name);
            }
            known.insert(summary.game_id);
        }
    }
    // Imported records may exist as files only.
    for candidate in records_with(data_dir, name)? {
        let Some(lines) = sheet.skipped.read(&candidate) else {
            continue;
        };
        let replayed = match replay(&lines) {
            Ok(replayed) => replayed,
            Err(error) => {
                let why = format!("{}: {error}", candidate.path.display());
                sheet.skipped.note(&candidate, why);
                continue;
            }
        };
        if let Some(summary) = summary(&lines, &replayed)
            && known.insert(summary.game_id.clone())
        {
            sheet.add_game(&summary, &lines, name);
        }
    }
    for tournament in store.tournaments(usize::MAX).await? {
        for entry in &tournament.entries {
            if let TournamentEntry::Change(
                Change::Joined(entrant) | Change::Replaced { by: entrant, .. },
            ) = entry
                && entrant.built_in.is_none()
                && entrant.name == name
            {
                sheet.tournaments += 1;
                sheet.lines.push(json!({ "tournament": {
                    "tournament_id": tournament.header.id.to_string(),
                    "name": tournament.header.settings.name,
                    "created_at_ms": tournament.header.created_at_ms,
                    "stateless": entrant.stateless,
                } }));
            }
        }
    }
    Ok(sheet)
}

impl Sheet {
    /// Adds what the participant did in a game, if it took part.
    fn add_game(&mut self, summary: &v1::RecordSummary, lines: &[v1::RecordLine], name: &str) {
        let game_id = &summary.game_id;
        let mut own = ParticipantSeats::at_start(lines, name);
        let mut rest = Vec::new();
        let (mut decisions, mut expressions) = (0, 0);
        for line in lines.iter().filter_map(|line| line.line.as_ref()) {
            match line {
                Line::Decision(decision) if own.has(decision.seat) => {
                    decisions += 1;
                    rest.push(json!({ "decision": decision, "game_id": game_id }));
                }
                Line::PrivateExpression(private) if own.has(private.seat) => {
                    expressions += 1;
                    rest.push(expression(
                        game_id,
                        private.elapsed_ms,
                        private.expression.as_ref(),
                    ));
                }
                Line::Event(event) => {
                    own.follow(event, name);
                    if let Some(Kind::ExpressionShown(shown)) = &event.kind
                        && own.has(shown.seat)
                    {
                        expressions += 1;
                        rest.push(expression(
                            game_id,
                            event.elapsed_ms,
                            shown.expression.as_ref(),
                        ));
                    }
                }
                _ => {}
            }
        }
        let seats: Vec<&v1::Participant> = (summary.seats.iter())
            .filter(|seat| seat.built_in_agent.is_empty() && seat.name == name)
            .collect();
        if seats.is_empty() && rest.is_empty() {
            return;
        }
        let results: Vec<&v1::Standing> = (summary.standings.iter())
            .filter(|standing| seats.iter().any(|seat| seat.seat == standing.seat))
            .collect();
        self.games += 1;
        self.decisions += decisions;
        self.expressions += expressions;
        self.lines.push(json!({ "game": {
            "game_id": game_id,
            "room_name": summary.room_name,
            "state": summary.state().as_str_name(),
            "created_at_ms": summary.created_at_ms,
            "ended_at_ms": summary.ended_at_ms,
            "tournament_id": summary.tournament_id,
            "rules": summary.rules,
            "seats": seats,
            "results": results,
        } }));
        self.lines.append(&mut rest);
    }
}

fn expression(game_id: &str, elapsed_ms: u64, expression: Option<&v1::Expression>) -> Value {
    json!({ "expression": expression, "elapsed_ms": elapsed_ms, "game_id": game_id })
}
