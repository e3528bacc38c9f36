//! Deletes a participant's data from a store and the files of records: the store first, then the
//! files. Doing it again completes what was interrupted.

use std::collections::BTreeSet;
use std::io;
use std::path::PathBuf;

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::pseudonym::{Named, Pseudonym, Redactions};
use chefshat_record::{atomic_file, jsonl, samples};
use chefshat_room::ids::{GameId, Id};

use super::data::{DataError, ParticipantData, blocking};
use super::files::{Candidate, Skipped, records_with};
use chefshat_store::{ForgetError, StoreError};

/// Prefix of a pseudonym.
const PSEUDONYM: &str = "deleted participant ";
/// Random bytes of a pseudonym.
const PSEUDONYM_BYTES: usize = 3;

/// What was deleted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Deleted {
    /// What stands for the name now.
    pub pseudonym: String,
    /// The games of the store that contained the name.
    pub stored_games: BTreeSet<GameId>,
    /// Number of games that contained the name, in the store or in files.
    pub games: u64,
    /// Number of tournaments that contained the name.
    pub tournaments: u64,
    /// Number of studies that have a participant of this name.
    pub studies: u64,
    /// Number of files of records that were written again.
    pub files: u64,
    /// The changes in the games.
    pub redactions: Redactions,
    /// Files that were left as they are.
    pub skipped: Skipped,
}

impl Deleted {
    /// Whether anything was stored about the participant.
    pub fn found_any(&self) -> bool {
        self.games + self.tournaments + self.studies > 0
    }
}

impl From<Deleted> for v1::DeleteParticipantResponse {
    fn from(deleted: Deleted) -> Self {
        Self {
            pseudonym: deleted.pseudonym,
            games: deleted.games,
            tournaments: deleted.tournaments,
            studies: deleted.studies,
            record_files: deleted.files,
            expressions: deleted.redactions.expressions,
            annotations: deleted.redactions.annotations,
            unchanged_files: deleted.skipped.named,
        }
    }
}

/// The result for the files.
#[derive(Default)]
struct Files {
    changed: u64,
    redactions: Redactions,
    /// The pseudonym that an interrupted run stored.
    earlier: Option<String>,
    skipped: Skipped,
}

impl ParticipantData {
    /// Deletes a participant's data while no server uses the store.
    ///
    /// # Errors
    /// A game, a tournament, or a study's game with the name is not over: nothing was changed. Or
    /// the store or the folder of records failed.
    pub async fn delete(&self, who: &Named) -> Result<Deleted, DataError> {
        if self.plays_in_studies(who).await? {
            return Err(ForgetError::GameRunning(who.name.clone()).into());
        }
        // A server that was killed may have left a copy of the name in a file it was writing.
        if let Some(data_dir) = self.data_dir.clone() {
            blocking(move || jsonl::remove_unfinished(&data_dir)).await??;
        }
        let mut deleted = self.delete_from_games(who).await?;
        deleted.studies = self.delete_from_studies(who).await?;
        Ok(deleted)
    }

    /// Deletes a participant's data from games, tournaments and files.
    pub(super) async fn delete_from_games(&self, of: &Named) -> Result<Deleted, DataError> {
        let letters = hex::encode(rand::random::<[u8; PSEUDONYM_BYTES]>());
        let who = Pseudonym {
            of: of.clone(),
            pseudonym: format!("{PSEUDONYM}{letters}"),
            key: self.key.clone(),
        };
        let forgotten = self.store.forget(&who).await?;
        let files = match self.data_dir.clone() {
            Some(data_dir) => self.rewrite(data_dir, &who).await?,
            None => Files::default(),
        };
        if files.skipped.named.is_empty() {
            for game in &forgotten.filed {
                self.store.mark_record_written(*game).await?;
            }
        }
        let stored = forgotten.games.len() as u64;
        let (in_store, in_files) = (forgotten.redactions, files.redactions);
        Ok(Deleted {
            pseudonym: match files.earlier {
                Some(earlier) if stored + forgotten.tournaments == 0 => earlier,
                _ => who.pseudonym,
            },
            stored_games: forgotten.games.into_iter().collect(),
            games: stored.max(files.changed),
            tournaments: forgotten.tournaments,
            studies: 0,
            files: files.changed,
            redactions: Redactions {
                names: in_store.names.max(in_files.names),
                expressions: in_store.expressions.max(in_files.expressions),
                annotations: in_store.annotations.max(in_files.annotations),
            },
            skipped: files.skipped,
        })
    }

    /// Rewrites the files of records that contain the name, each atomically.
    async fn rewrite(&self, data_dir: PathBuf, who: &Pseudonym) -> Result<Files, DataError> {
        let mut files = Files::default();
        let name = who.of.name.clone();
        for candidate in blocking(move || records_with(&data_dir, &name)).await?? {
            let mut skipped = std::mem::take(&mut files.skipped);
            let (candidate, lines, skipped) = blocking(move || {
                let lines = skipped.read(&candidate);
                (candidate, lines, skipped)
            })
            .await?;
            files.skipped = skipped;
            let Some(lines) = lines else { continue };
            let mut who = who.clone();
            let held = self.held(&lines, &who.of).await?;
            let mut stored = None;
            if let Some((pseudonym, lines)) = held {
                if pseudonym != who.pseudonym {
                    who.pseudonym.clone_from(&pseudonym);
                    files.earlier = Some(pseudonym);
                }
                stored = who.of.fingerprint.is_some().then_some(lines);
            }
            match blocking(move || redact(&candidate, lines, &who, stored)).await? {
                Ok(None) => {}
                Ok(Some(redactions)) => {
                    files.changed += 1;
                    files.redactions += redactions;
                }
                Err(problem) => files.skipped.named.push(problem),
            }
        }
        Ok(files)
    }

    /// The pseudonym the store has for a name in a record, so that file and store agree, and the
    /// record as the store has it.
    async fn held(
        &self,
        lines: &[v1::RecordLine],
        who: &Named,
    ) -> Result<Option<(String, Vec<v1::RecordLine>)>, StoreError> {
        let Some(game) = header_of(lines).and_then(|it| Id::parse(&it.game_id)) else {
            return Ok(None);
        };
        let Some(stored) = self.store.finished(game).await? else {
            return Ok(None);
        };
        let stored = blocking(move || stored.lines().into_owned()).await?;
        let pseudonym = pseudonym_of(who, lines, &stored).map(str::to_owned);
        Ok(pseudonym.map(|pseudonym| (pseudonym, stored)))
    }
}

/// Rewrites a file without the participant; `None` if the participant is not in it. `stored` is the
/// record without it, if the store says more precisely than the file where it was.
fn redact(
    candidate: &Candidate,
    mut lines: Vec<v1::RecordLine>,
    who: &Pseudonym,
    stored: Option<Vec<v1::RecordLine>>,
) -> Result<Option<Redactions>, String> {
    // Before the name is gone from the record, so that running it again completes it.
    remove_samples(candidate, &lines, &who.of).map_err(|error| error.to_string())?;
    let redactions = who.redact(&mut lines);
    if stored.is_none() && redactions == Redactions::default() {
        return Ok(None);
    }
    let lines = stored.unwrap_or(lines);
    let written = jsonl::write_private(&candidate.path, jsonl::all_of(&lines));
    written
        .map(|()| Some(redactions))
        .map_err(|error| error.to_string())
}

/// Removes the samples of a participant's seats in a game.
fn remove_samples(record: &Candidate, lines: &[v1::RecordLine], who: &Named) -> io::Result<()> {
    let Some(header) = header_of(lines) else {
        return Ok(());
    };
    let mut seats = header.seats.iter().zip(0..);
    seats.try_for_each(|(seat, number)| {
        if !who.is_at(seat) {
            return Ok(());
        }
        let path = samples::beside(&record.path, &header.game_id, number);
        path.map_or(Ok(()), |path| atomic_file::remove(&path))
    })
}

fn header_of(lines: &[v1::RecordLine]) -> Option<&v1::RecordHeader> {
    lines.iter().find_map(|line| match &line.line {
        Some(Line::Header(header)) => Some(&**header),
        _ => None,
    })
}

/// The pseudonym that a stored record has where another copy of it has the name.
fn pseudonym_of<'s>(
    who: &Named,
    lines: &[v1::RecordLine],
    stored: &'s [v1::RecordLine],
) -> Option<&'s str> {
    let both = names_in(lines).into_iter().zip(names_in(stored));
    // A record does not say which of a name left before the game; the store knows it.
    let is_meant = |name: &str, fingerprint: Option<&str>| match fingerprint {
        Some(fingerprint) => who.is(name, fingerprint),
        None => name == who.name,
    };
    both.filter(|((name, fingerprint), _)| is_meant(name, *fingerprint))
        .map(|(_, (there, _))| there)
        .find(|there| there.starts_with(PSEUDONYM))
}

/// The names of a record: at the seats of its header, with the fingerprints of their keys, and then
/// of those who sat down, in order. A participant who left before the game has no seat in the
/// header.
fn names_in(lines: &[v1::RecordLine]) -> Vec<(&str, Option<&str>)> {
    let seats = header_of(lines).map_or(&[][..], |header| header.seats.as_slice());
    let seats = seats
        .iter()
        .map(|seat| match seat.built_in_agent.is_empty() {
            true => (seat.name.as_str(), Some(seat.name_fingerprint.as_str())),
            false => ("", None),
        });
    let seated = lines.iter().filter_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::Seated(seated)) => Some((seated.name.as_str(), None)),
            _ => None,
        },
        _ => None,
    });
    seats.chain(seated).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pseudonym_is_found_for_participants_who_stayed_and_who_left_before_the_game() {
        let line = |line| v1::RecordLine { line: Some(line) };
        let seat = |name: &str, agent: &str| v1::Participant {
            name: name.into(),
            built_in_agent: agent.into(),
            ..v1::Participant::default()
        };
        let seated = |name: &&str| {
            line(Line::Event(v1::GameEvent {
                kind: Some(Kind::Seated(Box::new(v1::Seated {
                    name: (*name).into(),
                    ..v1::Seated::default()
                }))),
                ..v1::GameEvent::default()
            }))
        };
        let record = |names: [&str; 3]| {
            let header = v1::RecordHeader {
                seats: vec![seat("Ana", "random"), seat(names[1], "")],
                ..v1::RecordHeader::default()
            };
            let mut lines = vec![line(Line::Header(Box::new(header)))];
            lines.extend(names.iter().map(seated));
            lines
        };
        let file = record(["Ana", "Bo", "Ana"]);
        let pseudonym = format!("{PSEUDONYM}a1b2c3");
        let held = |name: &str, stored| {
            let who = Named {
                name: name.into(),
                fingerprint: None,
            };
            pseudonym_of(&who, &file, &record(stored)).map(str::to_owned)
        };
        assert_eq!(
            held("Ana", [&pseudonym, "Bo", &pseudonym]),
            Some(pseudonym.clone())
        );
        assert_eq!(held("Ana", ["Ana", "Bo", "Ana"]), None);
        let other = ["Ana", pseudonym.as_str(), "Ana"];
        assert_eq!(held("Ana", other), None, "another was deleted");
        assert_eq!(held("Bo", other), Some(pseudonym.clone()));
    }
}
