//! The writers of a node: each commits what waits for it in one transaction, so that many rooms
//! share a commit. A commit without an answer may have happened or not: the same work is then done
//! again on a new connection, until its outcome is certain. So work must be *idempotent*: what it
//! finds done by itself counts as done. Work that meets a lock of another session is set *aside*, where
//! one more writer tries it again: it delays little but itself.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgConnection};
use tokio::sync::{Mutex, mpsc, oneshot};
use tokio::time::{Instant, sleep, timeout};
use tokio_util::sync::CancellationToken;
use tracing::{error, warn};

use super::errors::{LOCKED, failure, is_locked, is_temporary};
use super::open::{connect_writer, set_lock_limit};
use crate::StoreError;
use chefshat_base::metrics::{StoreMetrics, Waits};
use chefshat_base::tasks::{LongTask, named};

/// Work that may wait for a writer.
const QUEUE: usize = 1_024;
/// How long a transaction may take; then the connection is dropped.
const COMMIT_LIMIT: Duration = Duration::from_secs(5);
/// How often a batch is sent before it is sent in halves.
const ATTEMPTS_TOGETHER: u32 = 2;
/// Pauses before a transaction is tried again.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// How long what was set aside waits for a lock. What is alone in its batch waits twice as long after
/// each lock that it meets, up to this number of times.
const ASIDE_LOCK_LIMIT: Duration = Duration::from_millis(50);
const LONGER_LOCK_LIMITS: u32 = 4;
/// How long work is tried again after the store was closed.
const CLOSING_LIMIT: Duration = Duration::from_secs(5);

/// The query for what an earlier attempt has committed. It must be a statement of its own: one that
/// waited for that commit does not see it. If it finds a row, it writes a message into the log of the
/// database, so that its own commit waits for synchronous standbys: what is found may not have
/// reached them yet.
macro_rules! confirming {
    ($found:literal) => {
        concat!(
            "WITH found AS MATERIALIZED (SELECT ",
            $found,
            ")
             SELECT * FROM found WHERE pg_logical_emit_message(true, 'chefshat', '') IS NOT NULL"
        )
    };
}

pub(super) use confirming;

/// Work of one kind.
pub(super) trait Work: Send + Sync + Sized + 'static {
    /// What its sender receives.
    type Answer: Send;
    /// Most pieces in one transaction.
    const MOST: usize;

    /// Does all of it in one transaction, or nothing. `again` says that it may have been done
    /// before.
    fn commit(
        connection: &mut PgConnection,
        work: &[Arc<Self>],
        again: bool,
    ) -> impl Future<Output = sqlx::Result<Answers<Self>>> + Send;
}

/// What became of each piece of work, in their order.
pub(super) type Answers<W> = Vec<Result<<W as Work>::Answer, StoreError>>;

struct Pending<W: Work> {
    work: Arc<W>,
    since: Instant,
    reply: oneshot::Sender<Result<W::Answer, StoreError>>,
}

/// Takes work to writers.
pub(super) struct Queue<W: Work>(mpsc::Sender<Pending<W>>);

impl<W: Work> Clone for Queue<W> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<W: Work> Queue<W> {
    /// Does work and waits until it is committed. The work is done even if the caller is cancelled.
    pub(super) async fn commit(&self, work: Arc<W>) -> Result<W::Answer, StoreError> {
        let closed = || StoreError::Failed("the database is closed".into());
        let (reply, committed) = oneshot::channel();
        let since = Instant::now();
        let pending = Pending { work, since, reply };
        self.0.send(pending).await.map_err(|_| closed())?;
        committed.await.map_err(|_| closed())?
    }

    /// Pieces of work in the queue.
    pub(super) fn depth(&self) -> usize {
        self.0.max_capacity() - self.0.capacity()
    }
}

/// What all writers share.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) options: PgConnectOptions,
    /// How long work with an unknown outcome is tried again.
    pub(super) retry_for: Duration,
    pub(super) metrics: StoreMetrics,
    pub(super) closing: CancellationToken,
}

/// Starts writers for one kind of work.
pub(super) fn start<W: Work>(
    shared: &Shared,
    writers: usize,
    tasks: &mut Vec<tokio::task::JoinHandle<()>>,
) -> Queue<W> {
    let (queue, waiting) = mpsc::channel(QUEUE);
    let waiting = Arc::new(Mutex::new(waiting));
    let (aside, set_aside) = mpsc::unbounded_channel();
    for _ in 0..writers {
        let writer = Writer::new(shared.clone(), Some(aside.clone()));
        let writing = writer.run(Arc::clone(&waiting));
        tasks.push(tokio::spawn(named(LongTask::PostgresWriter, writing)));
    }
    let writing = Writer::new(shared.clone(), None).run_aside(set_aside);
    tasks.push(tokio::spawn(named(LongTask::PostgresWriter, writing)));
    Queue(queue)
}

struct Writer<W: Work> {
    shared: Shared,
    connection: Option<PgConnection>,
    /// Where work that meets a lock is set aside; `None` if it is there already.
    aside: Option<mpsc::UnboundedSender<Batch<W>>>,
    /// How long to wait after the next failure.
    pause: Duration,
}

impl<W: Work> Writer<W> {
    fn new(shared: Shared, aside: Option<mpsc::UnboundedSender<Batch<W>>>) -> Self {
        Self {
            shared,
            connection: None,
            aside,
            pause: FIRST_PAUSE,
        }
    }

    /// Commits work until the store is closed or all senders are gone. While one writer commits,
    /// the next one takes what arrives.
    async fn run(mut self, waiting: Arc<Mutex<mpsc::Receiver<Pending<W>>>>) {
        let mut batch = Vec::new();
        loop {
            {
                let mut waiting = waiting.lock().await;
                let taking = waiting.recv_many(&mut batch, W::MOST);
                let taken = tokio::select! {
                    biased;
                    taken = taking => taken,
                    () = self.shared.closing.cancelled() => {
                        waiting.close();
                        waiting.recv_many(&mut batch, W::MOST).await
                    }
                };
                if taken == 0 {
                    break;
                }
            }
            let waits = self.shared.metrics.waits();
            let taken = Batch::new(std::mem::take(&mut batch), waits);
            let mut batches = VecDeque::from([taken]);
            self.pause = FIRST_PAUSE;
            while let Some(batch) = batches.pop_front() {
                self.commit(batch, &mut batches).await;
            }
        }
    }

    /// Commits what was set aside, in turn, until all other writers have ended.
    async fn run_aside(mut self, mut set_aside: mpsc::UnboundedReceiver<Batch<W>>) {
        let mut batches: VecDeque<Batch<W>> = VecDeque::new();
        // How many are to be tried before the next pause.
        let mut left = 0;
        loop {
            if batches.is_empty() {
                self.connection = None;
                let Some(batch) = set_aside.recv().await else {
                    return;
                };
                batches.push_back(batch);
                left = 1;
            }
            // Most of what comes is not locked.
            while let Ok(batch) = set_aside.try_recv() {
                batches.push_front(batch);
            }
            let limit = self.retry_limit();
            let late = StoreError::Failed(LOCKED.to_owned());
            batches.iter_mut().for_each(|it| it.fail_late(limit, &late));
            batches.retain(|batch| !batch.pieces.is_empty());
            if left == 0 {
                left = batches.len();
                sleep(FIRST_PAUSE).await;
            }
            if let Some(batch) = batches.pop_front() {
                left = left.saturating_sub(usize::from(batch.pieces.len() == 1));
                self.commit(batch, &mut batches).await;
            }
        }
    }

    /// How long work is tried again.
    fn retry_limit(&self) -> Duration {
        match self.shared.closing.is_cancelled() {
            true => CLOSING_LIMIT.min(self.shared.retry_for),
            false => self.shared.retry_for,
        }
    }

    /// Tries to commit work and answers its senders, or adds it to `batches` again. What gets no
    /// answer twice is sent in halves, so that one piece that cannot proceed does not hold up the
    /// others for long.
    async fn commit(&mut self, mut batch: Batch<W>, batches: &mut VecDeque<Batch<W>>) {
        let cause = match self.attempt(&mut batch).await {
            Ok(answers) => {
                if batch.again {
                    warn!("the database answers again");
                }
                let time = batch.began.elapsed();
                self.shared.metrics.committed(batch.pieces.len(), time);
                let lost = |answer: &&Result<_, _>| matches!(answer, Err(StoreError::Lost(_)));
                let lost = answers.iter().filter(lost).count();
                self.shared.metrics.lost(lost as u64);
                batch.answer(answers);
                self.pause = FIRST_PAUSE;
                return;
            }
            Err(cause) => cause,
        };
        let failed = failure(&cause);
        let half = batch.pieces.len().div_ceil(2);
        if is_locked(&cause) {
            match &self.aside {
                Some(aside) => {
                    warn!(error = %failed, "what meets a lock is set aside");
                    batch.waits.set_aside();
                    // Its receiver outlives all other writers.
                    let _ = aside.send(batch);
                }
                None if batch.pieces.len() == 1 => {
                    batch.locked += 1;
                    batches.push_back(batch);
                }
                None => batch.split(half).for_each(|it| batches.push_front(it)),
            }
            return;
        }
        if !is_temporary(&cause) {
            let pieces = batch.pieces.len();
            error!(error = %failed, pieces, "a commit was refused");
            // One piece must not make the others fail.
            match pieces {
                1 => batch.answer(vec![Err(failed)]),
                _ => batches.extend(batch.split(1)),
            }
            return;
        }
        self.shared.metrics.retried();
        if !batch.again {
            warn!(error = %failed, "a commit has no answer; it is tried again");
        }
        batch.again = true;
        batch.fail_late(self.retry_limit(), &failed);
        if batch.pieces.is_empty() {
            return;
        }
        match batch.unanswered {
            0..ATTEMPTS_TOGETHER => batches.push_back(batch),
            _ => batches.extend(batch.split(half)),
        }
        sleep(self.pause).await;
        self.pause = LONGEST_PAUSE.min(self.pause * 2);
    }

    /// Tries once. After an error other than a lock the connection is gone.
    async fn attempt(&mut self, batch: &mut Batch<W>) -> sqlx::Result<Answers<W>> {
        let work: Vec<_> = (batch.pieces.iter())
            .map(|piece| Arc::clone(&piece.work))
            .collect();
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => connect_writer(&self.shared.options).await?,
        };
        let limit = ASIDE_LOCK_LIMIT * 2_u32.pow(batch.locked.min(LONGER_LOCK_LIMITS));
        let is_aside = self.aside.is_none();
        let committing = async {
            if is_aside {
                set_lock_limit(&mut connection, limit).await?;
            }
            W::commit(&mut connection, &work, batch.again).await
        };
        let committed = timeout(COMMIT_LIMIT, committing).await;
        match committed.unwrap_or_else(|_| Err(io::Error::from(io::ErrorKind::TimedOut).into())) {
            Ok(answers) => {
                self.connection = Some(connection);
                Ok(answers)
            }
            Err(cause) if is_locked(&cause) => {
                self.connection = Some(connection);
                Err(cause)
            }
            Err(cause) => {
                batch.unanswered += 1;
                Err(cause)
            }
        }
    }
}

/// Work that is committed in one transaction.
struct Batch<W: Work> {
    pieces: Vec<Pending<W>>,
    /// Whether it may have been committed before.
    again: bool,
    /// How often it was sent to the database and not answered.
    unanswered: u32,
    /// How often it met a lock, as the only piece.
    locked: u32,
    /// When it was taken from the queue.
    began: Instant,
    /// Shared by all batches split from the same one, for the metric of waiting time.
    waits: Arc<Waits>,
}

impl<W: Work> Batch<W> {
    fn new(pieces: Vec<Pending<W>>, waits: Waits) -> Self {
        Self {
            pieces,
            again: false,
            unanswered: 0,
            locked: 0,
            began: Instant::now(),
            waits: Arc::new(waits),
        }
    }

    /// Answers the senders, which may be gone.
    fn answer(self, answers: Answers<W>) {
        for (piece, answer) in self.pieces.into_iter().zip(answers) {
            let _ = piece.reply.send(answer);
        }
    }

    /// Answers and removes what has waited for too long.
    fn fail_late(&mut self, limit: Duration, failed: &StoreError) {
        let is_late = |piece: &mut Pending<W>| piece.since.elapsed() >= limit;
        for piece in self.pieces.extract_if(.., is_late) {
            let _ = piece.reply.send(Err(failed.clone()));
        }
    }

    /// Batches of at most this size.
    fn split(self, size: usize) -> impl Iterator<Item = Self> {
        let (again, began) = (self.again, self.began);
        let (mut pieces, waits) = (self.pieces, self.waits);
        std::iter::from_fn(move || {
            let rest = pieces.split_off(size.min(pieces.len()));
            let first = std::mem::replace(&mut pieces, rest);
            (!first.is_empty()).then(|| Self {
                pieces: first,
                again,
                unanswered: 0,
                locked: 0,
                began,
                waits: Arc::clone(&waits),
            })
        })
    }
}
