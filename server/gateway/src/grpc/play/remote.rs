//! The seats of a client's stream that other nodes have. For each of these nodes the reader opens
//! one stream (`chefshat.peer.v1`), passes the commands for its seats on, and queues its updates as
//! they are. This node is their gateway: here the client's transport takes decision requests and
//! answers are read, so here the time in between is measured, and neither the network between nodes
//! nor a pause of this process costs a seat its time.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};
use std::time::Duration;

use chefshat_proto::v1::{self, seat_command::Command};
use futures::StreamExt as _;
use futures::future::join_all;
use futures::stream;
use prost::Message as _;
use tokio::sync::{Notify, mpsc};
use tokio::time::{Instant, sleep};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::task::AbortOnDropHandle;
use tonic::transport::Channel;
use tonic::{Code, Request, Status};
use tracing::debug;

use super::parked::Parked;
use super::waiting::WaitingMemory;
use chefshat_base::clock::ProcessClock;
use chefshat_base::lock::Lock;
use chefshat_hosting::cluster::{Directory, Elsewhere, FoundBy, Peer};

use crate::grpc::forward::Gateway;
use crate::grpc::takeover::awaited;
use crate::peers::{PING_INTERVAL, PING_TIMEOUT};
use chefshat_admission::access::MAX_INPUTS_PER_MESSAGE;
use chefshat_admission::limits::Permit;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::config::{MAX_PEER_MESSAGE_BYTES, MAX_SEATS_PER_STREAM};
use chefshat_hosting::room::Loss;
use chefshat_room::ids::UnitId;
use chefshat_wire::encoded::peer::peer_service_client::PeerServiceClient;
use chefshat_wire::encoded::peer::{HandedOver, PlayInput, PlayRequest, play_input::Input};
use chefshat_wire::encoded::{Received, Updates};
use chefshat_wire::outbox::{OnHandover, OnSpace, Outbox, StreamEnd};

/// First handle of seats that the server attaches.
pub(super) const FIRST_ASSIGNED_HANDLE: u32 = 1 << 31;
/// Number of handles of seats that one node attaches to a stream.
pub(super) const HANDLES_PER_NODE: u32 = 1 << 24;
/// Inputs that wait for one stream to another node. A client that sends more waits.
const INPUTS_WAITING: usize = 1_024;
/// Most nodes whose seats one stream has: each needs handles of its own, as this one does.
const MAX_NODES: usize = ((u32::MAX - FIRST_ASSIGNED_HANDLE) / HANDLES_PER_NODE) as usize;

/// The seats of a client's stream that other nodes have.
pub(super) struct RemoteSeats {
    gateway: Gateway,
    outbox: Arc<Outbox>,
    clock: Arc<ProcessClock>,
    waiting: WaitingMemory,
    streams: Vec<PeerStream>,
    /// Whether the client has left, once its stream has ended: otherwise this node stops.
    client_left: Arc<AtomicBool>,
    /// Attachments that reached no node.
    give_back: mpsc::Sender<(u32, Box<Parked>)>,
    given_back: mpsc::Receiver<(u32, Box<Parked>)>,
}

/// An input for another node, with its memory if a client has sent it.
type WaitingInput = (PlayInput, Option<Permit>);

/// A stream to another node.
struct PeerStream {
    endpoint: Arc<str>,
    /// `None` once the client's stream has ended.
    inputs: Option<mpsc::Sender<WaitingInput>>,
    waiting: WaitingMemory,
    shared: Arc<Shared>,
    receiving: AbortOnDropHandle<()>,
}

/// What the reader of the client's stream and the receiver of a peer stream share.
#[derive(Default)]
struct Shared {
    seats: Lock<BTreeMap<u32, RemoteSeat>>,
    /// What the client attached there and lost because the node stops.
    stopped: Lock<BTreeSet<UnitId>>,
    /// Whether the stream has ended and its attachments were given back. Changes while `seats` are
    /// locked.
    is_over: AtomicBool,
    /// Whether the other node, or the connection to it, was lost with seats of the client.
    is_lost: AtomicBool,
}

impl Shared {
    /// The rooms and tournaments that the client has there, those included that the node stops.
    fn ids(&self) -> BTreeSet<UnitId> {
        let mut ids = self.stopped.lock().clone();
        ids.extend(self.seats.lock().values().filter_map(|seat| seat.id));
        ids
    }

    /// Whether a seat is there, or on its way.
    fn has(&self, handle: u32) -> bool {
        self.seats.lock().contains_key(&handle)
    }

    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    fn has_attached(&self) -> bool {
        self.seats.lock().values().any(|seat| seat.is_attached)
    }

    /// Ends the stream and returns its attachments, if none of them was successful: the client does
    /// not need to know that there was a stream.
    fn end_unattached(&self) -> Option<Vec<(u32, Box<Parked>)>> {
        let mut seats = self.seats.lock();
        // A client whose seats were detached because the other node stops waits for the end.
        if seats.is_empty() || seats.values().any(|seat| seat.parked.is_none()) {
            return None;
        }
        self.is_over.store(true, Ordering::Relaxed);
        let ended = std::mem::take(&mut *seats).into_iter();
        Some(
            ended
                .filter_map(|(handle, seat)| Some((handle, seat.parked?)))
                .collect(),
        )
    }
}

/// A seat or participant at another node that is attached, or about to be.
#[derive(Default)]
struct RemoteSeat {
    is_attached: bool,
    /// Its room or tournament, if it was found by that.
    id: Option<UnitId>,
    /// Its attachment, until it is attached. `None` if the other node attaches it by itself.
    parked: Option<Box<Parked>>,
    /// The last decision request.
    decision: Option<Arc<Handover>>,
}

/// When the client's transport took a decision request.
struct Handover {
    handle: u32,
    decision_id: u64,
    clock: Arc<ProcessClock>,
    /// The time that this process had run.
    at: OnceLock<Duration>,
    inputs: mpsc::WeakSender<WaitingInput>,
}

impl OnHandover for Handover {
    fn handed_over(&self, now: Instant) {
        let _ = self.at.set(self.clock.at(now));
        // Without it, the owner learns of it with the answer.
        if let Some(inputs) = self.inputs.upgrade() {
            let handed_over = HandedOver {
                handle: self.handle,
                decision_id: self.decision_id,
            };
            let input = PlayInput {
                input: Some(Input::HandedOver(handed_over)),
                elapsed_us: None,
            };
            let _ = inputs.try_send((input, None));
        }
    }
}

impl RemoteSeats {
    /// No seats yet, for the client whose stream has this outbox.
    pub(super) fn new(
        gateway: Gateway,
        outbox: &Arc<Outbox>,
        clock: &Arc<ProcessClock>,
        waiting: WaitingMemory,
    ) -> Self {
        let (give_back, given_back) = mpsc::channel(MAX_SEATS_PER_STREAM);
        Self {
            gateway,
            outbox: Arc::clone(outbox),
            clock: Arc::clone(clock),
            waiting,
            streams: Vec::new(),
            client_left: Arc::default(),
            give_back,
            given_back,
        }
    }

    /// Number of seats and participants.
    pub(super) fn count(&self) -> usize {
        let counts = self
            .streams
            .iter()
            .map(|stream| stream.shared.seats.lock().len());
        counts.sum()
    }

    /// Whether a seat or participant is attached.
    pub(super) fn has_attached(&self) -> bool {
        let attached = |stream: &PeerStream| stream.shared.has_attached();
        self.streams.iter().any(attached)
    }

    /// Whether an attachment with this secret, made before this handle, is on its way to another node
    /// than `to`. What goes to one node arrives there in its order.
    pub(super) fn has_before(&self, handle: u32, secret: &[u8; 32], to: Option<&Peer>) -> bool {
        let elsewhere = |it: &&PeerStream| to.is_none_or(|to| it.endpoint != to.endpoint);
        self.streams.iter().filter(elsewhere).any(|stream| {
            let seats = stream.shared.seats.lock();
            let mut before = seats
                .range(..handle)
                .filter_map(|(_, seat)| seat.parked.as_ref());
            before.any(|parked| parked.has_secret(secret))
        })
    }

    /// Attaches a seat or participant of another node. If that node turns out to be gone, and the
    /// stream has nothing else there, [`RemoteSeats::poll_given_back`] gives the attachment back.
    ///
    /// # Errors
    /// The stream to that node has ended, or there are too many.
    pub(super) async fn attach(
        &mut self,
        elsewhere: &Elsewhere,
        handle: u32,
        parked: Parked,
    ) -> Result<(), NotPassedOn> {
        let endpoint = &elsewhere.peer.endpoint;
        let is_over = |stream: &PeerStream| stream.shared.is_over();
        let open = |stream: &PeerStream| stream.endpoint == *endpoint && !is_over(stream);
        let number = match self.streams.iter().position(open) {
            Some(number) => number,
            None => {
                let free = self.streams.iter().position(is_over);
                let number = free.unwrap_or(self.streams.len());
                if number == MAX_NODES {
                    return Err(NotPassedOn::TooManyNodes);
                }
                let stream = self.open(elsewhere, number);
                match free {
                    Some(number) => self.streams[number] = stream,
                    None => self.streams.push(stream),
                }
                number
            }
        };
        let stream = &self.streams[number];
        let command = v1::SeatCommand {
            handle,
            command: Some(Command::Attach(parked.attach.clone())),
        };
        let parked = Box::new(parked);
        {
            let mut seats = stream.shared.seats.lock();
            if stream.shared.is_over() {
                return Err(NotPassedOn::NodeGone(parked));
            }
            let id = match elsewhere.found_by {
                Some(FoundBy::Id(id)) => Some(id),
                Some(FoundBy::Code(_) | FoundBy::Game(_)) | None => None,
            };
            let seat = RemoteSeat {
                id,
                parked: Some(parked),
                ..RemoteSeat::default()
            };
            seats.insert(handle, seat);
        }
        // If the stream has ended, what becomes of the attachment depends on its other seats.
        let _ = stream.send(command, None).await;
        Ok(())
    }

    /// Waits for an attachment that reached no node.
    pub(super) fn poll_given_back(
        &mut self,
        context: &mut Context<'_>,
    ) -> Poll<(u32, Box<Parked>)> {
        match self.given_back.poll_recv(context) {
            Poll::Ready(Some(given_back)) => Poll::Ready(given_back),
            // There is a sender here.
            Poll::Ready(None) | Poll::Pending => Poll::Pending,
        }
    }

    /// Passes a command on; gives it back if no other node has its seat.
    ///
    /// # Errors
    /// The stream to the seat's node has ended.
    pub(super) async fn pass_on(
        &self,
        command: v1::SeatCommand,
        arrived: Instant,
    ) -> Result<Option<v1::SeatCommand>, NodeGone> {
        let Some(stream) = self.stream_of(command.handle) else {
            return Ok(Some(command));
        };
        let elapsed = match &command.command {
            Some(Command::Answer(answer)) => stream.handed_over(command.handle, answer.decision_id),
            _ => None,
        };
        let elapsed = elapsed.map(|at| self.clock.at(arrived).saturating_sub(at).as_micros());
        let elapsed_us = elapsed.map(|micros| u64::try_from(micros).unwrap_or(u64::MAX));
        stream.send(command, elapsed_us).await.map(|()| None)
    }

    fn stream_of(&self, handle: u32) -> Option<&PeerStream> {
        let stream = match handle.checked_sub(FIRST_ASSIGNED_HANDLE) {
            None => self.streams.iter().find(|stream| stream.shared.has(handle)),
            // The first handles are those of this node.
            Some(offset) => {
                let number = usize::try_from(offset / HANDLES_PER_NODE)
                    .ok()?
                    .checked_sub(1)?;
                self.streams.get(number)
            }
        };
        stream.filter(|stream| !stream.shared.is_over())
    }

    /// Whether the client's stream ends because another node was lost.
    pub(super) fn has_lost_a_node(&self) -> bool {
        let is_lost = |stream: &PeerStream| stream.shared.is_lost.load(Ordering::Relaxed);
        self.streams.iter().any(is_lost)
    }

    /// Ends the streams to other nodes, and waits until their last updates are queued, or until the
    /// nodes must know that a client that has gone is gone. `loss`: how the client's stream ends.
    pub(super) async fn leave(&mut self, loss: Loss) {
        (self.client_left).store(loss == Loss::Gone, Ordering::Relaxed);
        let outbox = Arc::clone(&self.outbox);
        let mut streams = std::mem::take(&mut self.streams);
        let ended = join_all(streams.iter_mut().map(|stream| {
            stream.inputs = None;
            &mut stream.receiving
        }));
        tokio::select! {
            _ = ended => {}
            () = async {
                outbox.abandoned().await;
                sleep(PING_INTERVAL + PING_TIMEOUT).await;
            } => {}
        }
    }

    /// Opens a stream to the node that has something.
    fn open(&self, elsewhere: &Elsewhere, number: usize) -> PeerStream {
        let (inputs, waiting) = mpsc::channel(INPUTS_WAITING);
        let shared = Arc::new(Shared::default());
        let number = u32::try_from(number).expect("at most MAX_NODES");
        let receiver = Receiver {
            shared: Arc::clone(&shared),
            clock: Arc::clone(&self.clock),
            inputs: inputs.downgrade(),
            outbox: Arc::clone(&self.outbox),
            space: Arc::default(),
        };
        let mut first_assigned_handle = FIRST_ASSIGNED_HANDLE + (number + 1) * HANDLES_PER_NODE;
        let batches = ReceiverStream::new(waiting).ready_chunks(MAX_INPUTS_PER_MESSAGE);
        let requests = batches.map(move |inputs| {
            let first_assigned_handle = std::mem::take(&mut first_assigned_handle);
            let is_first = first_assigned_handle > 0;
            PlayRequest {
                inputs: inputs.into_iter().map(|(input, _)| input).collect(),
                first_assigned_handle,
                answers_contested: is_first,
                announces_left: is_first,
                left: false,
            }
        });
        let client_left = Arc::clone(&self.client_left);
        let last = stream::once(async move {
            PlayRequest {
                left: client_left.load(Ordering::Relaxed),
                ..PlayRequest::default()
            }
        });
        let requests = requests.chain(last);
        let request = self.gateway.request(requests);
        let peer = elsewhere.peer.clone();
        let channel = self.gateway.peers().channel(&peer);
        let directory = Arc::clone(self.gateway.directory());
        let give_back = self.give_back.clone();
        PeerStream {
            endpoint: Arc::clone(&elsewhere.peer.endpoint),
            inputs: Some(inputs),
            waiting: self.waiting.clone(),
            shared,
            receiving: AbortOnDropHandle::new(tokio::spawn(named(
                LongTask::PeerStream,
                async move {
                    let ended = receiver.receive(channel.clone(), request).await;
                    if receiver.inputs.upgrade().is_some() {
                        let ids = receiver.shared.ids();
                        if let Some(attachments) = receiver.shared.end_unattached() {
                            debug!(
                                ?ended,
                                "a stream to another node has ended, which had no seats"
                            );
                            for id in &ids {
                                directory.forget(&FoundBy::Id(*id));
                            }
                            for attachment in attachments {
                                let _ = give_back.try_send(attachment);
                            }
                            return;
                        }
                        awaited(&*directory, &peer, channel, ids).await;
                    }
                    receiver.ended(ended, &*directory);
                },
            ))),
        }
    }
}

/// The stream to another node has ended; so does the client's.
pub(super) struct NodeGone;

/// Why an attachment was not passed on.
pub(super) enum NotPassedOn {
    /// The stream to its node has just ended.
    NodeGone(Box<Parked>),
    /// The client's stream has seats at too many nodes.
    TooManyNodes,
}

impl PeerStream {
    async fn send(
        &self,
        command: v1::SeatCommand,
        elapsed_us: Option<u64>,
    ) -> Result<(), NodeGone> {
        let inputs = self.inputs.as_ref().ok_or(NodeGone)?;
        let memory = self.waiting.take(command.encoded_len()).await;
        let input = PlayInput {
            input: Some(Input::Command(command)),
            elapsed_us,
        };
        let sent = inputs.send((input, Some(memory))).await;
        sent.map_err(|_| NodeGone)
    }

    /// When the client's transport took the request for a decision, in time that the process has run.
    fn handed_over(&self, handle: u32, decision_id: u64) -> Option<Duration> {
        let seats = self.shared.seats.lock();
        let handover = seats.get(&handle)?.decision.as_ref()?;
        (handover.decision_id == decision_id)
            .then(|| handover.at.get().copied())
            .flatten()
    }
}

/// Queues the updates of a peer stream for the client.
struct Receiver {
    shared: Arc<Shared>,
    clock: Arc<ProcessClock>,
    inputs: mpsc::WeakSender<WaitingInput>,
    outbox: Arc<Outbox>,
    space: Arc<Space>,
}

/// Notified when the client's outbox has space.
#[derive(Default)]
struct Space(Notify);

impl OnSpace for Space {
    fn space(&self) {
        self.0.notify_one();
    }
}

impl Receiver {
    async fn receive<R>(&self, channel: Channel, request: Request<R>) -> Result<(), Status>
    where
        R: futures::Stream<Item = PlayRequest> + Send + 'static,
    {
        let mut client =
            PeerServiceClient::new(channel).max_decoding_message_size(MAX_PEER_MESSAGE_BYTES);
        let mut responses = client.play(request).await?.into_inner();
        while let Some(updates) = responses.message().await? {
            self.queue(updates).await;
        }
        Ok(())
    }

    /// Queues updates, once the outbox has space for them: until then nothing more is received.
    async fn queue(&self, mut updates: Updates) {
        let (mut handovers, mut contested) = (Vec::new(), Vec::new());
        for (handle, update) in updates.received() {
            match update {
                Received::Contested => contested.push(handle),
                update => handovers.extend(self.follow(handle, update)),
            }
        }
        if !contested.is_empty() {
            updates = updates.without_contested();
            self.confirm(contested).await;
        }
        let on_space: Arc<dyn OnSpace> = Arc::clone(&self.space) as _;
        loop {
            let stamps = handovers.iter().map(|it| Arc::clone(it) as _);
            if (self.outbox).push(&mut updates, stamps, Some(&on_space)) {
                return;
            }
            self.space.0.notified().await;
        }
    }

    /// Lets the owner attach seats that other streams have, unless the client has left this one.
    async fn confirm(&self, contested: Vec<u32>) {
        let Some(inputs) = self.inputs.upgrade().filter(|_| self.outbox.is_open()) else {
            return;
        };
        for handle in contested {
            let still_open = PlayInput {
                input: Some(Input::StillOpen(handle)),
                elapsed_us: None,
            };
            // If the stream has ended, so does the client's.
            let _ = inputs.send((still_open, None)).await;
        }
    }

    /// Notes what an update says about its seat.
    fn follow(&self, handle: u32, update: Received) -> Option<Arc<Handover>> {
        let mut seats = self.shared.seats.lock();
        match update {
            Received::Attached => {
                let seat = seats.entry(handle).or_default();
                (seat.is_attached, seat.parked) = (true, None);
            }
            Received::Detached { stops } => {
                let detached = seats.remove(&handle);
                // Those of games that are over are of no interest any more.
                if let Some(id) = detached.and_then(|seat| seat.id).filter(|_| stops) {
                    self.shared.stopped.lock().insert(id);
                }
            }
            // Of its attachment, or of another command.
            Received::Refused => {
                if seats.get(&handle).is_some_and(|seat| !seat.is_attached) {
                    seats.remove(&handle);
                }
            }
            Received::Decision(decision_id) => {
                let handover = Arc::new(Handover {
                    handle,
                    decision_id,
                    clock: Arc::clone(&self.clock),
                    at: OnceLock::new(),
                    inputs: self.inputs.clone(),
                });
                let seat = seats.get_mut(&handle)?;
                seat.decision = Some(Arc::clone(&handover));
                return Some(handover);
            }
            Received::Contested | Received::Other => {}
        }
        None
    }

    /// Ends the client's stream, unless the client has ended the stream to the other node.
    fn ended(&self, ended: Result<(), Status>, directory: &dyn Directory) {
        if self.inputs.upgrade().is_none() {
            return;
        }
        debug!(?ended, "a stream to another node has ended");
        for id in &self.shared.ids() {
            directory.forget(&FoundBy::Id(*id));
        }
        // What the other node refuses has another code, and is the client's own fault.
        let is_lost = |status: Status| {
            matches!(
                status.code(),
                Code::Unavailable | Code::Unknown | Code::Internal
            )
        };
        let is_lost = ended.err().is_some_and(is_lost);
        self.shared.is_lost.store(is_lost, Ordering::Relaxed);
        self.outbox.end(StreamEnd::RoomGone);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receiver() -> Receiver {
        let (inputs, _waiting) = mpsc::channel(1);
        let (outbox, _updates) = Outbox::new();
        Receiver {
            shared: Arc::default(),
            clock: Arc::default(),
            inputs: inputs.downgrade(),
            outbox,
            space: Arc::default(),
        }
    }

    #[test]
    fn what_ended_at_another_node_leaves_nothing_on_a_long_stream() {
        let receiver = receiver();
        let room = |number: u32| UnitId::parse(&format!("{number:032x}"));
        for number in 0..10_000 {
            let seat = RemoteSeat {
                id: room(number),
                ..RemoteSeat::default()
            };
            receiver.shared.seats.lock().insert(number, seat);
            let end = match number % 3 {
                0 => Received::Refused,
                _ => {
                    receiver.follow(number, Received::Attached);
                    receiver.follow(number, Received::Decision(1));
                    Received::Detached { stops: false }
                }
            };
            assert!(receiver.shared.has(number));
            receiver.follow(number, end);
            assert!(!receiver.shared.has(number), "its handle is invalid");
        }
        // Those that live, and those that continue at another node, are looked for there.
        for (number, end) in [(1, None), (2, Some(Received::Detached { stops: true }))] {
            let id = room(number);
            let seat = RemoteSeat {
                id,
                ..RemoteSeat::default()
            };
            receiver.shared.seats.lock().insert(number, seat);
            receiver.follow(number, Received::Attached);
            end.map(|end| receiver.follow(number, end));
        }
        assert_eq!(receiver.shared.seats.lock().len(), 1);
        assert_eq!(
            receiver.shared.ids(),
            [1, 2].into_iter().filter_map(room).collect()
        );
    }

    #[test]
    fn the_end_of_a_stream_whose_seats_a_node_that_stops_has_detached_is_told() {
        let receiver = receiver();
        let parked = || RemoteSeat {
            parked: Some(Box::new(Parked::new(v1::Attach::default()))),
            ..RemoteSeat::default()
        };
        receiver.shared.seats.lock().insert(3, parked());
        receiver.follow(3, Received::Attached);
        assert!(receiver.shared.end_unattached().is_none());
        receiver.follow(3, Received::Detached { stops: true });
        assert!(receiver.shared.end_unattached().is_none());

        receiver.shared.seats.lock().insert(4, parked());
        let given_back = receiver
            .shared
            .end_unattached()
            .expect("it never had a seat");
        assert!(given_back.iter().map(|(handle, _)| *handle).eq([4]));
    }
}
