//! Attachments that come late: the newer stream of a client keeps its seats and participants.

use std::sync::Arc;

use chefshat_proto::v1::{self, seat_command::Command};
use futures::{FutureExt as _, StreamExt as _};
use tokio::time::Instant;
use tokio_util::task::TaskTracker;

use super::reader::Requests as _;
use super::testing::{Node, Stream, attachment};
use chefshat_admission::limits::Key;
use chefshat_hosting::config::ServerConfig;
use chefshat_hosting::room::Loss;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::tournaments::{Call, Entry};
use chefshat_room::ids::{RoomToken, TournamentToken};
use chefshat_room::journal::ParticipantKind;
use chefshat_store::MemoryStore;
use chefshat_wire::convert;
use chefshat_wire::encoded::Received;
use chefshat_wire::encoded::peer::{PlayInput, PlayRequest, play_input::Input};
use chefshat_wire::outbox::StreamEnd;

impl Node {
    /// A server without peers.
    fn single() -> Self {
        let store = Arc::new(MemoryStore::default());
        Self::of(Rooms::new(
            &ServerConfig::default(),
            store,
            TaskTracker::new(),
        ))
    }

    /// A stream of a client that is connected to another node.
    fn stream_by_gateway(&self) -> Stream {
        let Stream { reader, updates } = self.stream();
        let reader = reader.by_gateway();
        Stream { reader, updates }
    }

    /// The ticket of a participant of a tournament that has not started.
    async fn participant(&self) -> v1::Attach {
        let settings = v1::TournamentSettings {
            format: v1::TournamentFormat::Swiss.into(),
            ..v1::TournamentSettings::default()
        };
        let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
        let created = (self.tournaments).create("Coppa", plan, None, Key::Local);
        let (tournament, _owner) = created.await.expect("a tournament");
        let entry = Entry {
            name: "Ada".into(),
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            max_games: 1,
            stateless: true,
            at_table: false,
            request_id: None,
        };
        let joined = tournament.join(entry).await;
        let (_participant, ticket) = joined.expect("it is open");
        attachment(&ticket)
    }
}

impl Stream {
    /// The next call of the tournament to the participant of this stream.
    async fn called(&mut self) -> (u32, Call) {
        self.reader.called.recv().await.expect("the stream is open")
    }

    /// The seats and participants about which the gateway is asked.
    fn questions(&mut self) -> Vec<u32> {
        let updates = self.updates.next().now_or_never().flatten();
        let updates = updates.expect("updates wait").expect("no error");
        let contested = (updates.received()).filter(|(_, it)| *it == Received::Contested);
        contested.map(|(handle, _)| handle).collect()
    }

    /// What another node sends for this handle.
    async fn receive(&mut self, handle: u32, command: Command) {
        let command = v1::SeatCommand {
            handle,
            command: Some(command),
        };
        self.read_input(Input::Command(command)).await;
    }

    async fn read_input(&mut self, input: Input) {
        let request = PlayRequest {
            inputs: vec![PlayInput {
                input: Some(input),
                elapsed_us: None,
            }],
            first_assigned_handle: 0,
            answers_contested: self.reader.by_gateway,
            ..PlayRequest::default()
        };
        let executed = request.execute(&mut self.reader, Instant::now());
        executed.await.expect("a valid message");
    }
}

#[tokio::test]
async fn a_stream_whose_client_has_gone_attaches_nothing() {
    let server = Node::single();
    for attach in [server.participant().await, server.seat().await] {
        let mut newer = server.stream();
        newer.reader.attach(attach.clone()).await;
        assert!(newer.reader.has_attached());
        // The messages of a lost connection may be read after those of the next.
        let mut older = server.stream();
        drop(older.updates);
        older.reader.attach(attach).await;
        assert!(!older.reader.has_attached(), "it would supersede the newer");
    }
}

#[tokio::test]
async fn a_late_attachment_through_another_node_takes_no_seat_from_a_newer_stream() {
    let server = Node::single();
    let attach = server.seat().await;
    let mut newer = server.stream();
    newer.reader.attach(attach.clone()).await;
    let mut late = server.stream_by_gateway();
    late.receive(3, Command::Attach(attach.clone())).await;
    assert_eq!(late.questions(), [3]);
    assert!(late.reader.seats.is_empty());
    assert!(!newer.reader.seats[&0].is_detached());
    // The gateway never answers, because its client has left.
    drop(late);
    assert!(!newer.reader.seats[&0].is_detached());

    // A client that has lost a stream of which this node does not know yet that it is lost.
    let mut next = server.stream_by_gateway();
    next.receive(5, Command::Attach(attach.clone())).await;
    next.receive(5, Command::Detach(v1::Detach {})).await;
    assert_eq!(next.questions(), [5]);
    // Meanwhile it attaches on yet another one.
    let mut newest = server.stream();
    newest.reader.attach(attach.clone()).await;
    assert!(newer.reader.seats[&0].is_detached());
    next.read_input(Input::StillOpen(5)).await;
    assert_eq!(next.questions(), [5], "about the newest stream");
    assert!(!newest.reader.seats[&0].is_detached());
    next.read_input(Input::StillOpen(5)).await;
    assert!(newest.reader.seats[&0].is_detached());
    assert!(
        !next.reader.has_attached(),
        "it was attached, and detached as its client asked"
    );
}

#[tokio::test]
async fn a_gateway_that_answers_no_questions_is_asked_none() {
    let server = Node::single();
    let attach = server.seat().await;
    let mut lost = server.stream();
    lost.reader.attach(attach.clone()).await;
    let mut next = server.stream_by_gateway();
    let command = v1::SeatCommand {
        handle: 3,
        command: Some(Command::Attach(attach)),
    };
    let input = PlayInput {
        input: Some(Input::Command(command)),
        elapsed_us: None,
    };
    let request = PlayRequest {
        inputs: vec![input],
        ..PlayRequest::default()
    };
    let executed = request.execute(&mut next.reader, Instant::now());
    executed.await.expect("a valid message");
    assert!(next.reader.seats.contains_key(&3));
    assert!(lost.reader.seats[&0].is_detached());
}

#[tokio::test]
async fn a_seat_whose_room_stops_while_the_gateway_is_asked_is_attached_on_another_stream() {
    let server = Node::single();
    let attach = server.seat().await;
    let mut lost = server.stream();
    lost.reader.attach(attach.clone()).await;
    let mut next = server.stream_by_gateway();
    next.receive(3, Command::Attach(attach.clone())).await;
    assert_eq!(next.questions(), [3]);
    // As a node does whose lease has ended. It, or another one, resumes the room later.
    let ticket = RoomToken::parse(&attach.ticket).expect("a ticket");
    server.rooms.stop_unit(ticket.subject.unit()).await;
    next.read_input(Input::StillOpen(3)).await;
    // An agent gives up a seat that is refused, and its game would wait for it.
    let end = next.updates.next().now_or_never().flatten();
    assert_eq!(end.expect("an end").err(), Some(StreamEnd::RoomGone));
}

#[tokio::test]
async fn a_late_attachment_through_another_node_takes_no_participant_from_a_newer_stream() {
    let server = Node::single();
    let attach = server.participant().await;
    let mut newer = server.stream_by_gateway();
    newer.receive(0, Command::Attach(attach.clone())).await;
    let mut late = server.stream_by_gateway();
    late.receive(0, Command::Attach(attach.clone())).await;
    let (handle, call) = late.called().await;
    assert!(matches!(call, Call::HeldBy(_)), "{call:?}");
    late.reader.follow_call(handle, call).await;
    assert_eq!(late.questions(), [0]);
    assert!(newer.called().now_or_never().is_none());

    late.read_input(Input::StillOpen(0)).await;
    assert_eq!(newer.called().await, (0, Call::Superseded));
}

#[tokio::test]
async fn a_participant_whose_tournament_stops_while_the_gateway_is_asked_enters_on_another_stream()
{
    let server = Node::single();
    let attach = server.participant().await;
    let mut lost = server.stream();
    lost.reader.attach(attach.clone()).await;
    let mut next = server.stream_by_gateway();
    next.receive(3, Command::Attach(attach.clone())).await;
    let (handle, call) = next.called().await;
    next.reader.follow_call(handle, call).await;
    assert_eq!(next.questions(), [3]);
    let ticket = TournamentToken::parse(&attach.ticket).expect("a ticket");
    server.tournaments.stop_one(ticket.subject.unit()).await;
    next.read_input(Input::StillOpen(3)).await;
    let end = next.updates.next().now_or_never().flatten();
    assert_eq!(end.expect("an end").err(), Some(StreamEnd::RoomGone));
}

#[tokio::test]
async fn only_a_gateway_that_announces_it_and_has_not_said_it_is_lost_with_its_stream() {
    let server = Node::single();
    for (announces_left, left, loss) in [
        // An older version.
        (false, false, Loss::Gone),
        (true, false, Loss::WithNode),
        (true, true, Loss::Gone),
    ] {
        let mut stream = server.stream_by_gateway();
        for (announces_left, left) in [(announces_left, false), (false, left)] {
            let request = PlayRequest {
                announces_left,
                left,
                ..PlayRequest::default()
            };
            let executed = request.execute(&mut stream.reader, Instant::now());
            executed.await.expect("a valid message");
        }
        assert_eq!(stream.reader.loss, loss, "{announces_left} {left}");
    }
}
