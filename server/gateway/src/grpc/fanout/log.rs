//! One stream of another node and its readers. What they have not read is kept, and as far as there
//! is memory for it everything from the first message on, so that others can join. The stream is
//! received no faster than the furthest reader reads it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use bytes::Bytes;
use chefshat_proto::v1;
use http::{HeaderMap, StatusCode};
use http_body::Frame;
use http_body_util::BodyExt as _;
use tokio::sync::{Notify, watch};
use tokio::time::Instant;
use tonic::Status;
use tonic::body::Body;

use super::message::{Message, Messages};
use crate::grpc::status::{room_gone, spectator_too_slow};
use chefshat_admission::limits::{CallLimits, HISTORY_STEP, Key, Permit};
use chefshat_base::lock::Lock;
use chefshat_wire::convert;

/// Most bytes of a stream that are kept for those who read slowly or come later.
pub(super) const MAX_KEPT_BYTES: usize = 1024 * 1024;
/// Bytes of a stream that may always be kept.
const ALWAYS_KEPT: usize = HISTORY_STEP;
/// Bytes that the furthest reader has not read, from which on nothing more is received.
pub(super) const MAX_UNREAD: usize = 16 * 1024;
/// Bytes that each piece takes besides its content, about.
const PIECE_BYTES: usize = 128;

/// A stream that readers share.
#[derive(Debug)]
pub(super) struct SharedStream {
    limits: Arc<CallLimits>,
    /// Who is charged for what is kept.
    key: Key,
    log: Lock<Log>,
    /// Notified of what the readers wait for.
    grown: Notify,
    /// Notified of what the receiver waits for.
    read: Notify,
    /// How many read it besides one.
    others: watch::Sender<u32>,
}

/// A stream so far.
#[derive(Debug, Default)]
struct Log {
    /// `None` until the other node has answered.
    head: Option<(StatusCode, HeaderMap)>,
    /// The number of the first piece that is kept.
    first: usize,
    pieces: VecDeque<Piece>,
    /// Bytes of the pieces.
    kept: usize,
    /// The memory for them.
    memory: Vec<Permit>,
    /// The number of the last piece that says whom the game waits for.
    awaited: Option<usize>,
    /// The number of the next piece of each reader.
    readers: BTreeMap<u64, usize>,
    next_reader: u64,
    /// The number of the next piece of the furthest reader.
    furthest: usize,
    /// Bytes that it has not read.
    unread: usize,
    end: Option<End>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The other node has ended the stream.
    Over,
    /// It broke, was refused, or nobody reads it.
    Broken,
}

#[derive(Debug, Clone)]
struct Piece {
    content: Content,
    received: Instant,
}

#[derive(Debug, Clone)]
enum Content {
    Message(Message),
    Trailers(HeaderMap),
}

impl Piece {
    fn size(&self) -> usize {
        let content = match &self.content {
            Content::Message(message) => message.size(),
            Content::Trailers(_) => 0,
        };
        PIECE_BYTES + content
    }
}

impl Log {
    /// The number of the next piece that is added.
    fn next(&self) -> usize {
        self.first + self.pieces.len()
    }

    fn add(&mut self, content: Content, memory: impl Fn() -> Option<Permit>) {
        if let Content::Message(message) = &content
            && message.has_awaited()
        {
            self.awaited = Some(self.next());
        }
        let piece = Piece {
            content,
            received: Instant::now(),
        };
        self.kept += piece.size();
        self.unread += piece.size();
        self.pieces.push_back(piece);
        while self.kept > ALWAYS_KEPT + self.memory.len() * HISTORY_STEP {
            let more = (self.kept <= MAX_KEPT_BYTES).then(&memory).flatten();
            match more {
                Some(more) => self.memory.push(more),
                // The furthest reader is never cut off.
                None if self.first < self.furthest => self.drop_first(),
                None => break,
            }
        }
        if self.first > 0 {
            // Nobody can join any more.
            let first = self.first;
            let kept_up = self.readers.values().filter(|next| **next >= first);
            let slowest = kept_up.min().copied();
            while slowest.is_some_and(|slowest| self.first < slowest) {
                self.drop_first();
            }
            let needed = self.kept.saturating_sub(ALWAYS_KEPT);
            self.memory.truncate(needed.div_ceil(HISTORY_STEP));
        }
    }

    fn drop_first(&mut self) {
        if let Some(dropped) = self.pieces.pop_front() {
            self.first += 1;
            self.kept -= dropped.size();
        }
    }

    /// The piece with this number; `Err` if it is not kept any more.
    fn get(&self, number: usize) -> Result<Option<&Piece>, NotKept> {
        let index = number.checked_sub(self.first).ok_or(NotKept)?;
        Ok(self.pieces.get(index))
    }

    /// Notes that a reader has read everything before a piece. Returns whether more can be received.
    fn has_read(&mut self, reader: u64, next: usize) -> bool {
        self.readers.insert(reader, next);
        if next <= self.furthest {
            return false;
        }
        self.find_furthest();
        self.unread < MAX_UNREAD
    }

    fn find_furthest(&mut self) {
        self.furthest = self.readers.values().max().copied().unwrap_or_default();
        let read = self.furthest.saturating_sub(self.first);
        self.unread = self.pieces.iter().skip(read).map(Piece::size).sum();
    }
}

/// A piece that somebody has not read in time.
struct NotKept;

impl SharedStream {
    /// A stream that is about to be opened. `key` is charged for what is kept.
    pub(super) fn new(limits: Arc<CallLimits>, key: Key) -> Arc<Self> {
        Arc::new(Self {
            limits,
            key,
            log: Lock::default(),
            grown: Notify::new(),
            read: Notify::new(),
            others: watch::Sender::default(),
        })
    }

    /// How many read it besides one, now and whenever that changes.
    pub(super) fn others(&self) -> watch::Receiver<u32> {
        self.others.subscribe()
    }

    fn count(&self, log: &Log) {
        let others = convert::number(log.readers.len().saturating_sub(1));
        (self.others).send_if_modified(|known| std::mem::replace(known, others) != others);
    }

    /// A reader of everything from the first message on, if all of it is kept.
    pub(super) fn reader(self: &Arc<Self>) -> Option<Reader> {
        let mut log = self.log.lock();
        if log.first > 0 || log.end == Some(End::Broken) {
            return None;
        }
        let number = log.next_reader;
        log.next_reader += 1;
        log.readers.insert(number, 0);
        self.count(&log);
        drop(log);
        Some(Reader {
            stream: Arc::clone(self),
            number,
            next: 0,
            room: None,
            place: None,
        })
    }

    /// Sets the answer of the other node.
    pub(super) fn answered(&self, status: StatusCode, headers: HeaderMap) {
        self.log.lock().head = Some((status, headers));
        self.grown.notify_waiters();
    }

    /// Ends the stream for those who wait for its answer, if there is none.
    pub(super) fn end_unanswered(&self) {
        if self.log.lock().head.is_none() {
            self.end(End::Broken);
        }
    }

    fn end(&self, end: End) {
        self.log.lock().end.get_or_insert(end);
        self.grown.notify_waiters();
    }

    fn add(&self, content: Content) {
        let memory = || self.limits.keep_history(self.key);
        self.log.lock().add(content, memory);
        self.grown.notify_waiters();
    }

    /// Receives the stream while somebody reads it.
    pub(super) async fn receive(&self, mut body: Body) {
        let mut messages = Messages::default();
        loop {
            let may_receive = {
                let mut log = self.log.lock();
                if log.readers.is_empty() {
                    log.end = Some(End::Broken);
                    return;
                }
                log.unread < MAX_UNREAD
            };
            let frame = tokio::select! {
                () = self.read.notified() => continue,
                frame = body.frame(), if may_receive => frame,
            };
            match frame.map(|frame| frame.map(Frame::into_data)) {
                Some(Ok(Ok(data))) => messages.add(&data),
                Some(Ok(Err(frame))) => {
                    let trailers = frame.into_trailers().unwrap_or_default();
                    self.add(Content::Trailers(trailers));
                }
                Some(Err(_)) => return self.end(End::Broken),
                None => return self.end(End::Over),
            }
            loop {
                match messages.next() {
                    Ok(Some(message)) => self.add(Content::Message(message)),
                    Ok(None) => break,
                    Err(_) => return self.end(End::Broken),
                }
            }
        }
    }
}

/// Reads a stream for one spectator.
#[derive(Debug)]
pub(super) struct Reader {
    stream: Arc<SharedStream>,
    number: u64,
    /// The number of the next piece.
    next: usize,
    /// The room as it was when the spectator joined.
    room: Option<v1::Room>,
    /// Its place among the streams of its caller.
    place: Option<Permit>,
}

/// What a reader comes to.
enum Read {
    Frame(Frame<Bytes>),
    /// Nothing that is still of interest.
    Nothing,
    Awaited,
    End(Option<Status>),
}

impl Reader {
    /// Makes it the reader of one who joins others, with the room as it is now.
    pub(super) fn joining(mut self, room: v1::Room, place: Permit) -> Self {
        (self.room, self.place) = (Some(room), Some(place));
        self
    }

    /// The answer of the other node; `None` if it has refused the stream.
    pub(super) async fn head(&self) -> Option<(StatusCode, HeaderMap)> {
        loop {
            let grown = self.stream.grown.notified();
            tokio::pin!(grown);
            grown.as_mut().enable();
            {
                let log = self.stream.log.lock();
                if log.head.is_some() || log.end.is_some() {
                    return log.head.clone();
                }
            }
            grown.await;
        }
    }

    /// The next frame; `None` at the end.
    pub(super) async fn frame(&mut self) -> Option<Result<Frame<Bytes>, Status>> {
        let stream = Arc::clone(&self.stream);
        loop {
            let grown = stream.grown.notified();
            tokio::pin!(grown);
            grown.as_mut().enable();
            match self.read() {
                Read::Frame(frame) => return Some(Ok(frame)),
                Read::Nothing => {}
                Read::End(end) => return end.map(Err),
                Read::Awaited => grown.await,
            }
        }
    }

    fn read(&mut self) -> Read {
        let mut log = self.stream.log.lock();
        let piece = match log.get(self.next) {
            Err(NotKept) => return Read::End(Some(spectator_too_slow())),
            Ok(None) => match log.end {
                None => return Read::Awaited,
                Some(End::Over) => return Read::End(None),
                Some(End::Broken) => return Read::End(Some(room_gone())),
            },
            Ok(Some(piece)) => piece.clone(),
        };
        let awaits = log.awaited == Some(self.next);
        self.next += 1;
        if log.has_read(self.number, self.next) {
            self.stream.read.notify_one();
        }
        drop(log);
        let frame = match piece.content {
            Content::Trailers(trailers) => Some(Frame::trailers(trailers)),
            Content::Message(message) => {
                let age = piece.received.elapsed();
                let bytes = message.after(age, self.room.as_ref(), awaits);
                bytes.map(Frame::data)
            }
        };
        frame.map_or(Read::Nothing, Read::Frame)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        let mut log = self.stream.log.lock();
        log.readers.remove(&self.number);
        log.find_furthest();
        self.stream.count(&log);
        drop(log);
        self.stream.read.notify_one();
    }
}
