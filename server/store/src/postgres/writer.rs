//! The writers of a node: each commits what waits for it in one transaction, so that many rooms
//! share a commit. A commit without an answer may have happened or not: the same work is then done
//! again on a new connection, until its outcome is certain. So work must be *idempotent*: what it
//! finds done by itself counts as done.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use futures::future::BoxFuture;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use tokio::sync::{Mutex, mpsc, oneshot};
use tokio::time::{Instant, sleep, timeout};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::errors::{failure, is_temporary};
use super::open::connect_writer;
use crate::StoreError;
use chefshat_base::metrics::StoreMetrics;
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
    fn commit<'a>(
        connection: &'a mut PgConnection,
        work: &'a [Arc<Self>],
        again: bool,
    ) -> BoxFuture<'a, sqlx::Result<Answers<Self>>>;
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
    for _ in 0..writers {
        let writer = Writer {
            shared: shared.clone(),
            connection: None,
        };
        tasks.push(tokio::spawn(named(
            LongTask::PostgresWriter,
            writer.run(Arc::clone(&waiting)),
        )));
    }
    Queue(queue)
}

struct Writer {
    shared: Shared,
    connection: Option<PgConnection>,
}

impl Writer {
    /// Commits work until the store is closed or all senders are gone. While one writer commits,
    /// the next one takes what arrives.
    async fn run<W: Work>(mut self, waiting: Arc<Mutex<mpsc::Receiver<Pending<W>>>>) {
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
            let began = Instant::now();
            let pieces = batch.len();
            let waits = self.shared.metrics.waits();
            self.commit(std::mem::take(&mut batch)).await;
            drop(waits);
            self.shared.metrics.committed(pieces, began.elapsed());
        }
    }

    /// Commits work and answers its senders. What gets no answer twice is sent in halves, so that
    /// one piece that cannot proceed does not hold up the others for long.
    async fn commit<W: Work>(&mut self, pieces: Vec<Pending<W>>) {
        let mut pause = FIRST_PAUSE;
        let mut batches = VecDeque::from([Batch::new(pieces, false)]);
        while let Some(mut batch) = batches.pop_front() {
            let cause = match self.attempt(&mut batch).await {
                Ok(answers) => {
                    if batch.again {
                        info!("the database answers again");
                    }
                    batch.answer(answers);
                    pause = FIRST_PAUSE;
                    continue;
                }
                Err(cause) => cause,
            };
            let failed = failure(&cause);
            if !is_temporary(&cause) {
                let pieces = batch.pieces.len();
                error!(error = %failed, pieces, "a commit was refused");
                // One piece must not make the others fail.
                match pieces {
                    1 => batch.answer(vec![Err(failed)]),
                    _ => batches.extend(batch.split(1)),
                }
                continue;
            }
            self.shared.metrics.retried();
            if !batch.again {
                warn!(error = %failed, "a commit has no answer; it is tried again");
            }
            batch.again = true;
            let limit = match self.shared.closing.is_cancelled() {
                true => CLOSING_LIMIT.min(self.shared.retry_for),
                false => self.shared.retry_for,
            };
            batch.fail_late(limit, &failed);
            if batch.pieces.is_empty() {
                continue;
            }
            let half = batch.pieces.len().div_ceil(2);
            match batch.unanswered {
                0..ATTEMPTS_TOGETHER => batches.push_back(batch),
                _ => batches.extend(batch.split(half)),
            }
            sleep(pause).await;
            pause = LONGEST_PAUSE.min(pause * 2);
        }
    }

    /// Tries once. After an error the connection is gone.
    async fn attempt<W: Work>(&mut self, batch: &mut Batch<W>) -> sqlx::Result<Answers<W>> {
        let work: Vec<_> = (batch.pieces.iter())
            .map(|piece| Arc::clone(&piece.work))
            .collect();
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => connect_writer(&self.shared.options).await?,
        };
        let committing = W::commit(&mut connection, &work, batch.again);
        let committed = timeout(COMMIT_LIMIT, committing).await;
        match committed.unwrap_or_else(|_| Err(io::Error::from(io::ErrorKind::TimedOut).into())) {
            Ok(answers) => {
                self.connection = Some(connection);
                Ok(answers)
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
}

impl<W: Work> Batch<W> {
    fn new(pieces: Vec<Pending<W>>, again: bool) -> Self {
        Self {
            pieces,
            again,
            unanswered: 0,
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
        let (mut pieces, again) = (self.pieces, self.again);
        std::iter::from_fn(move || {
            let rest = pieces.split_off(size.min(pieces.len()));
            let first = std::mem::replace(&mut pieces, rest);
            (!first.is_empty()).then(|| Self::new(first, again))
        })
    }
}
