//! The connection of a person's seat: opened, opened again when it breaks, given up in the end. An agent of the SDK decides on the task that
//! serves its connection, which suits programs; a person thinks for long and meanwhile wants to see what happens, so that here messages and
//! answers each go their way. What the messages mean is in `app`.

use std::time::Duration;

use chefshat_client::v1::{
    self, play_service_client::PlayServiceClient, seat_command::Command, seat_update::Update,
};
use chefshat_client::{Client, FIRST_DELAY, GIVE_UP_AFTER, MAX_DELAY};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status};

use super::app::Input;

/// Commands that may wait for the transport.
const COMMANDS: usize = 16;
/// The largest message that is taken: a game's whole history.
const MAX_RESPONSE_BYTES: usize = 16 << 20;
/// Time for the server to accept a stream, and to end one in good order.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);
/// Number of the one attachment of a stream.
const ATTACHMENT: u32 = 1;

/// How a stream ended.
enum Stopped {
    /// The person has left.
    Left,
    /// The game is over, or the seat is another's; why, if the game has not ended.
    Over(Option<String>),
    /// It broke; whether the seat had been at the table through it, and for long.
    Broken { status: Status, held: bool },
}

/// A stream that broke; since when the seat had been at the table through it.
fn broken(attached: Option<Instant>, status: Status) -> Stopped {
    Stopped::Broken {
        status,
        held: attached.is_some_and(|since| since.elapsed() >= MAX_DELAY),
    }
}

/// A seat's connection.
pub(super) struct Seat {
    pub(super) client: Client,
    pub(super) ticket: String,
    /// The seat's part of the game seed.
    pub(super) entropy: Vec<u8>,
    /// Number of the first event not yet seen.
    next_event: u64,
    ended: bool,
}

impl Seat {
    pub(super) fn new(client: Client, ticket: String, entropy: Vec<u8>) -> Self {
        Self {
            client,
            ticket,
            entropy,
            next_event: 1,
            ended: false,
        }
    }

    /// Serves the connection until the seat has nothing more to hear or `commands` is closed.
    pub(super) async fn serve(
        mut self,
        mut commands: mpsc::Receiver<Command>,
        inputs: mpsc::Sender<Input>,
    ) {
        let mut outage: Option<Instant> = None;
        let mut delay = FIRST_DELAY;
        loop {
            let seen = self.next_event;
            let why = match self.converse(&mut commands, &inputs).await {
                Stopped::Left => return,
                Stopped::Over(why) => Some(why),
                Stopped::Broken { .. } if self.ended => Some(None),
                Stopped::Broken { status, .. } if !may_retry(status.code()) => {
                    Some(Some(status.message().to_owned()))
                }
                Stopped::Broken { status, held } => {
                    // A long wait for others brings no events, and is no outage either.
                    if held || self.next_event > seen {
                        (outage, delay) = (None, FIRST_DELAY);
                    }
                    let since = *outage.get_or_insert_with(Instant::now);
                    let words = status.message().to_owned();
                    if since.elapsed() > GIVE_UP_AFTER {
                        Some(Some(format!("the server did not come back: {words}")))
                    } else if inputs.send(Input::Lost(words)).await.is_err() {
                        return;
                    } else {
                        None
                    }
                }
            };
            if let Some(why) = why {
                // Whoever does not listen any more need not know.
                let _ = inputs.send(Input::Over(why)).await;
                return;
            }
            tokio::select! {
                () = sleep(delay) => {}
                () = closed(&mut commands) => return,
            }
            delay = (delay * 2).min(MAX_DELAY);
        }
    }

    /// One stream, until it ends.
    async fn converse(
        &mut self,
        commands: &mut mpsc::Receiver<Command>,
        inputs: &mpsc::Sender<Input>,
    ) -> Stopped {
        let (requests, queue) = mpsc::channel(COMMANDS);
        let attach = Command::Attach(v1::Attach {
            ticket: self.ticket.clone(),
            request_id: ATTACHMENT,
            from_sequence: self.next_event,
            delivery: v1::EventDelivery::AtOnce.into(),
            entropy: self.entropy.clone(),
            ..v1::Attach::default()
        });
        requests
            .try_send(request(attach))
            .expect("an empty queue has room");
        let mut service = PlayServiceClient::new(self.client.channel())
            .max_decoding_message_size(MAX_RESPONSE_BYTES);
        let opening = timeout(OPEN_TIMEOUT, service.play(ReceiverStream::new(queue)));
        let mut responses = match opening.await {
            Ok(Ok(opened)) => opened.into_inner(),
            Ok(Err(status)) => return broken(None, status),
            Err(_) => return broken(None, Status::unavailable("no answer in time")),
        };
        let mut attached: Option<Instant> = None;
        loop {
            tokio::select! {
                response = responses.message() => match response {
                    Ok(Some(response)) => {
                        for update in response.updates {
                            if matches!(update.update, Some(Update::Attached(_))) {
                                attached.get_or_insert_with(Instant::now);
                            }
                            if let Some(over) = self.hear(update, inputs).await {
                                return over;
                            }
                        }
                    }
                    Ok(None) => return broken(attached, Status::unavailable("the server ended the stream")),
                    Err(status) => return broken(attached, status),
                },
                command = commands.recv() => {
                    let Some(command) = command else {
                        // Half-closing leaves; what the server still says does not matter.
                        drop(requests);
                        let end = async { while let Ok(Some(_)) = responses.message().await {} };
                        let _ = timeout(LEAVE_TIMEOUT, end).await;
                        return Stopped::Left;
                    };
                    // A transport that takes no more says why where it is read.
                    let _ = requests.send(request(command)).await;
                }
            }
        }
    }

    /// Passes on one update; says when it was the last.
    async fn hear(
        &mut self,
        update: v1::SeatUpdate,
        inputs: &mpsc::Sender<Input>,
    ) -> Option<Stopped> {
        let mut update = update.update?;
        match &mut update {
            Update::Events(batch) => {
                let next = self.next_event;
                batch.events.retain(|event| event.sequence >= next);
                if let Some(last) = batch.events.last() {
                    self.next_event = last.sequence.saturating_add(1);
                }
                self.ended |= batch.events.iter().any(|event| {
                    use v1::game_event::Kind::{GameAborted, GameEnded};
                    matches!(event.kind, Some(GameEnded(_) | GameAborted(_)))
                });
            }
            Update::Detached(detached) => {
                let why = match detached.reason() {
                    _ if self.ended => None,
                    v1::DetachReason::Superseded => {
                        Some("another connection has taken this seat".to_owned())
                    }
                    _ => Some("the server has ended the seat's connection".to_owned()),
                };
                return Some(Stopped::Over(why));
            }
            Update::Refused(refused) if refused.request_id == ATTACHMENT => {
                return Some(Stopped::Over(Some(refused.message.clone())));
            }
            _ => {}
        }
        match inputs.send(Input::Update(Box::new(update))).await {
            Ok(()) => None,
            Err(_) => Some(Stopped::Left),
        }
    }
}

/// Waits until nobody can send commands any more. Those that come while there is no connection are dropped: the server puts the decision anew.
async fn closed(commands: &mut mpsc::Receiver<Command>) {
    while commands.recv().await.is_some() {}
}

fn request(command: Command) -> v1::PlayRequest {
    v1::PlayRequest {
        // The one seat of the stream is its first.
        commands: vec![v1::SeatCommand {
            handle: 0,
            command: Some(command),
        }],
    }
}

/// Whether the same may succeed later.
fn may_retry(code: Code) -> bool {
    matches!(
        code,
        Code::Unavailable
            | Code::Unknown
            | Code::Internal
            | Code::Cancelled
            | Code::Aborted
            | Code::DeadlineExceeded
            | Code::ResourceExhausted
    )
}
