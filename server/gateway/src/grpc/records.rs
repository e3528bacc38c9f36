//! `RecordService`: lists, reads and imports records of finished games.

use std::iter::Peekable;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::cost::{Cost, shapes};
use chefshat_proto::v1::{
    self, game_event::Kind, record_line::Line, record_service_server::RecordService,
};
use chefshat_record::jsonl::excess;
use chefshat_record::replay;
use chefshat_record::signature::SigningKey;
use chefshat_record::summary::summary;
use prost::Message as _;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status, Streaming};

use super::access::opened;
use super::follow::{self, Responses, Sender};
use super::forward::Gateway;
use super::limits::charged;
use super::lookup::RecordView;
use super::pace::Pace;
use super::pages;
use super::recorded::Recorded;
use super::status::{
    OWNER_UNREACHABLE, RECORD_UNREADABLE, Refusal, SERIES_OPEN, UNREADABLE, disk_nearly_full,
    has_reason, invalid, read_failed, status,
};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{FairSemaphore, Key, Permit, Shares};
use chefshat_base::tasks::short;
use chefshat_hosting::config::{
    IMPORT_IDLE_TIMEOUT, IMPORT_RATE, MAX_IMPORT_MEMORY, MAX_IMPORTS, MAX_RECORDS_SENT,
    RECORD_SEND_TIMEOUT, ServerConfig,
};
use chefshat_hosting::tournaments::Tournaments;
use chefshat_room::ids::GameId;
use chefshat_store::{Listed, Part, StoreError};

/// Largest record that may be imported, bytes as encoded.
const MAX_IMPORT_BYTES: usize = 64 * 1024 * 1024;
/// Most lines of a record that may be imported.
const MAX_IMPORT_LINES: usize = 1_500_000;
/// How long the upload of a record may take.
const IMPORT_TIMEOUT: Duration = Duration::from_secs(120);

/// Most lines in one message, and most bytes unless a single line is longer: well below the limit
/// of gRPC clients.
const LINES_PER_MESSAGE: usize = 512;
const BYTES_PER_MESSAGE: usize = 1024 * 1024;
/// Summaries examined for one page.
const RECORDS_LOOKED_AT: usize = 500;
/// Summaries read at a time while many records are streamed.
const STREAM_PAGE: usize = 100;

/// Bytes that a part of an import counts for at least.
const LEAST_PART: usize = 1024;

/// The service.
#[derive(Debug, Clone)]
pub struct Records {
    recorded: Recorded,
    tournaments: Arc<Tournaments>,
    /// Limits the records in memory while clients receive them.
    sending: Arc<FairSemaphore>,
    receiving: Arc<FairSemaphore>,
    /// The memory of records that are being imported, in KiB.
    imported: Arc<FairSemaphore>,
    /// How fast their parts are received, all together: decoding them takes the threads that rooms
    /// run on.
    import_pace: Arc<Pace>,
    allow_import: bool,
    /// Signs records of which parts are left out.
    key: Option<Arc<SigningKey>>,
    /// Cancelled when streams of many records must end.
    closing: CancellationToken,
}

impl Records {
    /// Creates the service for these games; `closing` ends its streams of many records.
    pub fn new(
        recorded: Recorded,
        tournaments: Arc<Tournaments>,
        config: &ServerConfig,
        closing: CancellationToken,
    ) -> Self {
        let shares = recorded.rooms().shares();
        Self {
            recorded,
            tournaments,
            sending: FairSemaphore::new(MAX_RECORDS_SENT, shares),
            receiving: FairSemaphore::new(MAX_IMPORTS, shares),
            imported: FairSemaphore::new(MAX_IMPORT_MEMORY / 1024, Shares::ALL),
            import_pace: Arc::new(Pace::new(IMPORT_RATE)),
            allow_import: config.allow_import,
            key: config.signing_key.clone(),
            closing,
        }
    }

    async fn page(
        &self,
        filter: &v1::RecordFilter,
        part: Part,
        count: usize,
    ) -> Result<Vec<Listed>, Status> {
        let store = self.recorded.rooms().store();
        store.list(filter, part, count).await.map_err(read_failed)
    }

    /// Sends all records that match a filter, page by page. Reads the next page when the client has
    /// received the last one. What cannot be read is named, and the next follows.
    async fn send_all(
        &self,
        caller: &Caller,
        request: &v1::StreamRecordsRequest,
        filter: &v1::RecordFilter,
        (key, gateway): (Key, Option<&Gateway>),
        sender: &Sender<v1::StreamRecordsResponse>,
    ) -> Result<(), Status> {
        let mut after = 0;
        // The game after which the stream resumes, until it was found.
        let mut resumes_after = Some(&request.after).filter(|game| !game.is_empty());
        loop {
            let page = self.page(filter, Part::After(after), STREAM_PAGE).await?;
            let Some(last) = page.last() else {
                return match resumes_after {
                    Some(game) => Err(cannot_resume(game)),
                    None => Ok(()),
                };
            };
            after = last.number;
            for Listed { summary, owner, .. } in page {
                let (game, is_listed) = match &summary {
                    Ok(summary) => {
                        let is_listed = self.recorded.is_listed(caller, summary, owner.as_ref());
                        (summary.game_id.clone(), is_listed.await?)
                    }
                    Err(unreadable) => (unreadable.game.to_string(), caller.is_operator()),
                };
                if !is_listed {
                    continue;
                }
                if let Some(wanted) = resumes_after {
                    if *wanted == game {
                        resumes_after = None;
                    }
                    continue;
                }
                let _place = self.sending.take(key).await;
                let lines = match summary {
                    Ok(_) => {
                        let key = self.key.clone();
                        let shown = move |lines, view| seen(view, key.as_deref(), lines);
                        self.recorded.lines(caller, gateway, &game, shown).await
                    }
                    Err(unreadable) => {
                        Err(read_failed(StoreError::Unreadable(unreadable.to_string())))
                    }
                };
                let response = |lines| v1::StreamRecordsResponse {
                    lines,
                    unreadable: None,
                };
                match lines {
                    Ok(lines) => send(sender, lines, response).await?,
                    // Withheld while games with the same deals are being played, or deleted since the
                    // page was read.
                    Err(status)
                        if has_reason(&status, SERIES_OPEN)
                            || has_reason(&status, "GAME_UNKNOWN") => {}
                    Err(status) if has_reason(&status, RECORD_UNREADABLE) => {
                        send_part(sender, left_out(unreadable(game))).await?;
                    }
                    Err(status) if has_reason(&status, OWNER_UNREACHABLE) => {
                        let problem = status.message().to_owned();
                        let unreachable = v1::UnreadableRecord {
                            game_id: game,
                            problem,
                        };
                        send_part(sender, left_out(unreachable)).await?;
                    }
                    Err(status) => return Err(status),
                }
            }
        }
    }
}

/// The part of a stream that names a record that is left out.
fn left_out(record: v1::UnreadableRecord) -> v1::StreamRecordsResponse {
    v1::StreamRecordsResponse {
        lines: Vec::new(),
        unreadable: Some(record),
    }
}

/// Names a record that cannot be read. The log says why.
fn unreadable(game_id: String) -> v1::UnreadableRecord {
    v1::UnreadableRecord {
        game_id,
        problem: UNREADABLE.to_owned(),
    }
}

/// A stream cannot resume after a game that is not in its list.
fn cannot_resume(game: &str) -> Status {
    status(
        Code::NotFound,
        "GAME_UNKNOWN",
        format!(
            "the stream has no game {game:?} to resume after; it may have been deleted since: start without it"
        ),
        [("field", "after")],
    )
}

impl RecordService for Records {
    type GetRecordStream = Responses<v1::GetRecordResponse>;
    type StreamRecordsStream = Responses<v1::StreamRecordsResponse>;

    async fn list_records(
        &self,
        request: Request<v1::ListRecordsRequest>,
    ) -> Result<Response<v1::ListRecordsResponse>, Status> {
        let (caller, request) = opened(request);
        let filter = checked(request.filter)?;
        let mut last = pages::last_shown(&request.page_token)?;
        let size = pages::page_size(request.page_size);
        let mut response = v1::ListRecordsResponse::default();
        let (mut rest, mut looked_at) = (true, 0);
        // Records that the caller does not see are skipped, up to a limit for one page.
        'page: while rest && looked_at < RECORDS_LOOKED_AT {
            let part = match request.newest_first {
                false => last.map_or(Part::FROM_OLDEST, Part::After),
                true => last.map_or(Part::FROM_NEWEST, Part::Before),
            };
            // One more than requested, to find out whether there is another page.
            let found = self.page(&filter, part, size + 1).await?;
            rest = found.len() > size;
            looked_at += found.len();
            for listed in found {
                if response.records.len() == size {
                    rest = true;
                    break 'page;
                }
                last = Some(listed.number);
                match listed.summary {
                    Ok(summary) => {
                        let owner = listed.owner.as_ref();
                        if self.recorded.is_listed(&caller, &summary, owner).await? {
                            response.records.push(summary);
                        }
                    }
                    Err(bad) if caller.is_operator() => {
                        response.unreadable.push(unreadable(bad.game.to_string()));
                    }
                    Err(_) => {}
                }
            }
        }
        if let (true, Some(last)) = (rest, last) {
            response.next_page_token = last.to_string();
        }
        Ok(Response::new(response))
    }

    async fn get_record(
        &self,
        request: Request<v1::GetRecordRequest>,
    ) -> Result<Response<Self::GetRecordStream>, Status> {
        let (caller, request) = opened(request);
        let place = self.sending.take(Key::of_caller(&caller)).await;
        let key = self.key.clone();
        let shown = move |lines, view| seen(view, key.as_deref(), lines);
        let lines = self
            .recorded
            .of_game(&caller, &request.game_id, shown)
            .await?;
        // One record is sent also while the server closes its streams.
        let closing = CancellationToken::new();
        let (response, sending) = follow::stream(closing, move |sender| async move {
            let _place = place;
            send(&sender, lines, |lines| v1::GetRecordResponse { lines }).await
        });
        tokio::spawn(short("one call", sending));
        Ok(response)
    }

    async fn stream_records(
        &self,
        request: Request<v1::StreamRecordsRequest>,
    ) -> Result<Response<Self::StreamRecordsStream>, Status> {
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let (caller, mut request) = opened(request);
        let key = Key::of_caller(&caller);
        let filter = checked(request.filter.take())?;
        let service = self.clone();
        let (response, sending) = follow::stream(self.closing.clone(), move |sender| async move {
            let charged = (key, gateway.as_ref());
            let sending = service.send_all(&caller, &request, &filter, charged, &sender);
            sending.await
        });
        tokio::spawn(short("one call", sending));
        Ok(response)
    }

    async fn import_record(
        &self,
        request: Request<Streaming<v1::ImportRecordRequest>>,
    ) -> Result<Response<v1::ImportRecordResponse>, Status> {
        let key = charged(request.extensions());
        if !self.allow_import {
            return Err(status(
                Code::PermissionDenied,
                "IMPORT_OFF",
                "this server does not import records; its host can allow it with --allow-import",
                [],
            ));
        }
        if !self.recorded.rooms().store().has_space() {
            return Err(disk_nearly_full("the server's disk is nearly full"));
        }
        let _place = self.receiving.take(key).await;
        let receiving = received(request.into_inner(), &self.imported, &self.import_pace, key);
        let receiving = timeout(IMPORT_TIMEOUT, receiving).await;
        let (lines, _memory) = receiving.map_err(|_| import_too_slow())??;
        let replaying = move || {
            let summary = replay::replay(&lines).map(|replayed| summary(&lines, &replayed));
            // On this server it is public, whatever it was where it was played.
            let summary = summary.map(|summary| {
                summary.map(|summary| v1::RecordSummary {
                    visibility: v1::Visibility::Unspecified.into(),
                    ..summary
                })
            });
            (Arc::<[v1::RecordLine]>::from(lines), summary)
        };
        let (lines, summary) = self.recorded.with_place(key, replaying).await?;
        let summary = summary
            .map_err(|error| refused(error.line, &error.problem))?
            .ok_or_else(|| refused(1, "the game has no deal"))?;
        let game = GameId::parse(&summary.game_id)
            .ok_or_else(|| refused(1, "the game id does not have 32 hexadecimal digits"))?;
        let rooms = self.recorded.rooms();
        let is_ours = rooms.is_running(game) || self.tournaments.has_announced(game);
        let bytes = lines.iter().map(|line| line.encoded_len()).sum();
        rooms.may_store(key, bytes).map_err(Refusal::from)?;
        let new = !is_ours
            && (rooms.store().import(game, summary.clone(), lines).await).map_err(import_failed)?;
        if !new {
            return Err(status(
                Code::AlreadyExists,
                "GAME_KNOWN",
                "the server already has a game with this id",
                [("field", "game_id")],
            ));
        }
        rooms.record_writer().write_record(game, key);
        Ok(Response::new(v1::ImportRecordResponse {
            record: Some(summary),
        }))
    }
}

/// A record as its reader sees it: players do not see what was only for the record, nor references to
/// media. If anything is left out of a record that this server signed, it signs what remains.
fn seen(
    view: RecordView,
    key: Option<&SigningKey>,
    mut lines: Vec<v1::RecordLine>,
) -> Vec<v1::RecordLine> {
    if view == RecordView::Whole || !lines.iter().any(is_withheld_in) {
        return lines;
    }
    let vouches = key.filter(|key| key.has_signed(&lines));
    lines.retain_mut(|line| {
        match &mut line.line {
            Some(Line::PrivateExpression(_) | Line::Marker(_)) => return false,
            Some(Line::Decision(decision)) => decision.annotations = None,
            Some(Line::Event(event)) => {
                if let Some(Kind::ExpressionShown(shown)) = &mut event.kind
                    && let Some(expression) = &mut shown.expression
                {
                    expression.media.clear();
                }
            }
            Some(Line::Footer(footer)) => {
                footer.signature = None;
                footer.parts_withheld = true;
            }
            _ => {}
        }
        true
    });
    if let Some(key) = vouches {
        key.sign_in_place(&mut lines);
    }
    lines
}

/// Whether players do not see all of a line.
fn is_withheld_in(line: &v1::RecordLine) -> bool {
    match &line.line {
        Some(Line::PrivateExpression(_) | Line::Marker(_)) => true,
        Some(Line::Decision(decision)) => decision.annotations.is_some(),
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::ExpressionShown(shown)) => {
                (shown.expression.as_ref()).is_some_and(|it| !it.media.is_empty())
            }
            _ => false,
        },
        _ => false,
    }
}

/// Checks that the enum values of a filter are known.
fn checked(filter: Option<v1::RecordFilter>) -> Result<v1::RecordFilter, Status> {
    let filter = filter.unwrap_or_default();
    let unknown = [
        ("state", v1::RoomState::try_from(filter.state).is_err()),
        ("kind", v1::ParticipantKind::try_from(filter.kind).is_err()),
        ("origin", v1::GameOrigin::try_from(filter.origin).is_err()),
    ];
    match unknown.into_iter().find(|(_, is_unknown)| *is_unknown) {
        Some((name, _)) => Err(invalid("FILTER_REFUSED", name, "not a value of this enum")),
        None => Ok(filter),
    }
}

/// The lines of a record, and the memory that they take.
async fn received(
    mut requests: Streaming<v1::ImportRecordRequest>,
    memory: &Arc<FairSemaphore>,
    pace: &Pace,
    key: Key,
) -> Result<(Vec<v1::RecordLine>, Vec<Permit>), Status> {
    let mut received = Received::default();
    loop {
        let next = timeout(IMPORT_IDLE_TIMEOUT, requests.message());
        match next.await.map_err(|_| import_too_slow())?? {
            Some(request) => {
                let before = received.bytes;
                received.add(request, memory, key)?;
                pace.pass((received.bytes - before).max(LEAST_PART)).await;
            }
            None => return Ok(received.put_together()),
        }
    }
}

/// The parts of a record that have arrived.
#[derive(Default)]
struct Received {
    parts: Vec<Vec<v1::RecordLine>>,
    lines: usize,
    bytes: usize,
    /// The memory of each part.
    memory: Vec<Permit>,
}

impl Received {
    /// Checks the next part and adds it.
    fn add(
        &mut self,
        request: v1::ImportRecordRequest,
        memory: &Arc<FairSemaphore>,
        key: Key,
    ) -> Result<(), Status> {
        self.bytes += request.encoded_len();
        if self.bytes > MAX_IMPORT_BYTES {
            return Err(status(
                Code::ResourceExhausted,
                "RECORD_TOO_LARGE",
                format!("a record has at most {MAX_IMPORT_BYTES} bytes"),
                [("max_bytes", &MAX_IMPORT_BYTES.to_string())],
            ));
        }
        // A decoded line can take far more memory than its bytes.
        for (number, line) in (self.lines + 1..).zip(&request.lines) {
            check_line(line).map_err(|problem| refused(number, &problem))?;
            if number == 1 && !matches!(line.line, Some(Line::Header(_))) {
                return Err(refused(number, "the first line must be the header"));
            }
        }
        self.lines += request.lines.len();
        if self.lines > MAX_IMPORT_LINES {
            return Err(status(
                Code::ResourceExhausted,
                "RECORD_TOO_LARGE",
                format!("a record has at most {MAX_IMPORT_LINES} lines"),
                [("max_lines", &MAX_IMPORT_LINES.to_string())],
            ));
        }
        let places = memory_of(&request).div_ceil(1024);
        let held = memory.try_take_many(key, places);
        self.memory.push(held.ok_or_else(too_much_imported)?);
        self.parts.push(request.lines);
        Ok(())
    }

    fn put_together(self) -> (Vec<v1::RecordLine>, Vec<Permit>) {
        // At once: a list that grows takes up to three times the memory.
        let mut lines = Vec::with_capacity(self.lines);
        lines.extend(self.parts.into_iter().flatten());
        (lines, self.memory)
    }
}

/// Memory of a part of a record: what it was decoded to, at most, and its lines once more while they
/// are put together.
fn memory_of(part: &v1::ImportRecordRequest) -> usize {
    let cost = shapes::IMPORT_RECORD_REQUEST.cost(&part.encode_to_vec(), Cost::MAX);
    let decoded = cost.map_or(usize::MAX, |cost| cost.memory);
    decoded.saturating_add(part.lines.len() * size_of::<v1::RecordLine>())
}

fn too_much_imported() -> Status {
    let mib = MAX_IMPORT_MEMORY >> 20;
    status(
        Code::ResourceExhausted,
        "RECORD_TOO_LARGE",
        format!(
            "records that are being imported take at most {mib} MiB of memory together; import it alone, or shorter games"
        ),
        [("max_memory_bytes", &MAX_IMPORT_MEMORY.to_string())],
    )
}

/// Refuses a line that belongs to no record, before more lines are received.
fn check_line(line: &v1::RecordLine) -> Result<(), String> {
    let line = line.line.as_ref().ok_or("the line is empty")?;
    match excess(line) {
        None => Ok(()),
        Some(list) => Err(format!(
            "{} has more than {} entries",
            list.field, list.most
        )),
    }
}

fn refused(line: usize, problem: &str) -> Status {
    status(
        Code::InvalidArgument,
        "RECORD_REFUSED",
        format!("line {line} of the record: {problem}"),
        [("line", &line.to_string())],
    )
}

fn import_failed(error: chefshat_store::StoreError) -> Status {
    tracing::error!(%error, "importing a record failed");
    super::status::store_failed()
}

fn import_too_slow() -> Status {
    status(
        Code::DeadlineExceeded,
        "IMPORT_TOO_SLOW",
        format!(
            "the record did not arrive within {} s, or its next part not within {} s",
            IMPORT_TIMEOUT.as_secs(),
            IMPORT_IDLE_TIMEOUT.as_secs()
        ),
        [],
    )
}

/// Sends the lines of one record.
///
/// # Errors
/// The client has gone or is too slow.
async fn send<T>(
    sender: &Sender<T>,
    lines: Vec<v1::RecordLine>,
    response: impl Fn(Vec<v1::RecordLine>) -> T,
) -> Result<(), Status> {
    let mut lines = lines.into_iter().peekable();
    while lines.peek().is_some() {
        let part = next_part(&mut lines);
        send_part(sender, response(part)).await?;
    }
    Ok(())
}

async fn send_part<T>(sender: &Sender<T>, part: T) -> Result<(), Status> {
    follow::send_part(sender, part, "a record", RECORD_SEND_TIMEOUT).await
}

/// The next lines that fit one message.
fn next_part(lines: &mut Peekable<impl Iterator<Item = v1::RecordLine>>) -> Vec<v1::RecordLine> {
    let (mut part, mut bytes) = (Vec::new(), 0);
    while let Some(line) = lines.next_if(|line| {
        bytes += line.encoded_len();
        part.is_empty() || (part.len() < LINES_PER_MESSAGE && bytes <= BYTES_PER_MESSAGE)
    }) {
        part.push(line);
    }
    part
}

#[cfg(test)]
mod tests {
    use std::ops::RangeInclusive;

    use futures::{FutureExt as _, StreamExt as _};
    use tokio::sync::mpsc;
    use tokio_util::task::TaskTracker;

    use super::super::lookup::Lookup;
    use super::*;
    use chefshat_admission::access::Role;
    use chefshat_hosting::rooms::Rooms;
    use chefshat_room::ids::{RoomId, StudyId, Token, UnitToken};
    use chefshat_store::{MemoryStore, Store as _};

    fn header(game: u8) -> v1::RecordLine {
        v1::RecordLine {
            line: Some(Line::Header(Box::new(v1::RecordHeader {
                game_id: GameId::from_bytes([game; 16]).to_string(),
                ..v1::RecordHeader::default()
            }))),
        }
    }

    fn summary_of(game: u8) -> v1::RecordSummary {
        v1::RecordSummary {
            game_id: GameId::from_bytes([game; 16]).to_string(),
            state: v1::RoomState::Finished.into(),
            ..v1::RecordSummary::default()
        }
    }

    /// Small when encoded and large when decoded.
    fn large_decision() -> v1::RecordLine {
        let extra = (0..64).map(|number| (number.to_string(), String::new()));
        v1::RecordLine {
            line: Some(Line::Decision(v1::DecisionRecord {
                annotations: Some(v1::Annotations {
                    extra: extra.collect(),
                    ..v1::Annotations::default()
                }),
                ..v1::DecisionRecord::default()
            })),
        }
    }

    #[test]
    fn a_part_of_an_import_counts_as_much_as_it_decodes_to() {
        for lines in [vec![header(1)], vec![large_decision(); 1_000]] {
            let part = v1::ImportRecordRequest { lines };
            let bytes = part.encode_to_vec();
            let cost = shapes::IMPORT_RECORD_REQUEST.cost(&bytes, Cost::MAX);
            let decoded = cost.expect("a message").memory;
            assert!(
                memory_of(&part) >= decoded,
                "{} < {decoded}",
                memory_of(&part)
            );
        }
    }

    #[test]
    fn imports_take_a_bounded_memory_together() {
        let memory = FairSemaphore::new(MAX_IMPORT_MEMORY / 1024, Shares::ALL);
        let part = || v1::ImportRecordRequest {
            lines: vec![large_decision(); 100],
        };
        let mut imports = Vec::new();
        let refused = loop {
            let mut received = Received::default();
            let first = v1::ImportRecordRequest {
                lines: vec![header(1)],
            };
            let key = Key::Address([192, 0, 2, imports.len() as u8].into());
            received.add(first, &memory, key).expect("it is small");
            let added: Result<(), Status> =
                (0..10).try_for_each(|_| received.add(part(), &memory, key));
            imports.push(received);
            if let Err(refused) = added {
                break refused;
            }
            assert!(imports.len() < 200, "it is bounded");
        };
        let reason = has_reason(&refused, "RECORD_TOO_LARGE");
        assert!(reason && refused.message().contains("192 MiB"), "{refused}");
        let taken = memory.taken() * 1024;
        let most = MAX_IMPORT_MEMORY;
        assert!((most * 9 / 10..=most).contains(&taken), "{taken}");
        imports.truncate(1);
        let (lines, held) = imports.remove(0).put_together();
        assert_eq!(lines.len(), 1 + 10 * 100);
        drop(held);
        assert_eq!(memory.taken(), 0);
    }

    fn recorded(store: &Arc<MemoryStore>) -> (Recorded, Arc<Tournaments>) {
        let config = ServerConfig::default();
        let rooms = Rooms::new(&config, store.clone(), TaskTracker::new()).expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        let lookup = Lookup::new(rooms, Arc::clone(&tournaments));
        let recorded = Recorded::new(lookup, Role::Spectator).expect("threads");
        (recorded, tournaments)
    }

    #[tokio::test]
    async fn no_game_of_a_study_is_read_to_find_out_who_lists_it() {
        let (recorded, _) = recorded(&Arc::default());
        let (room, study) = (RoomId::from_bytes([1; 16]), StudyId::from_bytes([2; 16]));
        let token = UnitToken::random(study.unit());
        let owner = Token::of_tournament_room(room, &token.hash()).hash();
        let summary = v1::RecordSummary {
            room_id: room.to_string(),
            visibility: v1::Visibility::Private.into(),
            ..summary_of(3)
        };
        let of_study = v1::RecordSummary {
            study_id: study.to_string(),
            ..summary.clone()
        };
        let lists = |summary, secrets: &[UnitToken]| {
            let caller = (secrets.iter()).fold(Caller::default(), |caller, secret| {
                caller.showing(&secret.to_text())
            });
            (recorded.lookup()).lists_by_summary(&caller, summary, Some(&owner))
        };
        // Its owner sees it; a participant, who knows the ids of the room and the study, does not.
        assert_eq!(lists(&of_study, &[token]), Some(true));
        let participant = [study.unit(), room.unit()].map(Token::random);
        assert_eq!(lists(&of_study, &participant), Some(false));
        // Others are read if the caller may have a ticket.
        assert_eq!(lists(&summary, &[Token::random(room.unit())]), None);
        assert_eq!(lists(&summary, &[Token::random(study.unit())]), Some(false));
        assert_eq!(lists(&summary, &[]), Some(false));
    }

    fn records(store: &Arc<MemoryStore>) -> Records {
        let (recorded, tournaments) = recorded(store);
        let closing = CancellationToken::new();
        Records::new(recorded, tournaments, &ServerConfig::default(), closing)
    }

    fn operator() -> Caller {
        Caller {
            role: Role::Admin,
            ..Caller::default()
        }
    }

    async fn import(store: &MemoryStore, games: RangeInclusive<u8>) {
        for game in games {
            let lines = Arc::from([header(game)]);
            let imported = store.import(GameId::from_bytes([game; 16]), summary_of(game), lines);
            assert_eq!(imported.await, Ok(true));
        }
    }

    #[tokio::test]
    async fn a_stream_ends_with_its_client_and_when_the_server_closes_its_streams() {
        let store = Arc::new(MemoryStore::default());
        import(&store, 1..=1).await;
        let records = records(&store);
        // Its record waits for its turn.
        let _all = records
            .sending
            .take_many_anyway(Key::Local, MAX_RECORDS_SENT);
        let begin = async || {
            let mut request = Request::new(v1::StreamRecordsRequest::default());
            request.extensions_mut().insert(operator());
            let begun = records.stream_records(request).await;
            tokio::task::yield_now().await;
            begun.expect("allowed").into_inner()
        };
        let tasks = || {
            tokio::runtime::Handle::current()
                .metrics()
                .num_alive_tasks()
        };
        let before = tasks();
        let stream = begin().await;
        assert_eq!(tasks(), before + 1);
        drop(stream);
        tokio::task::yield_now().await;
        assert_eq!(tasks(), before, "nobody receives it");
        let mut stream = begin().await;
        records.closing.cancel();
        let ended = stream.next().await.expect("the reason");
        assert!(has_reason(&ended.expect_err("the end"), "SHUTTING_DOWN"));
    }

    #[tokio::test]
    async fn a_record_that_is_deleted_before_its_turn_ends_no_stream() {
        let store = Arc::new(MemoryStore::default());
        import(&store, 1..=3).await;
        let (records, caller) = (records(&store), operator());
        let (request, filter) = (
            v1::StreamRecordsRequest::default(),
            v1::RecordFilter::default(),
        );
        let (sender, mut receiver) = mpsc::channel(9);
        // The page has been read, and the first record waits for its turn.
        let all = records
            .sending
            .take_many_anyway(Key::Local, MAX_RECORDS_SENT);
        {
            let sending = records.send_all(&caller, &request, &filter, (Key::Local, None), &sender);
            tokio::pin!(sending);
            assert!(sending.as_mut().now_or_never().is_none());
            store
                .delete(vec![GameId::from_bytes([1; 16])])
                .await
                .expect("deleted");
            drop(all);
            sending.await.expect("the others follow");
        }
        drop(sender);
        let mut sent = Vec::new();
        while let Some(response) = receiver.recv().await {
            sent.extend(response.expect("a part").lines);
        }
        assert_eq!(sent, [header(2), header(3)]);
    }
}
