//! A stream that is opened again when it breaks: the time limit for opening it, the delays between
//! attempts, when to give up. The callers know what is sent and how their state resumes.

use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};
use tonic::{Response, Status, Streaming};

use crate::backoff::{Backoff, Outage};
use crate::error::{Error, PlayError, may_retry};

/// Time limit for the server to accept a stream.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);

/// How a stream broke.
#[derive(Debug)]
pub(crate) enum Broken {
    /// The next call opens it again, after a delay.
    Lost(Error),
    /// The server refused it; a retry would not help.
    Refused(Error),
    /// The connection was lost and could not be restored in time.
    GivenUp {
        /// Length of the outage.
        outage: Duration,
        /// Error of the last attempt.
        last: Error,
    },
}

impl Broken {
    /// The last error, unless the stream is opened again.
    pub(crate) fn or_again(self) -> Result<(), Error> {
        match self {
            Self::Lost(_) => Ok(()),
            Self::Refused(error) | Self::GivenUp { last: error, .. } => Err(error),
        }
    }

    /// The same for seats; `Ok` has the reason of an outage that is not over.
    pub(crate) fn of_seats(self) -> Result<Error, PlayError> {
        match self {
            Self::Lost(error) => Ok(error),
            Self::Refused(error) => Err(PlayError::Refused(error)),
            Self::GivenUp { outage, last } => Err(PlayError::ConnectionLost { outage, last }),
        }
    }
}

#[derive(Debug)]
enum State<T> {
    /// The stream is closed, and opened at this time at the earliest.
    Closed(Instant),
    /// The attempt runs in a task of its own: a cancelled call does not end it.
    Opening(JoinSet<Result<Streaming<T>, Status>>),
    Open {
        stream: Box<Streaming<T>>,
        since: Instant,
        /// Whether a state has come.
        has_state: bool,
    },
}

/// A stream across lost connections. Opened when its first message is requested.
#[derive(Debug)]
pub(crate) struct Reconnecting<T> {
    backoff: Backoff,
    outage: Outage,
    state: State<T>,
}

impl<T: Send + 'static> Reconnecting<T> {
    pub(crate) fn new(backoff: Backoff) -> Self {
        Self {
            backoff,
            outage: Outage::default(),
            state: State::Closed(Instant::now()),
        }
    }

    pub(crate) fn set_backoff(&mut self, backoff: Backoff) {
        self.backoff = backoff;
    }

    /// The next message; `None` if the server has ended the stream. Without a stream, `open` begins
    /// an attempt. Cancel safe: dropping the future loses no message and no attempt.
    pub(crate) async fn next<F>(&mut self, mut open: impl FnMut() -> F) -> Result<Option<T>, Broken>
    where
        F: Future<Output = Result<Response<Streaming<T>>, Status>> + Send + 'static,
    {
        loop {
            match &mut self.state {
                State::Closed(until) => {
                    sleep_until(*until).await;
                    let call = timeout(OPEN_TIMEOUT, open());
                    let mut opening = JoinSet::new();
                    opening.spawn(async move {
                        match call.await {
                            Ok(opened) => opened.map(Response::into_inner),
                            Err(_elapsed) => Err(Status::unavailable(
                                "the server did not accept the stream in time",
                            )),
                        }
                    });
                    self.state = State::Opening(opening);
                }
                State::Opening(opening) => {
                    let opened = opening.join_next().await.expect("the task of the attempt");
                    match opened.unwrap_or_else(|error| Err(Status::unknown(error.to_string()))) {
                        Ok(stream) => {
                            let (stream, since) = (Box::new(stream), Instant::now());
                            self.state = State::Open {
                                stream,
                                since,
                                has_state: false,
                            };
                        }
                        Err(status) => return Err(self.lost(status)),
                    }
                }
                State::Open { stream, .. } => {
                    let message = stream.message().await;
                    return message.map_err(|status| self.lost(status));
                }
            }
        }
    }

    /// The next state of something whose server ends no stream. `state`: that of a message; `None` is a
    /// heartbeat. Cancel safe, as [`next`](Self::next).
    pub(crate) async fn next_state<F, S>(
        &mut self,
        mut open: impl FnMut() -> F,
        state: impl Fn(T) -> Option<S>,
    ) -> Result<S, Error>
    where
        F: Future<Output = Result<Response<Streaming<T>>, Status>> + Send + 'static,
    {
        loop {
            match self.next(&mut open).await {
                Ok(Some(message)) => {
                    if let Some(state) = state(message) {
                        self.received_state();
                        return Ok(state);
                    }
                }
                Ok(None) => self.ended().or_again()?,
                Err(broken) => broken.or_again()?,
            }
        }
    }

    /// Ends the outage if this is not the first state of the stream: each stream begins with one.
    fn received_state(&mut self) {
        if let State::Open { has_state, .. } = &mut self.state
            && std::mem::replace(has_state, true)
        {
            self.outage.over();
        }
    }

    /// Ends the outage: there was progress.
    pub(crate) fn progress(&mut self) {
        self.outage.over();
    }

    /// The server has ended a stream that should go on.
    pub(crate) fn ended(&mut self) -> Broken {
        self.lost(Status::unavailable("the server ended the stream"))
    }

    fn lost(&mut self, status: Status) -> Broken {
        let now = Instant::now();
        if let State::Open { since, .. } = self.state
            && now.duration_since(since) >= self.backoff.max
        {
            self.outage.over();
        }
        self.state = State::Closed(now);
        let retry = may_retry(status.code());
        let error = Error::from(status);
        if !retry {
            return Broken::Refused(error);
        }
        match self.outage.failed(&self.backoff, now) {
            Ok(delay) => {
                let seconds = delay.as_secs_f32();
                tracing::warn!("connection lost, trying again in {seconds:.1} s: {error}");
                self.state = State::Closed(now + delay);
                Broken::Lost(error)
            }
            Err(outage) => Broken::GivenUp {
                outage,
                last: error,
            },
        }
    }

    /// Reads an open stream to its end.
    pub(crate) async fn drain(self) {
        if let State::Open { mut stream, .. } = self.state {
            while let Ok(Some(_)) = stream.message().await {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    /// Runs calls that are cancelled every 10 ms until one returns: the message of its error, and
    /// the time that has passed, in seconds.
    async fn broken<F>(stream: &mut Reconnecting<()>, open: impl Fn() -> F) -> (String, f32)
    where
        F: Future<Output = Result<Response<Streaming<()>>, Status>> + Send + 'static,
    {
        let began = Instant::now();
        loop {
            let call = timeout(Duration::from_millis(10), stream.next(&open));
            if let Ok(broken) = call.await {
                let error = match broken.expect_err("no stream") {
                    Broken::Lost(error) | Broken::Refused(error) => error,
                    Broken::GivenUp { last, .. } => last,
                };
                return (error.message().to_owned(), began.elapsed().as_secs_f32());
            }
        }
    }

    #[tokio::test(start_paused = true)]
    async fn cancelled_calls_end_no_attempt_and_no_delay() {
        let attempts = AtomicU32::new(0);
        let mut stream = Reconnecting::new(Backoff {
            first: Duration::from_secs(4),
            jitter: false,
            ..Backoff::default()
        });
        // A server that accepts connections but no stream.
        let silent = || {
            attempts.fetch_add(1, Ordering::Relaxed);
            std::future::pending()
        };
        let (message, seconds) = broken(&mut stream, silent).await;
        assert_eq!(message, "the server did not accept the stream in time");
        assert!((10.0..10.1).contains(&seconds), "{seconds} s");
        let refuses = || {
            attempts.fetch_add(1, Ordering::Relaxed);
            std::future::ready(Err(Status::not_found("no such room")))
        };
        let (message, seconds) = broken(&mut stream, refuses).await;
        assert_eq!(message, "no such room");
        assert!((4.0..4.1).contains(&seconds), "{seconds} s");
        assert_eq!(attempts.into_inner(), 2);
    }
}
