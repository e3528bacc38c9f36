//! The data of a study as files: tables of participants, games, answers and interface traces, the
//! settings, and the records and samples of games. A file is sent in parts, so that no table is in
//! memory as a whole.

use std::collections::BTreeMap;
use std::io;

use chefshat_proto::v1;
use chefshat_record::{outcome, sheet};
use chefshat_study::{Answer, Outcome, Participant, PlayedGame, Study, Task};
use tokio::io::AsyncReadExt as _;
use tokio::sync::mpsc;
use tracing::error;

use super::handle::StudyHandle;
use crate::config::STUDY_EXPORT_CHUNK;
use crate::rooms::Rooms;
use chefshat_room::ids::Id;
use chefshat_store::{StoreError, StoredGame};
use chefshat_wire::convert;

/// A part of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportedFile {
    /// Name of the file.
    pub file: String,
    /// Its next bytes.
    pub data: Vec<u8>,
}

/// Why an export ends early.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The client has gone.
    #[error("the client has gone")]
    Gone,
}

/// A file that is being sent.
struct File<'s> {
    name: String,
    buffer: Vec<u8>,
    sender: &'s mpsc::Sender<ExportedFile>,
}

impl<'s> File<'s> {
    fn new(name: impl Into<String>, sender: &'s mpsc::Sender<ExportedFile>) -> Self {
        Self {
            name: name.into(),
            buffer: Vec::new(),
            sender,
        }
    }

    async fn line(&mut self, text: &str) -> Result<(), ExportError> {
        self.buffer.extend_from_slice(text.as_bytes());
        self.buffer.push(b'\n');
        self.send_full().await
    }

    /// Sends the parts of the buffer that have their full size.
    async fn send_full(&mut self) -> Result<(), ExportError> {
        while self.buffer.len() >= STUDY_EXPORT_CHUNK {
            let rest = self.buffer.split_off(STUDY_EXPORT_CHUNK);
            let data = std::mem::replace(&mut self.buffer, rest);
            self.send(data).await?;
        }
        Ok(())
    }

    async fn row(&mut self, cells: &[String]) -> Result<(), ExportError> {
        let cells: Vec<String> = cells.iter().map(|cell| quoted(cell)).collect();
        self.line(&cells.join(",")).await
    }

    async fn end(mut self) -> Result<(), ExportError> {
        let data = std::mem::take(&mut self.buffer);
        self.send(data).await
    }

    async fn send(&self, data: Vec<u8>) -> Result<(), ExportError> {
        let file = self.name.clone();
        let sent = self.sender.send(ExportedFile { file, data }).await;
        sent.map_err(|_| ExportError::Gone)
    }
}

/// A cell of a table (RFC 4180).
fn quoted(text: &str) -> String {
    let text = sheet::cell(text);
    match text.contains(['"', ',', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into_owned(),
    }
}

fn text(value: impl ToString) -> String {
    value.to_string()
}

fn optional(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, text)
}

impl StudyHandle {
    /// Sends the data of the study, file by file.
    ///
    /// # Errors
    /// The store failed, or nobody receives.
    pub async fn export(
        &self,
        rooms: &Rooms,
        sender: &mpsc::Sender<ExportedFile>,
    ) -> Result<(), ExportError> {
        let study = self.committed().clone();
        let mut settings = File::new("study.json", sender);
        let message = self.describe();
        let json = serde_json::to_string_pretty(&message)
            .map_err(|error| StoreError::Failed(error.to_string()))?;
        settings.line(&json).await?;
        settings.end().await?;
        participants(&study, sender).await?;
        games(self, &study, rooms, sender).await?;
        answers(&study, sender).await?;
        traces(self, &study, rooms, sender).await
    }
}

async fn participants(
    study: &Study,
    sender: &mpsc::Sender<ExportedFile>,
) -> Result<(), ExportError> {
    let mut file = File::new("participants.csv", sender);
    let header = [
        "number",
        "participant",
        "state",
        "slot",
        "conditions",
        "step",
        "sessions",
        "began_at_ms",
        "ended_at_ms",
        "consent_at_ms",
        "consent_version",
        "consent_text_sha256",
        "consent_language",
        "data_deleted",
    ];
    file.row(&header.map(str::to_owned)).await?;
    for (number, participant) in study.participants() {
        let consent = participant.consent.as_ref();
        let state = convert::participant_state(participant.status);
        let prefix = "STUDY_PARTICIPANT_STATE_";
        let row = [
            text(number),
            participant.pseudonym.clone(),
            state
                .as_str_name()
                .trim_start_matches(prefix)
                .to_lowercase(),
            optional(participant.slot),
            conditions_of(study, participant),
            text(participant.step()),
            text(participant.session),
            optional(participant.reached_at_ms.first()),
            optional(participant.ended_at_ms),
            optional(consent.map(|it| it.at_ms)),
            optional(consent.map(|it| &it.version)),
            optional(consent.map(|it| hex::encode(it.text_sha256))),
            optional(consent.map(|it| &it.language)),
            text(participant.data_deleted),
        ];
        file.row(&row).await?;
    }
    file.end().await
}

fn conditions_of(study: &Study, participant: &Participant) -> String {
    let sequence = study.sequence_of(participant).unwrap_or_default();
    let conditions = &study.settings().conditions;
    let ids: Vec<&str> = (sequence.iter())
        .map(|index| conditions[*index].id.as_str())
        .collect();
    ids.join(" ")
}

/// Whether exported data include a game.
fn is_in_data(study: &Study, participant: &Participant, game: &PlayedGame) -> bool {
    if participant.data_deleted {
        return false;
    }
    let sequence = study.sequence_of(participant).unwrap_or_default();
    let steps = study.settings().steps(sequence);
    !matches!(
        steps.get(game.placed.step).map(|step| step.task),
        Some(Task::Practice { in_data: false })
    )
}

async fn games(
    handle: &StudyHandle,
    study: &Study,
    rooms: &Rooms,
    sender: &mpsc::Sender<ExportedFile>,
) -> Result<(), ExportError> {
    let settings = study.settings();
    let factors: Vec<&str> = settings.factors.iter().map(|it| it.name.as_str()).collect();
    let mut file = File::new("games.csv", sender);
    let mut header: Vec<String> = ["study", "number", "participant", "condition"]
        .map(str::to_owned)
        .into();
    header.extend(factors.iter().map(|name| format!("factor_{name}")));
    header.extend(
        [
            "step",
            "practice",
            "attempt",
            "seed_index",
            "seed",
            "seat",
            "game_id",
            "outcome",
            "ended_at_ms",
            "place",
            "points",
            "shifts",
            "decisions",
            "invalid_answers",
            "timeouts",
            "decision_time_us",
        ]
        .map(str::to_owned),
    );
    file.row(&header).await?;
    let (mut records, mut unreadable) = (Vec::new(), Vec::new());
    for (number, participant) in study.participants() {
        for game in &participant.games {
            if !is_in_data(study, participant, game) {
                continue;
            }
            let placed = &game.placed;
            let condition = &settings.conditions[placed.condition];
            let lines = match record_of(rooms, handle.id(), Id(placed.game)).await {
                // One game that cannot be read ends no export of the others.
                Err(StoreError::Unreadable(problem)) => {
                    error!(study = %handle.id(), %problem, "a game is left out of an export");
                    unreadable.push((Id(placed.game), problem));
                    None
                }
                lines => lines?,
            };
            let result = lines
                .as_ref()
                .and_then(|lines| outcome::outcome(lines).ok());
            let seat = result.as_ref().and_then(|it| it.seats.get(placed.seat));
            let seat = seat.map(|seat| &seat.statistics);
            let seeds = match condition.seeds.is_empty() {
                true => &settings.seeds,
                false => &condition.seeds,
            };
            let mut row = vec![
                handle.plan.name.clone(),
                text(number),
                participant.pseudonym.clone(),
                condition.id.clone(),
            ];
            let level = |name: &&str| condition.levels.get(*name).cloned().unwrap_or_default();
            row.extend(factors.iter().map(level));
            row.extend([
                text(placed.step),
                text(placed.practice),
                text(placed.attempt),
                optional(placed.seed_index),
                optional(placed.seed_index.map(|index| hex::encode(seeds[index]))),
                text(placed.seat),
                text(Id(placed.game)),
                match game.ended {
                    None => "playing".to_owned(),
                    Some((Outcome::Finished, _)) => "finished".to_owned(),
                    Some((Outcome::Aborted, _)) => "aborted".to_owned(),
                },
                optional(game.ended.map(|(_, at_ms)| at_ms)),
                optional(seat.map(|it| it.place)),
                optional(seat.map(|it| it.points)),
                optional(result.as_ref().map(|it| it.shifts)),
                optional(seat.map(|it| it.decisions)),
                optional(seat.map(|it| it.wrong_actions)),
                optional(seat.map(|it| it.timeouts)),
                optional(seat.map(|it| it.decision_time_us)),
            ]);
            file.row(&row).await?;
            records.extend(lines.map(|_| Id(placed.game)));
        }
    }
    file.end().await?;
    if !unreadable.is_empty() {
        let mut file = File::new("unreadable.csv", sender);
        file.row(&["game_id", "problem"].map(str::to_owned)).await?;
        for (game, problem) in unreadable {
            file.row(&[text(game), problem]).await?;
        }
        file.end().await?;
    }
    for game in records {
        let lines = match record_of(rooms, handle.id(), game).await {
            // It could be read a moment ago.
            Err(StoreError::Unreadable(_)) => None,
            lines => lines?,
        };
        let Some(lines) = lines else {
            continue;
        };
        let mut file = File::new(format!("records/{game}.jsonl"), sender);
        for line in &lines {
            let json = serde_json::to_string(line)
                .map_err(|error| StoreError::Failed(error.to_string()))?;
            file.line(&json).await?;
        }
        file.end().await?;
        samples(rooms, game, sender).await?;
    }
    Ok(())
}

/// The samples of a game's seats, in files that `chefshat export` finds beside the records.
async fn samples(
    rooms: &Rooms,
    game: Id,
    sender: &mpsc::Sender<ExportedFile>,
) -> Result<(), ExportError> {
    let failed = |error: io::Error| StoreError::Failed(format!("reading samples failed: {error}"));
    for path in rooms.samples().files(game) {
        let Some(name) = path.file_name().and_then(|it| it.to_str()) else {
            continue;
        };
        let mut file = File::new(format!("samples/{name}"), sender);
        let mut stored = tokio::fs::File::open(&path).await.map_err(failed)?;
        while stored.read_buf(&mut file.buffer).await.map_err(failed)? > 0 {
            file.send_full().await?;
        }
        file.end().await?;
    }
    Ok(())
}

/// The record of a game of this study. A record from elsewhere that has the game's id is none.
pub(super) async fn record_of(
    rooms: &Rooms,
    study: Id,
    game: Id,
) -> Result<Option<Vec<v1::RecordLine>>, StoreError> {
    let Some(stored) = rooms.store().finished(game).await? else {
        return Ok(None);
    };
    let is_own = match &stored {
        StoredGame::Hosted(header, ..) => {
            (header.study.as_ref()).is_some_and(|game| game.study == study)
        }
        StoredGame::Imported(_) => false,
    };
    if !is_own {
        return Ok(None);
    }
    let reading = rooms.background().run(move || stored.lines().into_owned());
    let lines = reading.await;
    (lines.map(Some))
        .ok_or_else(|| StoreError::Unreadable(format!("the record of game {game} cannot be made")))
}

async fn answers(study: &Study, sender: &mpsc::Sender<ExportedFile>) -> Result<(), ExportError> {
    let mut file = File::new("answers.csv", sender);
    let header = [
        "number",
        "participant",
        "step",
        "condition",
        "questionnaire",
        "item",
        "scale",
        "position",
        "answer",
        "answered_after_ms",
        "questionnaire_shown_at_ms",
        "questionnaire_answered_at_ms",
    ];
    file.row(&header.map(str::to_owned)).await?;
    for (number, participant) in study.participants() {
        let sequence = study.sequence_of(participant).unwrap_or_default();
        let steps = study.settings().steps(sequence);
        for (step, answers) in &participant.answers {
            let Some((at, Task::Questionnaire(questionnaire))) =
                steps.get(*step).map(|at| (at, at.task))
            else {
                continue;
            };
            let condition = at
                .block
                .or_else(|| (sequence.len() == 1).then(|| sequence[0]));
            let condition = condition.map(|index| &study.settings().conditions[index].id);
            let order = study.item_order(*number, *step).unwrap_or_default();
            for answer in answers.iter() {
                let Some(item) = questionnaire.items.get(answer.item) else {
                    continue;
                };
                let position = order.iter().position(|index| *index == answer.item);
                let row = [
                    text(number),
                    participant.pseudonym.clone(),
                    text(step),
                    optional(condition),
                    questionnaire.id.clone(),
                    item.id.clone(),
                    item.scale.clone(),
                    optional(position.map(|position| position + 1)),
                    match &answer.value {
                        Answer::Number(number) => text(number),
                        Answer::Options(options) => {
                            let options: Vec<String> = options.iter().map(text).collect();
                            options.join(" ")
                        }
                        Answer::Text(words) => words.clone(),
                    },
                    optional(answer.answered_after_ms),
                    optional(participant.reached_at_ms.get(*step)),
                    optional(participant.reached_at_ms.get(step + 1)),
                ];
                file.row(&row).await?;
            }
        }
    }
    file.end().await
}

async fn traces(
    handle: &StudyHandle,
    study: &Study,
    rooms: &Rooms,
    sender: &mpsc::Sender<ExportedFile>,
) -> Result<(), ExportError> {
    let mut file = File::new("traces.csv", sender);
    let header = [
        "number",
        "participant",
        "condition",
        "game_id",
        "decision_id",
        "at_ms",
        "kind",
        "target",
        "duration_ms",
    ];
    file.row(&header.map(str::to_owned)).await?;
    let mut conditions = BTreeMap::new();
    for (number, participant) in study.participants() {
        for game in &participant.games {
            if is_in_data(study, participant, game) {
                conditions.insert((*number, Id(game.placed.game)), game.placed.condition);
            }
        }
    }
    for stored in rooms.store().traces(handle.id()).await? {
        let Some(condition) = conditions.get(&(stored.number, stored.game)) else {
            continue;
        };
        let participant = study.participant(stored.number);
        for trace in &stored.traces {
            let kind = trace.kind().as_str_name();
            let row = [
                text(stored.number),
                participant.map_or_else(String::new, |it| it.pseudonym.clone()),
                study.settings().conditions[*condition].id.clone(),
                text(stored.game),
                text(trace.decision_id),
                text(trace.at_ms),
                kind.trim_start_matches("STUDY_TRACE_KIND_").to_lowercase(),
                trace.target.clone(),
                text(trace.duration_ms),
            ];
            file.row(&row).await?;
        }
    }
    file.end().await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_and_never_formulas() {
        for (cell, expected) in [
            ("plain", "plain"),
            ("", ""),
            ("a,b", "\"a,b\""),
            ("say \"hi\"", "\"say \"\"hi\"\"\""),
            ("two\nlines", "\"two\nlines\""),
            ("-3", "-3"),
            ("=1+2", "'=1+2"),
            ("-cmd", "'-cmd"),
            ("@a,b", "\"'@a,b\""),
            ("\t=1+2", "'\t=1+2"),
            ("\r=1+2", "\"'\r=1+2\""),
        ] {
            assert_eq!(quoted(cell), expected);
        }
    }
}
