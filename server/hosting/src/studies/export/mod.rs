//! The data of a study as files: the settings, tables of participants, games and interface traces
//! (`columns`), of items and answers (`questionnaires`), the records and samples of games, and what the
//! columns mean (`table`). A file is sent in parts, so that none is in memory as a whole.

mod columns;
mod questionnaires;
mod table;

use std::collections::{BTreeMap, BTreeSet};
use std::io;

use chefshat_proto::v1;
use chefshat_record::sheet;
use chefshat_study::{Participant, PlayedGame, Stage, Study, Task};
use serde::Serialize;
use tokio::io::AsyncReadExt as _;
use tokio::sync::mpsc;
use tracing::error;

use super::handle::StudyHandle;
use crate::rooms::Rooms;
use chefshat_room::ids::GameId;
use chefshat_store::{StoreError, StoredGame};
use chefshat_wire::convert;
use columns::{CodebookRow, GameResult, GameRow, GroupRow, ParticipantRow, SessionRow, TraceRow};
use questionnaires::{AnswerRow, ItemRow};
use table::{Sheet, Table};

/// Most bytes in one message of the data of a study.
const STUDY_EXPORT_CHUNK: usize = 64 * 1024;

/// Bytes that most lines of a table do not exceed.
const LINE: usize = 512;

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
        self.bytes(b"\n").await
    }

    async fn bytes(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        self.buffer.extend_from_slice(bytes);
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

    /// Writes a line of a table.
    async fn row(
        &mut self,
        cells: impl Iterator<Item = impl AsRef<str>>,
    ) -> Result<(), ExportError> {
        let mut writer = csv::WriterBuilder::new();
        let mut line = writer.buffer_capacity(LINE).from_writer(&mut self.buffer);
        let mut written = Ok(());
        for cell in cells {
            let cell = sheet::cell(cell.as_ref());
            written = written.and_then(|()| line.write_field(cell.as_bytes()));
        }
        let written = written.and_then(|()| line.write_record(None::<&[u8]>));
        drop(line);
        written.map_err(|error| StoreError::Failed(error.to_string()))?;
        self.send_full().await
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

/// A table that is being sent.
struct TableFile<'s, R> {
    table: Table<R>,
    file: File<'s>,
}

impl<'s, R> TableFile<'s, R> {
    async fn new(
        table: Table<R>,
        sender: &'s mpsc::Sender<ExportedFile>,
    ) -> Result<Self, ExportError> {
        let mut file = File::new(table.sheet().file, sender);
        file.row(table.header()).await?;
        Ok(Self { table, file })
    }

    async fn row(&mut self, row: &R) -> Result<(), ExportError> {
        self.file.row(self.table.cells(row)).await
    }

    /// Returns what the table is.
    async fn end(self) -> Result<Sheet, ExportError> {
        self.file.end().await?;
        Ok(self.table.into_sheet())
    }
}

impl StudyHandle {
    /// The study as a message without what lets anybody take part, or be paid by a panel: data are
    /// passed on.
    fn publishable(&self) -> v1::Study {
        let mut study = self.describe();
        study.open_link.clear();
        if let Some(recruiting) = (study.settings.as_mut()).and_then(|it| it.recruiting.as_mut()) {
            recruiting.completed_url.clear();
            recruiting.left_url.clear();
            recruiting.full_url.clear();
            recruiting.screened_out_url.clear();
            recruiting.left_over_url.clear();
        }
        study
    }

    /// Sends the data of the study, or those of its test participants, file by file.
    ///
    /// # Errors
    /// The store failed, or nobody receives.
    pub async fn export(
        &self,
        rooms: &Rooms,
        test: bool,
        sender: &mpsc::Sender<ExportedFile>,
    ) -> Result<(), ExportError> {
        let study = &self.committed().clone();
        let people = study.participants().iter();
        let people = people.filter(|(_, it)| it.test == test);
        let export = Export {
            handle: self,
            study,
            people: people.map(|(number, it)| (*number, it)).collect(),
            rooms,
            sender,
        };
        export.json_file("study.json", &self.publishable()).await?;
        export.pictures().await?;
        let mut sheets = vec![export.participants().await?];
        sheets.push(export.sessions().await?);
        if study.settings().groups.is_some() {
            sheets.push(export.groups().await?);
        }
        sheets.extend(export.games().await?);
        sheets.push(export.items().await?);
        sheets.push(export.answers().await?);
        sheets.push(export.traces().await?);
        sheets.push(export.codebook(&sheets).await?);
        let name = format!("study-{}", self.id());
        let descriptor = table::descriptor(&name, &self.plan.name, &sheets);
        export.json_file("datapackage.json", &descriptor).await
    }
}

/// What is exported, and to whom it is sent.
struct Export<'s> {
    handle: &'s StudyHandle,
    study: &'s Study,
    /// The participants whose data are exported, by number.
    people: Vec<(u32, &'s Participant)>,
    rooms: &'s Rooms,
    sender: &'s mpsc::Sender<ExportedFile>,
}

impl Export<'_> {
    /// Sends the pictures of the study.
    async fn pictures(&self) -> Result<(), ExportError> {
        for picture in &self.handle.header.settings.pictures {
            let mut file = File::new(format!("pictures/{}", picture.name), self.sender);
            file.bytes(&picture.data).await?;
            file.end().await?;
        }
        Ok(())
    }

    /// Sends a value as a file.
    async fn json_file(&self, name: &str, value: &impl Serialize) -> Result<(), ExportError> {
        let json = serde_json::to_string_pretty(value);
        let json = json.map_err(|error| StoreError::Failed(error.to_string()))?;
        let mut file = File::new(name, self.sender);
        file.line(&json).await?;
        file.end().await
    }

    async fn participants(&self) -> Result<Sheet, ExportError> {
        let study = self.study;
        let mut file = TableFile::new(columns::participants(study.settings()), self.sender).await?;
        for &(number, participant) in &self.people {
            let row = ParticipantRow {
                study,
                number,
                participant,
            };
            file.row(&row).await?;
        }
        file.end().await
    }

    async fn sessions(&self) -> Result<Sheet, ExportError> {
        let mut file = TableFile::new(columns::sessions(), self.sender).await?;
        let asks = self.study.settings().asks_for_consent();
        for &(number, participant) in &self.people {
            if asks && participant.consent.is_none() {
                continue;
            }
            for (session, opened) in &participant.devices {
                let row = SessionRow {
                    number,
                    participant,
                    session: *session,
                    opened,
                };
                file.row(&row).await?;
            }
        }
        file.end().await
    }

    /// Sends the groups, in the order in which they were formed.
    async fn groups(&self) -> Result<Sheet, ExportError> {
        let study = self.study;
        let mut groups: BTreeMap<u32, Vec<(u32, &Participant)>> = BTreeMap::new();
        for &(number, participant) in &self.people {
            if let Some(group) = participant.group {
                groups.entry(group).or_default().push((number, participant));
            }
        }
        let mut file = TableFile::new(columns::groups(study.settings()), self.sender).await?;
        for (group, members) in groups {
            let row = GroupRow {
                study,
                group,
                members,
            };
            file.row(&row).await?;
        }
        file.end().await
    }

    /// Sends the games, what cannot be read of them, and their records.
    async fn games(&self) -> Result<Vec<Sheet>, ExportError> {
        let study = self.study;
        let settings = study.settings();
        let mut file = TableFile::new(columns::games(settings), self.sender).await?;
        let (mut records, mut unreadable) = (Vec::new(), BTreeMap::new());
        // Those of a group have one game.
        let mut exported = BTreeSet::new();
        for &(number, participant) in &self.people {
            for game in &participant.games {
                if !is_in_data(study, participant, game) {
                    continue;
                }
                let id = convert::game_of(&game.placed);
                let lines = match record_of(self.handle, self.rooms, id).await {
                    // One game that cannot be read ends no export of the others.
                    Err(StoreError::Unreadable(problem)) => {
                        error!(study = %self.handle.id(), %problem, "a game is left out of an export");
                        unreadable.insert(id, problem);
                        None
                    }
                    lines => lines?,
                };
                let result = lines.as_ref();
                let row = GameRow {
                    study,
                    name: &self.handle.plan.name,
                    number,
                    participant,
                    game,
                    result: result.map(|lines| GameResult::of(lines, game.placed.seat)),
                };
                file.row(&row).await?;
                if lines.is_some() && exported.insert(id) {
                    records.push(id);
                }
            }
        }
        let mut sheets = vec![file.end().await?];
        for game in records {
            let lines = match record_of(self.handle, self.rooms, game).await {
                // It could be read a moment ago.
                Err(StoreError::Unreadable(_)) => None,
                lines => lines?,
            };
            let Some(lines) = lines else {
                continue;
            };
            let mut file = File::new(format!("records/{game}.jsonl"), self.sender);
            for line in &lines {
                let json = serde_json::to_string(line)
                    .map_err(|error| StoreError::Failed(error.to_string()))?;
                file.line(&json).await?;
            }
            file.end().await?;
            let problem = samples(self.rooms, game, self.sender).await?;
            unreadable.extend(problem.map(|problem| (game, problem)));
        }
        if !unreadable.is_empty() {
            let mut file = TableFile::new(columns::unreadable(), self.sender).await?;
            for row in unreadable {
                file.row(&row).await?;
            }
            sheets.push(file.end().await?);
        }
        Ok(sheets)
    }

    /// Sends the items of all questionnaires.
    async fn items(&self) -> Result<Sheet, ExportError> {
        let mut file = TableFile::new(questionnaires::items(), self.sender).await?;
        for part in self.study.settings().stages.iter().flat_map(Stage::parts) {
            let Task::Questionnaire(questionnaire) = &part.task else {
                continue;
            };
            for (index, item) in questionnaire.items.iter().enumerate() {
                let row = ItemRow {
                    questionnaire,
                    index,
                    item,
                };
                file.row(&row).await?;
            }
        }
        file.end().await
    }

    /// Sends the items of the questionnaires that participants have reached, with their answers.
    async fn answers(&self) -> Result<Sheet, ExportError> {
        let study = self.study;
        let settings = study.settings();
        let mut file = TableFile::new(questionnaires::answers(settings), self.sender).await?;
        for &(number, participant) in &self.people {
            if participant.data_deleted {
                continue;
            }
            let sequence = study.sequence_of(participant).unwrap_or_default();
            let steps = settings.steps(sequence).into_iter().enumerate();
            for (step, at) in steps.take(participant.reached_at_ms.len()) {
                let Task::Questionnaire(questionnaire) = at.task else {
                    continue;
                };
                let condition = at
                    .block
                    .or_else(|| (sequence.len() == 1).then(|| sequence[0]));
                let answers = participant.answers.get(&step);
                let answers = answers.map_or(&[][..], |answers| answers);
                let shown = study.shown_items(number, step).unwrap_or_default();
                for (index, item) in questionnaire.items.iter().enumerate() {
                    let position = shown.iter().position(|it| *it == index);
                    let row = AnswerRow {
                        number,
                        participant,
                        step,
                        condition: condition.map(|index| &settings.conditions[index]),
                        questionnaire,
                        item,
                        position: position.map(|position| position + 1),
                        answer: answers.iter().find(|answer| answer.index() == index),
                    };
                    file.row(&row).await?;
                }
            }
        }
        file.end().await
    }

    async fn traces(&self) -> Result<Sheet, ExportError> {
        let study = self.study;
        let settings = study.settings();
        let mut conditions = BTreeMap::new();
        for &(number, participant) in &self.people {
            for game in &participant.games {
                if is_in_data(study, participant, game) {
                    conditions.insert(
                        (number, convert::game_of(&game.placed)),
                        game.placed.condition,
                    );
                }
            }
        }
        let traces = self.rooms.store().traces(self.handle.id()).await?;
        let mut file = TableFile::new(columns::traces(settings), self.sender).await?;
        let mut earlier: BTreeMap<(u32, GameId), &[v1::StudyTrace]> = BTreeMap::new();
        for stored in &traces {
            let Some(condition) = conditions.get(&(stored.number, stored.game)) else {
                continue;
            };
            let participant = study.participant(stored.number);
            // Traces whose receipt did not reach the device came again, before those that followed.
            let of = (stored.number, stored.game);
            let before = earlier.insert(of, &stored.traces);
            let new = before.and_then(|before| stored.traces.strip_prefix(before));
            for trace in new.unwrap_or(&stored.traces) {
                let row = TraceRow {
                    number: stored.number,
                    session: stored.session,
                    pseudonym: participant.map_or("", |it| &it.pseudonym),
                    condition: &settings.conditions[*condition],
                    game: stored.game,
                    trace,
                };
                file.row(&row).await?;
            }
        }
        file.end().await
    }

    /// Sends what the columns of these tables mean.
    async fn codebook(&self, sheets: &[Sheet]) -> Result<Sheet, ExportError> {
        let mut file = TableFile::new(columns::codebook(), self.sender).await?;
        for sheet in sheets {
            for index in 0..sheet.columns.len() {
                file.row(&CodebookRow { sheet, index }).await?;
            }
        }
        file.end().await
    }
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

/// The samples of a game's seats, in files that `chefshat export` finds beside the records. Returns why
/// some cannot be read: no reason to leave out the others.
pub(super) async fn samples(
    rooms: &Rooms,
    game: GameId,
    sender: &mpsc::Sender<ExportedFile>,
) -> Result<Option<String>, ExportError> {
    let mut problem = None;
    for path in rooms.samples().files(game) {
        let Some(name) = path.file_name().and_then(|it| it.to_str()) else {
            continue;
        };
        let left_out = |error: io::Error| {
            error!(path = %path.display(), %error, "samples are left out of an export");
            Some(format!("samples/{name}: {error}"))
        };
        let mut file = File::new(format!("samples/{name}"), sender);
        let mut stored = match tokio::fs::File::open(&path).await {
            Ok(stored) => stored,
            Err(error) => {
                problem = left_out(error);
                continue;
            }
        };
        loop {
            match stored.read_buf(&mut file.buffer).await {
                Ok(0) => break,
                Ok(_) => file.send_full().await?,
                Err(error) => {
                    problem = left_out(error);
                    break;
                }
            }
        }
        file.end().await?;
    }
    Ok(problem)
}

/// The record of a game of this study, in turn among long computations. A record from elsewhere that has
/// the game's id is none.
pub(super) async fn record_of(
    handle: &StudyHandle,
    rooms: &Rooms,
    game: GameId,
) -> Result<Option<Vec<v1::RecordLine>>, StoreError> {
    let background = rooms.background();
    // Before it is read: the record of a long game takes much time and memory.
    let _slice = background.slice(handle.charged).await;
    let Some(stored) = rooms.store().finished(game).await? else {
        return Ok(None);
    };
    let is_own = match &stored {
        StoredGame::Hosted(header, ..) => {
            (header.study.as_ref()).is_some_and(|game| game.study == handle.id())
        }
        StoredGame::Imported(_) => false,
    };
    if !is_own {
        return Ok(None);
    }
    let reading = background.run(move || stored.lines().into_owned());
    let lines = reading.await;
    (lines.map(Some))
        .ok_or_else(|| StoreError::Unreadable(format!("the record of game {game} cannot be made")))
}
