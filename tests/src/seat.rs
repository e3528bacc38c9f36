//! A seat on a Play stream that a test controls step by step.

use std::collections::VecDeque;

use chefshat_client::Connection;
use chefshat_proto::v1::{
    self, play_service_client::PlayServiceClient, seat_command::Command, seat_update::Update,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::TestServer;

/// A Play stream with one seat attached, or more if the test attaches more.
#[derive(Debug)]
pub struct StreamSeat {
    requests: Option<mpsc::Sender<v1::PlayRequest>>,
    responses: Streaming<v1::PlayResponse>,
    waiting: VecDeque<v1::SeatUpdate>,
    /// Number of the last event received.
    pub last_event: u64,
    /// All events received, in order.
    pub events: Vec<v1::GameEvent>,
    /// Whom the game waited for, in order. Only with events at once.
    pub awaited: Vec<v1::Awaited>,
}

impl StreamSeat {
    /// A stream without attached seats.
    pub async fn open(channel: Connection) -> Self {
        let (requests, receiver) = mpsc::channel(64);
        let responses = PlayServiceClient::new(channel)
            .play(ReceiverStream::new(receiver))
            .await
            .expect("a stream")
            .into_inner();
        Self {
            requests: Some(requests),
            responses,
            waiting: VecDeque::new(),
            last_event: 0,
            events: Vec::new(),
            awaited: Vec::new(),
        }
    }

    /// A stream with a seat attached from its first event on.
    pub async fn attached(channel: Connection, ticket: &str) -> Self {
        Self::attached_from(channel, ticket, 0).await
    }

    /// A stream with a seat attached from this event on.
    pub async fn attached_from(channel: Connection, ticket: &str, from_sequence: u64) -> Self {
        let mut seat = Self::open(channel).await;
        seat.last_event = from_sequence.saturating_sub(1);
        seat.attach(v1::Attach {
            ticket: ticket.to_owned(),
            from_sequence,
            ..v1::Attach::default()
        })
        .await;
        match seat.next().await {
            Update::Attached(_) => seat,
            other => panic!("not attached, but {other:?}"),
        }
    }

    /// Sends a command for the first seat of the stream.
    pub async fn send(&self, command: Command) {
        self.send_to(0, command).await;
    }

    /// Sends a command for a handle.
    pub async fn send_to(&self, handle: u32, command: Command) {
        let request = v1::PlayRequest {
            commands: vec![v1::SeatCommand {
                handle,
                command: Some(command),
            }],
        };
        self.requests
            .as_ref()
            .expect("the stream is not half-closed")
            .send(request)
            .await
            .expect("the stream is open");
    }

    /// Attaches a seat.
    pub async fn attach(&self, attach: v1::Attach) {
        self.send(Command::Attach(attach)).await;
    }

    /// Answers a decision.
    pub async fn answer(&self, decision_id: u64, action: u32) {
        self.send(Command::Answer(v1::Answer {
            decision_id,
            action,
            annotations: None,
        }))
        .await;
    }

    /// Leaves the stream by half-closing it.
    pub fn half_close(&mut self) {
        self.requests = None;
    }

    /// The next update that is neither a batch of events nor about who is awaited; those are stored in
    /// `events` and `awaited`. Panics if the
    /// stream ends.
    pub async fn next(&mut self) -> Update {
        self.next_or_end()
            .await
            .expect("no error")
            .expect("the stream continues")
    }

    /// Like `next`, but returns `None` when the stream ends.
    ///
    /// # Errors
    /// The stream ends with this status.
    pub async fn next_or_end(&mut self) -> Result<Option<Update>, Status> {
        loop {
            while let Some(update) = self.waiting.pop_front() {
                match update.update.expect("an update") {
                    Update::Events(batch) => {
                        for event in batch.events {
                            assert_eq!(
                                event.sequence,
                                self.last_event + 1,
                                "no gap and no repetition"
                            );
                            self.last_event = event.sequence;
                            self.events.push(event);
                        }
                    }
                    Update::Awaited(awaited) => self.awaited.push(awaited),
                    other => return Ok(Some(other)),
                }
            }
            match crate::patiently("the next message", self.responses.message()).await? {
                Some(response) => self.waiting.extend(response.updates),
                None => return Ok(None),
            }
        }
    }

    /// The next decision request; results of answers are skipped.
    pub async fn decision(&mut self) -> v1::DecisionRequest {
        loop {
            match self.next().await {
                Update::Decision(decision) => return decision,
                Update::Result(_) => {}
                other => panic!("no decision, but {other:?}"),
            }
        }
    }

    /// The next result of an answer.
    pub async fn result(&mut self) -> v1::AnswerResult {
        match self.next().await {
            Update::Result(result) => result,
            other => panic!("no result, but {other:?}"),
        }
    }
}

/// Index of the first legal action.
pub fn first_legal(decision: &v1::DecisionRequest) -> u32 {
    (0..8 * u32::try_from(decision.action_mask.len()).expect("a short mask"))
        .find(|action| is_legal(decision, *action))
        .expect("a decision has a legal action")
}

/// Whether an action is legal.
pub fn is_legal(decision: &v1::DecisionRequest, action: u32) -> bool {
    let byte = usize::try_from(action / 8).expect("an index");
    decision
        .action_mask
        .get(byte)
        .is_some_and(|bits| bits & (1 << (action % 8)) != 0)
}

/// Answers every decision with the first legal action until the seat is detached; returns the
/// reason.
pub async fn play_on(seat: &mut StreamSeat) -> v1::DetachReason {
    loop {
        match seat.next().await {
            Update::Decision(decision) => {
                let action = first_legal(&decision);
                seat.answer(decision.decision_id, action).await;
            }
            Update::Detached(detached) => return detached.reason(),
            Update::Result(_) => {}
            other => panic!("unexpected {other:?}"),
        }
    }
}

/// The first update that any of the seats receives, and that seat's index.
pub async fn first_update(seats: &mut [StreamSeat]) -> (Update, usize) {
    let listening = seats.iter_mut().map(|seat| Box::pin(seat.next()));
    let (update, index, _) = futures::future::select_all(listening).await;
    (update, index)
}

/// Opens a stream for each ticket, attached from its seat's first event on.
pub async fn attach_all(server: &TestServer, tickets: &[String]) -> Vec<StreamSeat> {
    let mut seats = Vec::new();
    for ticket in tickets {
        seats.push(StreamSeat::attached(server.channel().await, ticket).await);
    }
    seats
}
