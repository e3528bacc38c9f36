//! The bare room: the cost of tonic, one task per room and a mailbox, without a game. Streams,
//! tasks and batching are those of the game server; messages contain meaningless bytes.

use std::collections::HashMap;
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};

use futures::Stream;
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use crate::options::SEATS;
use proto::bare_service_server::{BareService, BareServiceServer};
use proto::{Batch, Item};

/// Generated from `proto/bare.proto`.
#[allow(unreachable_pub, missing_docs, clippy::all, reason = "generated code")]
pub(crate) mod proto {
    include!("../generated/chefshat.bare.rs");
}

/// Capacity of a room's mailbox, as in the game server.
const MAILBOX: usize = chefshat_server::config::ROOM_MAILBOX;
/// Capacity of a stream's outbox, as in the game server.
const OUTBOX: usize = chefshat_server::outbox::OUTBOX_CAPACITY;
/// Maximum items per message, as in the game server.
const BATCH: usize = chefshat_server::outbox::MESSAGE_CAPACITY;

/// Serves bare rooms until `shutdown` is ready.
pub(crate) async fn serve(
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) -> Result<(), tonic::transport::Error> {
    tonic::transport::Server::builder()
        .tcp_nodelay(true)
        .max_concurrent_streams(Some(chefshat_server::config::MAX_STREAMS_PER_CONNECTION))
        .add_service(BareServiceServer::new(Bare::default()))
        .serve_with_incoming_shutdown(
            TcpIncoming::from(listener).with_nodelay(Some(true)),
            shutdown,
        )
        .await
}

#[derive(Debug, Default)]
struct Bare {
    rooms: Arc<Rooms>,
}

#[derive(Debug, Default)]
struct Rooms(Mutex<HashMap<u32, mpsc::Sender<ToRoom>>>);

impl Rooms {
    /// The mailbox of the room of a seat.
    fn of_seat(&self, seat: u32) -> mpsc::Sender<ToRoom> {
        let number = seat / SEATS as u32;
        let mut rooms = self
            .0
            .lock()
            .expect("nothing that holds this lock can panic");
        rooms
            .entry(number)
            .or_insert_with(|| {
                let (mailbox, inbox) = mpsc::channel(MAILBOX);
                tokio::spawn(room(inbox));
                mailbox
            })
            .clone()
    }
}

#[derive(Debug)]
enum ToRoom {
    Attach {
        seat: u32,
        outbox: mpsc::Sender<Item>,
        observation_bytes: u32,
    },
    Answer {
        seat: u32,
        body: Vec<u8>,
    },
    Leave {
        seat: u32,
    },
}

impl BareService for Bare {
    type ExchangeStream = Pin<Box<dyn Stream<Item = Result<Batch, Status>> + Send>>;

    async fn exchange(
        &self,
        request: Request<Streaming<Batch>>,
    ) -> Result<Response<Self::ExchangeStream>, Status> {
        let (outbox, mut waiting) = mpsc::channel(OUTBOX);
        tokio::spawn(read(Arc::clone(&self.rooms), request.into_inner(), outbox));
        let batches = futures::stream::poll_fn(move |context| {
            let mut items = Vec::new();
            waiting
                .poll_recv_many(context, &mut items, BATCH)
                .map(|count| (count > 0).then_some(Ok(Batch { items })))
        });
        Ok(Response::new(Box::pin(batches)))
    }
}

/// Reads the items of one stream and forwards them, until the stream or a room ends.
async fn read(rooms: Arc<Rooms>, mut requests: Streaming<Batch>, outbox: mpsc::Sender<Item>) {
    let mut mailboxes: HashMap<u32, mpsc::Sender<ToRoom>> = HashMap::new();
    while let Ok(Some(batch)) = requests.message().await {
        for Item { seat, body, attach } in batch.items {
            let mailbox = mailboxes.entry(seat).or_insert_with(|| rooms.of_seat(seat));
            let message = if attach > 0 {
                ToRoom::Attach {
                    seat,
                    outbox: outbox.clone(),
                    observation_bytes: attach,
                }
            } else {
                ToRoom::Answer { seat, body }
            };
            if mailbox.send(message).await.is_err() {
                return;
            }
        }
    }
    // The responses end when the last sender of the outbox is dropped.
    for (seat, mailbox) in mailboxes {
        // Ended rooms have no sender.
        let _ = mailbox.send(ToRoom::Leave { seat }).await;
    }
}

/// A room: when its seats are attached, it asks one after another.
async fn room(mut inbox: mpsc::Receiver<ToRoom>) {
    let mut seats: [Option<(mpsc::Sender<Item>, u32)>; SEATS] = Default::default();
    let mut messages = Vec::new();
    let mut asked = None;
    while inbox.recv_many(&mut messages, MAILBOX).await > 0 {
        for message in messages.drain(..) {
            let next = match message {
                ToRoom::Attach {
                    seat,
                    outbox,
                    observation_bytes,
                } => {
                    seats[seat as usize % SEATS] = Some((outbox, observation_bytes));
                    let complete = seats.iter().all(Option::is_some);
                    (complete && asked.is_none()).then_some(seat / SEATS as u32 * SEATS as u32)
                }
                // Answers out of turn would be a fault of the client, which counts what it
                // receives.
                ToRoom::Answer { seat, body } if asked == Some(seat) && !body.is_empty() => {
                    Some(if (seat + 1) % SEATS as u32 == 0 {
                        seat + 1 - SEATS as u32
                    } else {
                        seat + 1
                    })
                }
                ToRoom::Answer { .. } => None,
                ToRoom::Leave { seat } => {
                    seats[seat as usize % SEATS] = None;
                    None
                }
            };
            if let Some(next) = next
                && let Some((outbox, bytes)) = &seats[next as usize % SEATS]
            {
                asked = Some(next);
                let item = Item {
                    seat: next,
                    body: vec![0; *bytes as usize],
                    attach: 0,
                };
                if outbox.send(item).await.is_err() {
                    return;
                }
            }
        }
    }
}
