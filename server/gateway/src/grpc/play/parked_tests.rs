//! Attachments whose rooms change hands: the other seats of their streams play on.

use std::future::poll_fn;
use std::sync::{Arc, Mutex};

use chefshat_engine::Seat;
use chefshat_proto::v1::{self, seat_command::Command, seat_update::Update};
use futures::future::ready;
use futures::{FutureExt as _, StreamExt as _};
use prost::Message as _;
use tokio::net::TcpListener;
use tokio::time::{Duration, Instant};
use tokio_util::task::TaskTracker;

use super::parked::search;
use super::testing::{Node, Stream, attachment};
use crate::grpc::forward::ForwardLayer;
use crate::grpc::status::{owner_unreachable, ticket_unknown};
use crate::peers::PeerPort;
use chefshat_admission::limits::{CallLimits, Key, Shares};
use chefshat_hosting::cluster::{Directory, FoundBy, Location, NodeLease, Peer};
use chefshat_hosting::config::ServerConfig;
use chefshat_hosting::rooms::Rooms;
use chefshat_room::ids::{RoomId, RoomToken, Token, TournamentId, UnitId, UnitToken};
use chefshat_room::journal::{Change, Entry, ParticipantKind, SeatedParticipant};
use chefshat_store::{MemoryStore, ResumableGame};
use chefshat_wire::outbox::StreamEnd;

/// Says the same about everything that this node does not have, until the test changes it.
struct Says {
    now: Mutex<Location>,
    after_forgetting: Location,
}

impl Says {
    fn only(location: Location) -> Arc<Self> {
        Self::first(location.clone(), location)
    }

    fn first(now: Location, after_forgetting: Location) -> Arc<Self> {
        let now = Mutex::new(now);
        Arc::new(Self {
            now,
            after_forgetting,
        })
    }

    fn say(&self, location: Location) {
        *self.now.lock().expect("no panic") = location;
    }
}

#[tonic::async_trait]
impl Directory for Says {
    async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
        (Arc::from(""), Vec::new())
    }

    async fn locate(&self, _found_by: &FoundBy, _caller: Key) -> Location {
        self.now.lock().expect("no panic").clone()
    }

    async fn is_over(&self, _tournament: TournamentId) -> bool {
        false
    }

    fn forget(&self, _found_by: &FoundBy) {
        self.say(self.after_forgetting.clone());
    }
}

impl Node {
    fn start(directory: &Arc<Says>) -> Self {
        let lease = Arc::new(NodeLease::new());
        lease.set(Instant::now() + Duration::from_hours(1));
        lease.set_reached();
        let config = ServerConfig::default();
        let (store, directory) = (Arc::new(MemoryStore::default()), Arc::clone(directory));
        let tracker = TaskTracker::new();
        Self::of(Rooms::of_node(
            &config,
            store,
            directory,
            Some(lease),
            tracker,
        ))
    }

    /// Resumes the room of a seat that another node had.
    async fn take_over(&self, former: &Self, ticket: RoomToken) {
        let header = former
            .rooms
            .header(ticket.subject)
            .expect("it had the room");
        let participant = SeatedParticipant {
            name: "Ada".into(),
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            ticket: ticket.hash(),
        };
        let seated = Change::Seated {
            seat: Seat::new(0),
            participant: Box::new(participant),
        };
        let entries = vec![Entry {
            at: Duration::ZERO,
            change: seated,
        }];
        let journal = (self.rooms.store()).create(Arc::clone(&header), entries.clone());
        let game = ResumableGame {
            header: (*header).clone(),
            entries,
            journal: journal.await.expect("memory"),
            concluded: false,
        };
        assert_eq!(self.rooms.resume_all(vec![game]).await, 1);
    }
}

/// The ticket of a seat in a room that no node has in memory.
fn elsewhere() -> v1::Attach {
    attachment(&Token::random(UnitId::from_bytes([7; 16])))
}

impl Stream {
    /// Reads a command as the client sends it. It waits for nothing.
    fn read(&mut self, handle: u32, command: Command) {
        let command = v1::SeatCommand {
            handle,
            command: Some(command),
        };
        let read = self.reader.execute(command, Instant::now(), true);
        let read = read.now_or_never();
        read.expect("the reader waits for no room that changes hands");
    }

    /// Does what the next search for parked attachments comes to.
    async fn search(&mut self) {
        let own = poll_fn(|context| self.reader.poll_own(context)).await;
        self.reader.do_own(own).await;
    }

    /// The handles of the updates that wait, each with its kind, or the end of the stream.
    fn received(&mut self) -> Result<Vec<(u32, &'static str)>, StreamEnd> {
        let Some(Some(updates)) = self.updates.next().now_or_never() else {
            return Ok(Vec::new());
        };
        let bytes = updates?.encode_to_vec();
        let response = v1::PlayResponse::decode(bytes.as_slice()).expect("readable");
        let updates = response.updates.into_iter().map(|update| {
            let kind = match update.update {
                Some(Update::Attached(_)) => "attached",
                Some(Update::Refused(_)) => "refused",
                Some(Update::Detached(_)) => "detached",
                _ => "another",
            };
            (update.handle, kind)
        });
        Ok(updates.filter(|(_, kind)| *kind != "another").collect())
    }
}

#[tokio::test(start_paused = true)]
async fn a_seat_whose_room_changes_hands_delays_no_other_seat() {
    let directory = Says::only(Location::Unknown);
    let node = Node::start(&directory);
    let mut stream = node.stream();
    stream.read(0, Command::Attach(elsewhere()));
    stream.reader.attach(node.seat().await).await;
    assert_eq!(stream.received(), Ok(vec![(1, "attached")]));
    stream.read(0, Command::Express(v1::Expression::default()));
    // Far longer than a client's longest pause.
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(30) {
        stream.search().await;
        assert_eq!(stream.received(), Ok(vec![]), "the stream stays open");
    }
    assert!(!stream.reader.seats[&1].is_detached());
    directory.say(Location::Nowhere);
    stream.search().await;
    let refused = vec![(0, "refused"), (0, "refused")];
    assert_eq!(
        stream.received(),
        Ok(refused),
        "its attachment, and what was sent after it"
    );
}

#[tokio::test(start_paused = true)]
async fn a_long_stream_keeps_few_seats_that_are_detached() {
    let node = Node::start(&Says::only(Location::Nowhere));
    let mut stream = node.stream();
    let attach = node.seat().await;
    for _ in 0..2_000 {
        // Supersedes the last one.
        stream.reader.attach(attach.clone()).await;
        stream.received().expect("open");
    }
    let live = (stream.reader.seats.values()).filter(|seat| !seat.is_detached());
    assert_eq!(live.count(), 1);
    let kept = stream.reader.seats.len();
    assert!(kept <= 2 + super::reader::DETACHED_KEPT, "{kept}");
}

#[tokio::test(start_paused = true)]
async fn a_client_with_nothing_else_tries_another_node_after_its_patience() {
    let node = Node::start(&Says::only(Location::Unknown));
    let mut stream = node.stream();
    stream.read(0, Command::Attach(elsewhere()));
    let began = Instant::now();
    let end = loop {
        stream.search().await;
        match stream.received() {
            Ok(updates) => assert!(updates.is_empty(), "{updates:?}"),
            Err(end) => break end,
        }
    };
    assert_eq!(end, StreamEnd::RoomGone);
    assert!(began.elapsed() >= crate::grpc::takeover::PATIENCE);
}

#[tokio::test(start_paused = true)]
async fn a_seat_is_attached_when_its_room_has_been_taken_over() {
    let former = Node::start(&Says::only(Location::Nowhere));
    let attach = former.seat().await;
    let next = Node::start(&Says::only(Location::Unknown));
    let mut stream = next.stream();
    let ticket = RoomToken::parse(&attach.ticket).expect("a ticket");
    stream.read(0, Command::Attach(attach));
    stream.read(0, Command::Detach(v1::Detach {}));
    stream.search().await;
    assert_eq!(stream.received(), Ok(vec![]));
    next.take_over(&former, ticket).await;
    stream.search().await;
    let detached = vec![(0, "attached"), (0, "detached")];
    let mut received = Vec::new();
    for _ in 0..1_000 {
        tokio::task::yield_now().await;
        received.extend(stream.received().expect("open"));
    }
    assert_eq!(
        received, detached,
        "and detached, as its client asked meanwhile"
    );
}

/// A node to which nobody can connect.
fn unreachable_node() -> Location {
    Location::Node(Peer {
        node: "died".into(),
        endpoint: "127.0.0.1:1".into(),
    })
}

/// A stream whose seats may be at other nodes.
async fn stream_of_gateway(node: &Node, directory: &Arc<Says>) -> Stream {
    let own = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let peers = PeerPort::new(own, None)
        .expect("a loopback address")
        .peers(&Arc::default());
    let limits = Arc::new(CallLimits::new(Shares::default()));
    let known: Arc<dyn Directory> = Arc::clone(directory) as _;
    let layer = ForwardLayer::new(known, peers, limits).0;
    let gateway = layer.gateway(&http::Request::new(()));
    let Stream { reader, updates } = node.stream();
    let reader = reader.with_remote(Some(gateway));
    Stream { reader, updates }
}

#[tokio::test(start_paused = true)]
async fn a_client_whose_room_is_at_a_node_that_cannot_be_reached_from_here_tries_another() {
    let directory = Says::only(unreachable_node());
    let node = Node::start(&directory);
    let mut stream = stream_of_gateway(&node, &directory).await;
    stream.read(0, Command::Attach(elsewhere()));
    for _ in 0..1_000 {
        stream.search().await;
        if let Err(end) = stream.received() {
            return assert_eq!(end, StreamEnd::RoomGone);
        }
    }
    panic!("it is tried here for ever");
}

#[tokio::test]
async fn an_attachment_to_a_node_that_has_just_died_ends_no_stream() {
    let directory = Says::first(unreachable_node(), Location::Nowhere);
    let node = Node::start(&directory);
    let mut stream = stream_of_gateway(&node, &directory).await;
    stream.reader.attach(node.seat().await).await;
    assert_eq!(stream.received(), Ok(vec![(0, "attached")]));
    stream.read(0, Command::Attach(elsewhere()));
    // It is found at the node, given back, and found nowhere.
    for _ in 0..2 {
        stream.search().await;
    }
    assert_eq!(stream.received(), Ok(vec![(1, "refused")]));
    assert!(!stream.reader.seats[&0].is_detached());
}

#[tokio::test]
async fn what_changes_hands_together_is_found_in_its_order() {
    // A takeover between the looks for a seat and for its participant.
    let [seat, other, participant] =
        [1, 2, 3].map(|id| Token::random(UnitId::from_bytes([id; 16])));
    let taken_over = Mutex::new(false);
    let look = |token: UnitToken| {
        let mut taken_over = taken_over.lock().expect("no panic");
        *taken_over |= token.subject == participant.subject;
        let is_found = *taken_over && token.subject != other.subject;
        ready(is_found.then(|| Err(owner_unreachable())))
    };
    let all = vec![(4, seat), (5, other), (6, participant)];
    // All at first, and when the last one is new.
    for first in [all.clone(), vec![(6, participant)]] {
        *taken_over.lock().expect("no panic") = false;
        let found = search(first, all.clone(), look).await;
        let handles: Vec<u32> = found.into_iter().map(|(handle, _)| handle).collect();
        assert_eq!(handles, [4, 6]);
    }
}

#[tokio::test]
async fn a_participant_waits_for_the_seats_that_its_client_attached_before() {
    let node = Node::start(&Says::only(Location::Unknown));
    let mut stream = node.stream();
    let seat = Token::random(RoomId::from_bytes([1; 16]));
    let participant = Token {
        subject: TournamentId::from_bytes([2; 16]),
        secret: seat.secret,
    };
    stream.read(0, Command::Attach(attachment(&seat)));
    stream.read(1, Command::Attach(attachment(&participant)));
    stream.read(2, Command::Attach(elsewhere()));
    let found = |handle| (handle, Err(ticket_unknown()));
    stream.reader.attach_parked(vec![found(1), found(2)]).await;
    assert_eq!(stream.received(), Ok(vec![(2, "refused")]));
    stream.reader.attach_parked(vec![found(0), found(1)]).await;
    let in_order = vec![(0, "refused"), (1, "refused")];
    assert_eq!(stream.received(), Ok(in_order));
}

#[tokio::test]
async fn a_participant_waits_for_a_seat_on_its_way_to_a_node_that_has_died() {
    let directory = Says::first(unreachable_node(), Location::Nowhere);
    let node = Node::start(&directory);
    let mut stream = stream_of_gateway(&node, &directory).await;
    let seat = Token::random(RoomId::from_bytes([1; 16]));
    let participant = Token {
        subject: TournamentId::from_bytes([2; 16]),
        secret: seat.secret,
    };
    stream.read(0, Command::Attach(attachment(&seat)));
    stream.search().await;
    stream.read(1, Command::Attach(attachment(&participant)));
    let found = || vec![(1, Err(ticket_unknown()))];
    stream.reader.attach_parked(found()).await;
    assert_eq!(stream.received(), Ok(vec![]), "its seat is not attached");
    // It is given back, and found nowhere.
    let mut received = Vec::new();
    while received.len() < 2 {
        stream.search().await;
        received.extend(stream.received().expect("open"));
    }
    assert_eq!(received, [(0, "refused"), (1, "refused")]);
}
