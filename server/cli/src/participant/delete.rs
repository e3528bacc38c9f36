//! `chefshat participant delete`: changes the database first, then the record files. Running it
//! again completes an interrupted run.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::pseudonym::{Pseudonym, Redactions};
use chefshat_record::{jsonl, samples};
use clap::Args;
use serde_json::json;

use super::super::numbers::counted;
use super::super::{CommandError, say};
use super::stored::{Skipped, Who, records_with};
use chefshat_room::ids::Id;
use chefshat_server::store::Forgetting;

const HELP: &str = "\
The name gives way to a pseudonym, \"deleted participant\" and six letters and digits, in the database and in records/*.jsonl; expressions of the \
participant and annotations of its decisions (times measured at its side among them) are dropped. What was played stays, so that the \
games of the others can still be replayed and checked; a record that changes loses its signature. Copies elsewhere (datasets, backups, other servers) are not touched, nor is what \
others wrote in theirs. The server must be stopped; while a game or tournament with the name is not over, nothing is changed.

This cannot be undone. `chefshat participant export` first, if the data are still wanted.

Examples:
  chefshat participant delete P07 --data-dir ./chefshat-data
  chefshat participant delete \"Rosa L.\" --yes --json";

/// Prefix of a pseudonym.
const PSEUDONYM: &str = "deleted participant ";
/// Random bytes of a pseudonym.
const PSEUDONYM_BYTES: usize = 3;

/// Delete a participant's data: a pseudonym replaces the name.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Delete {
    #[command(flatten)]
    who: Who,
    /// Do not ask for confirmation.
    #[arg(long)]
    yes: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The result for the files.
#[derive(Default)]
struct Files {
    changed: u64,
    redactions: Redactions,
    /// The pseudonym that an interrupted run stored in the database.
    earlier: Option<String>,
    skipped: Skipped,
}

impl Delete {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let data_dir = self.who.data_dir()?;
        let mut database = Forgetting::open(&data_dir).await?;
        // A server that was killed may have left a copy of the name in a file it was writing.
        jsonl::remove_unfinished(&data_dir)?;
        self.ask()?;
        let who = Pseudonym {
            name: self.who.name.clone(),
            pseudonym: format!(
                "{PSEUDONYM}{}",
                hex::encode(rand::random::<[u8; PSEUDONYM_BYTES]>())
            ),
        };
        let forgotten = database.forget(&who).await?;
        let files = rewrite(&mut database, &data_dir, &who)
            .await
            .map_err(|error| {
                format!("{error}; not all records were rewritten: run the command again")
            })?;
        database.finish(&forgotten).await?;
        let redactions = Redactions {
            names: forgotten.redactions.names.max(files.redactions.names),
            expressions: (forgotten.redactions.expressions).max(files.redactions.expressions),
            annotations: (forgotten.redactions.annotations).max(files.redactions.annotations),
        };
        let games = forgotten.games.max(files.changed);
        let found = games + forgotten.tournaments > 0;
        let pseudonym = match files.earlier {
            Some(earlier) if forgotten.games + forgotten.tournaments == 0 => earlier,
            _ => who.pseudonym,
        };
        if self.json {
            say(json!({
                "pseudonym": pseudonym,
                "games": games,
                "tournaments": forgotten.tournaments,
                "files": files.changed,
                "expressions": redactions.expressions,
                "annotations": redactions.annotations,
            }))?;
        } else if found {
            say(format_args!(
                "{:?} is now {:?} in {}, {} and {}; dropped: {}, {}",
                who.name,
                pseudonym,
                counted(games, "game"),
                counted(forgotten.tournaments, "tournament"),
                counted(files.changed, "record file"),
                counted(redactions.expressions, "expression"),
                counted(redactions.annotations, "annotation"),
            ))?;
        }
        files.skipped.check(&who.name)?;
        if !found && !self.json {
            anstream::eprintln!("nothing is stored about {:?}", who.name);
        }
        Ok(if found {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    /// Asks for confirmation.
    fn ask(&self) -> Result<(), CommandError> {
        if self.yes {
            return Ok(());
        }
        if !io::stdin().is_terminal() {
            return Err("nothing was changed: confirm with --yes".into());
        }
        let name = &self.who.name;
        let mut out = anstream::stderr();
        write!(
            out,
            "This removes {name:?} from all data here and cannot be undone. Type the name to confirm: "
        )?;
        out.flush()?;
        let mut answer = String::new();
        io::stdin().lock().read_line(&mut answer)?;
        if answer.trim_end_matches(['\r', '\n']) == name {
            Ok(())
        } else {
            Err("nothing was changed".into())
        }
    }
}

/// Rewrites the record files that contain the name, each atomically.
async fn rewrite(
    database: &mut Forgetting,
    data_dir: &Path,
    who: &Pseudonym,
) -> Result<Files, CommandError> {
    let mut files = Files::default();
    for candidate in records_with(data_dir, &who.name)? {
        let Some(mut lines) = files.skipped.read(&candidate) else {
            continue;
        };
        let mut who = who.clone();
        if let Some(held) = held(database, &lines, &who.name).await?
            && held != who.pseudonym
        {
            who.pseudonym.clone_from(&held);
            files.earlier = Some(held);
        }
        // Before the name is gone from the record, so that running it again completes it.
        if let Err(error) = remove_samples(data_dir, &lines, &who.name) {
            files.skipped.fail(error.to_string());
            continue;
        }
        let redactions = who.redact(&mut lines);
        if redactions == Redactions::default() {
            continue;
        }
        if let Err(error) = jsonl::write(&candidate.path, &lines) {
            files.skipped.fail(error.to_string());
            continue;
        }
        files.changed += 1;
        files.redactions += redactions;
    }
    Ok(files)
}

/// Removes the samples of a participant's seats in a game.
fn remove_samples(data_dir: &Path, lines: &[v1::RecordLine], name: &str) -> io::Result<()> {
    let Some(Line::Header(header)) = lines.first().and_then(|line| line.line.as_ref()) else {
        return Ok(());
    };
    let mut seats = header.seats.iter().zip(0..);
    seats.try_for_each(|(seat, number)| {
        if seat.name != name || !seat.built_in_agent.is_empty() {
            return Ok(());
        }
        match std::fs::remove_file(samples::path_of(data_dir, &header.game_id, number)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    })
}

/// The pseudonym the database has for a name in a record, so that file and database agree.
async fn held(
    database: &mut Forgetting,
    lines: &[v1::RecordLine],
    name: &str,
) -> Result<Option<String>, CommandError> {
    let header = lines.iter().find_map(|line| match &line.line {
        Some(Line::Header(header)) => Some(header),
        _ => None,
    });
    let Some((game, header)) = header.and_then(|it| Some((Id::parse(&it.game_id)?, it))) else {
        return Ok(None);
    };
    for seat in &header.seats {
        if seat.name == name
            && seat.built_in_agent.is_empty()
            && let Some(held) = database.name_at(game, seat.seat).await?
            && held.starts_with(PSEUDONYM)
        {
            return Ok(Some(held));
        }
    }
    // A participant who left before the game has no seat in the header but a Seated event.
    let names = sat_down(lines);
    if !names.contains(&name) {
        return Ok(None);
    }
    let stored = database.seated_names(game).await?;
    Ok(pseudonym_of(name, &names, &stored).cloned())
}

/// The names of the participants seated in a record, in order.
fn sat_down(lines: &[v1::RecordLine]) -> Vec<&str> {
    let events = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => event.kind.as_ref(),
        _ => None,
    });
    let names = events.filter_map(|kind| match kind {
        Kind::Seated(seated) => Some(seated.name.as_str()),
        _ => None,
    });
    names.collect()
}

/// The pseudonym stored for a name, by the participants seated in the same game.
fn pseudonym_of<'k>(name: &str, recorded: &[&str], stored: &'k [String]) -> Option<&'k String> {
    let mut both = recorded.iter().zip(stored);
    let found = both.find(|(recorded, stored)| **recorded == name && stored.starts_with(PSEUDONYM));
    found.map(|(_, stored)| stored)
}

#[cfg(test)]
mod tests {
    use crate::participant::delete::*;

    #[test]
    fn participants_who_left_before_the_game_are_found() {
        let seated = |name: &str| v1::RecordLine {
            line: Some(Line::Event(v1::GameEvent {
                kind: Some(Kind::Seated(Box::new(v1::Seated {
                    name: name.into(),
                    ..v1::Seated::default()
                }))),
                ..v1::GameEvent::default()
            })),
        };
        let lines = ["Ana", "Bo", "Ana"].map(seated);
        let recorded = sat_down(&lines);
        assert_eq!(recorded, ["Ana", "Bo", "Ana"]);
        let stored = |names: [&str; 3]| names.map(str::to_owned);
        let held = |names| pseudonym_of("Ana", &recorded, &stored(names)).cloned();
        let pseudonym = format!("{PSEUDONYM}a1b2c3");
        assert_eq!(
            held([&pseudonym, "Bo", &pseudonym]),
            Some(pseudonym.clone())
        );
        assert_eq!(held(["Ana", "Bo", "Ana"]), None);
        assert_eq!(
            held(["Ana", &pseudonym, "Ana"]),
            None,
            "another was deleted"
        );
    }
}
