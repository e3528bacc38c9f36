//! `PlayService`: streams of seats, and single commands without a stream. `reader` executes the
//! requests of a stream; the responses come from its outbox, which rooms fill.

mod attaching;
#[cfg(test)]
mod late_tests;
mod parked;
#[cfg(test)]
mod parked_tests;
mod participants;
mod reader;
mod remote;
mod requests;
#[cfg(test)]
mod testing;
mod waiting;

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};

use chefshat_proto::v1::{self, act_request};
use futures::{Stream, StreamExt as _, TryStreamExt as _};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};

use super::analysis::estimate_to_proto;
use super::fields::request_id;
use super::forward::Gateway;
use super::limits::{Arrived, make_way};
use super::lookup::Lookup;
use super::status::{
    command_missing, invalid, room_failed, room_unknown, stream_ended, ticket_unknown,
};
use crate::peers::Peers;
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{Executing, FairSemaphore, Hint, Key};
use chefshat_base::metrics::StreamKind;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::cluster::Directory;
use chefshat_hosting::config::MAX_SEATS_PER_WATCH;
use chefshat_hosting::room::SeatAction;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::tournaments::Tournaments;
use chefshat_room::ids::{Id, RoomToken};
use chefshat_wire::convert;
use chefshat_wire::encoded::Updates;
use chefshat_wire::encoded::peer::peer_service_server::PeerService;
use chefshat_wire::encoded::peer::{
    IdentifyRequest, IdentifyResponse, PlayRequest, ReachRequest, ReachResponse, ShareRequest,
    ShareResponse,
};
use chefshat_wire::encoded::service::play_service_server::PlayService;
use chefshat_wire::outbox::{Outbox, OutboxStream, StreamEnd};
use reader::{Reader, Requests, express_action};
pub use waiting::MAX_WAITING_MEMORY;
use waiting::WaitingMemory;

/// The service.
#[derive(Debug, Clone)]
pub struct Play {
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    lookup: Lookup,
    /// Of commands that wait, of all streams.
    waiting: Arc<FairSemaphore>,
    /// Cancelled when all streams must end.
    closing: CancellationToken,
}

impl Play {
    /// Creates the service for these rooms and tournaments; `closing` ends its streams.
    pub fn new(
        rooms: Arc<Rooms>,
        tournaments: Arc<Tournaments>,
        closing: CancellationToken,
    ) -> Self {
        Self {
            lookup: Lookup::new(Arc::clone(&rooms), Arc::clone(&tournaments)),
            waiting: WaitingMemory::for_all(rooms.shares()),
            rooms,
            tournaments,
            closing,
        }
    }

    /// Creates the reader of a new stream.
    fn reader(&self, caller: Caller, outbox: &Arc<Outbox>, with_decisions: bool) -> Reader {
        self.rooms.metrics().add_outbox(outbox);
        Reader::new(
            &self.rooms,
            &self.tournaments,
            WaitingMemory::of(&self.waiting, Key::of_caller(&caller)),
            caller,
            outbox,
            with_decisions,
        )
    }
}

impl Play {
    /// Starts to read a stream, and returns its responses.
    fn responses<R: Requests + 'static>(
        &self,
        reader: Reader,
        requests: Streaming<R>,
        updates: OutboxStream,
    ) -> Response<Responses> {
        let failure = Arc::new(OnceLock::new());
        let (closing, outbox) = (self.closing.clone(), Arc::clone(&reader.outbox));
        let reading = reader.read(requests, Arc::clone(&failure), closing.clone());
        tokio::spawn(named(LongTask::PlayReader, reading));
        let counted = self.rooms.metrics().stream(StreamKind::Play);
        tokio::spawn(named(LongTask::PlayEnd, async move {
            let _counted = counted;
            tokio::select! {
                () = closing.cancelled() => outbox.stop_reading(),
                () = outbox.abandoned() => {}
            }
        }));
        Response::new(Responses { updates, failure })
    }
}

/// What other nodes ask: streams for their clients, and to be reached.
#[derive(Debug, Clone)]
pub struct OfNodes {
    play: Play,
    directory: Arc<dyn Directory>,
    peers: Arc<Peers>,
}

impl OfNodes {
    /// Creates the service; it reaches the nodes of `directory` over `peers`.
    pub fn new(play: Play, directory: Arc<dyn Directory>, peers: Arc<Peers>) -> Self {
        Self {
            play,
            directory,
            peers,
        }
    }
}

impl PeerService for OfNodes {
    type PlayStream = Responses;

    async fn play(
        &self,
        request: Request<Streaming<PlayRequest>>,
    ) -> Result<Response<Responses>, Status> {
        let (outbox, updates) = Outbox::new();
        let caller = Caller::of(request.extensions());
        let reader = self.play.reader(caller, &outbox, true).by_gateway();
        Ok(self.play.responses(reader, request.into_inner(), updates))
    }

    async fn share(
        &self,
        request: Request<Streaming<ShareRequest>>,
    ) -> Result<Response<ShareResponse>, Status> {
        let mut requests = request.into_inner();
        let mut sharing = None;
        while let Some(message) = self
            .play
            .closing
            .run_until_cancelled(requests.message())
            .await
            && let Ok(Some(ShareRequest { room_id, others })) = message
        {
            let counted = match &mut sharing {
                Some(counted) => counted,
                unknown => {
                    let room = Id::parse(&room_id).and_then(|id| self.play.rooms.get(id));
                    unknown.insert(room.ok_or_else(room_unknown)?.sharing())
                }
            };
            counted.set(others);
        }
        Ok(Response::new(ShareResponse {}))
    }

    async fn reach(
        &self,
        request: Request<ReachRequest>,
    ) -> Result<Response<ReachResponse>, Status> {
        // Others are not delayed while it is reached.
        make_way(request.extensions());
        let name = request.into_inner().node;
        let (_, others) = self.directory.nodes().await;
        let Some(peer) = others.iter().find(|peer| *peer.node == *name) else {
            return Err(Status::not_found("it does not know this node yet"));
        };
        let reached = self.peers.reach(peer).await;
        let problem = reached.err().unwrap_or_default();
        Ok(Response::new(ReachResponse { problem }))
    }

    async fn identify(
        &self,
        _: Request<IdentifyRequest>,
    ) -> Result<Response<IdentifyResponse>, Status> {
        // Without the database, which may be slow: what is asked is whether this node is reached.
        let own = self.directory.own_name();
        let signing_key = self.play.rooms.signing_key();
        Ok(Response::new(IdentifyResponse {
            node: own.to_string(),
            signing_key: Some(signing_key.map_or_else(String::new, |key| key.to_string())),
        }))
    }
}

impl PlayService for Play {
    type PlayStream = Responses;
    type WatchStream = Pin<Box<dyn Stream<Item = Result<Updates, Status>> + Send>>;

    async fn play(
        &self,
        request: Request<Streaming<v1::PlayRequest>>,
    ) -> Result<Response<Self::PlayStream>, Status> {
        let (outbox, updates) = Outbox::new();
        let caller = Caller::of(request.extensions());
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let reader = self.reader(caller, &outbox, true).with_remote(gateway);
        Ok(self.responses(reader, request.into_inner(), updates))
    }

    async fn watch(
        &self,
        request: Request<v1::PlayServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let caller = Caller::of(request.extensions());
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let seats = request.into_inner().seats;
        if !(1..=MAX_SEATS_PER_WATCH).contains(&seats.len()) {
            return Err(invalid(
                "SEATS_REFUSED",
                "seats",
                format!("list 1 to {MAX_SEATS_PER_WATCH} seats"),
            ));
        }
        let (outbox, updates) = Outbox::new();
        let mut reader = self.reader(caller, &outbox, false).with_remote(gateway);
        let closing = self.closing.clone();
        let counted = self.rooms.metrics().stream(StreamKind::Watch);
        tokio::spawn(named(LongTask::Watch, async move {
            let _counted = counted;
            for attach in seats {
                reader.attach(attach).await;
            }
            if !reader.has_attached() {
                return outbox.end(StreamEnd::Complete);
            }
            // The seats stay attached until the client goes or the server closes. A call that has
            // been received is executed completely: cancelled half-way, the seat would be attached
            // to no stream.
            loop {
                tokio::select! {
                    () = outbox.abandoned() => break,
                    () = closing.cancelled() => break,
                    own = poll_fn(|context| reader.poll_own(context)) => {
                        reader.do_own(own).await;
                        if !reader.has_attached() {
                            return outbox.end(StreamEnd::Complete);
                        }
                    }
                }
            }
            reader.leave_at_end(&closing).await;
            outbox.end(StreamEnd::Complete);
        }));
        Ok(Response::new(Box::pin(updates.map_err(stream_ended))))
    }

    async fn act(
        &self,
        request: Request<v1::ActRequest>,
    ) -> Result<Response<v1::ActResponse>, Status> {
        let arrived = Arrived::of(request.extensions());
        let caller = Caller::of(request.extensions());
        let executing: Option<Executing> = request.extensions().get().cloned();
        let request = request.into_inner();
        let token = RoomToken::parse(&request.ticket).ok_or_else(ticket_unknown)?;
        // Before the room is looked for: what is wrong with a command does not depend on the ticket.
        let command = Command::of(request.command)?;
        if let Some(executing) = executing
            .as_ref()
            .filter(|_| !self.lookup.has_in_memory(token.subject.unit()))
        {
            // Others are not delayed while it is looked for.
            executing.give_back();
        }
        let room = (self.lookup).room_of_ticket(&caller, token.subject, ticket_unknown);
        let room = room.await?;
        let action = match command {
            Command::Perform(action) => action,
            Command::Hint(decision, request_id) => {
                // The answers of others do not wait for its search.
                if let Some(executing) = executing {
                    executing.give_back();
                }
                let hint = room.hint(token.secret, decision, request_id).await;
                let hint = hint.map_err(room_failed(ticket_unknown))?;
                return Ok(Response::new(v1::ActResponse {
                    result: None,
                    hint: Some(hint_to_proto(&hint)),
                }));
            }
        };
        let result = room
            .act((token.secret, Key::of_caller(&caller)), action, arrived)
            .await
            .map_err(room_failed(ticket_unknown))?;
        Ok(Response::new(v1::ActResponse { result, hint: None }))
    }
}

/// A command without a stream that is well formed.
enum Command {
    Perform(SeatAction),
    /// A hint about a decision, with the id of the request.
    Hint(u64, Option<[u8; 32]>),
}

impl Command {
    fn of(command: Option<act_request::Command>) -> Result<Self, Status> {
        Ok(match command {
            Some(act_request::Command::Answer(answer)) => {
                Self::Perform(SeatAction::Answer(convert::answer_from_proto(answer)))
            }
            Some(act_request::Command::Express(expression)) => {
                Self::Perform(express_action(&expression)?)
            }
            Some(act_request::Command::Resume(_)) => Self::Perform(SeatAction::Resume),
            Some(act_request::Command::Hint(ask)) => {
                // A hint belongs to its ticket, not to who shows that.
                let request_id = request_id(&ask.request_id, &Caller::default())?;
                Self::Hint(ask.decision_id, request_id)
            }
            None => {
                return Err(command_missing());
            }
        })
    }
}

fn hint_to_proto(hint: &Hint) -> v1::Hint {
    v1::Hint {
        action: hint.suggested.index().into(),
        actions: hint.estimates.iter().map(estimate_to_proto).collect(),
    }
}

/// The responses of a Play stream.
#[derive(Debug)]
pub struct Responses {
    updates: OutboxStream,
    /// Why the requests failed, if they did.
    failure: Arc<OnceLock<Status>>,
}

impl Stream for Responses {
    type Item = Result<Updates, Status>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let next = self.updates.poll_next_unpin(context);
        next.map_err(|end| {
            let failure = self
                .failure
                .get()
                .filter(|_| end == StreamEnd::RequestsFailed);
            failure.cloned().unwrap_or_else(|| stream_ended(end))
        })
    }
}

#[cfg(test)]
mod tests {
    use tokio_util::task::TaskTracker;

    use super::*;
    use crate::grpc::limits::FullShare;
    use chefshat_hosting::config::ServerConfig;
    use chefshat_hosting::rooms::NewRoom;
    use chefshat_store::MemoryStore;

    /// Whether another call may be executed while this one waits for its room.
    async fn makes_way(command: act_request::Command) -> bool {
        let store = Arc::new(MemoryStore::default());
        let rooms =
            Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
        let created = rooms.create(NewRoom::for_tests());
        let room = created.await.expect("a room").handle.id();
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        let play = Play::new(rooms, tournaments, CancellationToken::new());
        let mut request = Request::new(v1::ActRequest {
            ticket: RoomToken::random(room).to_text(),
            command: Some(command),
        });
        let share = FullShare::with(&mut request);
        // The room runs on the same thread, and does not until this test waits.
        assert!(futures::poll!(Box::pin(play.act(request))).is_pending());
        share.has_place()
    }

    #[tokio::test]
    async fn a_hint_makes_way_for_answers() {
        let hint = act_request::Command::Hint(v1::AskHint {
            decision_id: 1,
            ..v1::AskHint::default()
        });
        assert!(makes_way(hint).await);
        let answer = act_request::Command::Answer(v1::Answer::default());
        assert!(!makes_way(answer).await);
    }
}
