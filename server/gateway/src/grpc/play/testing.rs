//! Streams of a node without connections, for tests.

use std::sync::Arc;

use chefshat_proto::v1;
use rayon::ThreadPoolBuildError;
use tokio_util::task::TaskTracker;

use super::reader::Reader;
use super::waiting::WaitingMemory;
use chefshat_admission::access::Caller;
use chefshat_hosting::room::{JoinRequest, Joined};
use chefshat_hosting::rooms::{NewRoom, Rooms};
use chefshat_hosting::tournaments::Tournaments;
use chefshat_room::ids::Token;
use chefshat_wire::outbox::{Outbox, OutboxStream};

pub(super) struct Node {
    pub(super) rooms: Arc<Rooms>,
    pub(super) tournaments: Arc<Tournaments>,
}

/// A stream of a client.
pub(super) struct Stream {
    pub(super) reader: Reader,
    pub(super) updates: OutboxStream,
}

impl Node {
    pub(super) fn of(rooms: Result<Arc<Rooms>, ThreadPoolBuildError>) -> Self {
        let rooms = rooms.expect("threads");
        let tournaments = Tournaments::new(Arc::clone(&rooms), TaskTracker::new());
        Self { rooms, tournaments }
    }

    /// A stream of a client that is connected here.
    pub(super) fn stream(&self) -> Stream {
        let (outbox, updates) = Outbox::new();
        let reader = Reader::new(
            &self.rooms,
            &self.tournaments,
            WaitingMemory::for_tests(),
            Caller::default(),
            &outbox,
            true,
        );
        Stream { reader, updates }
    }

    /// The ticket of a seat in a new room, which waits for others.
    pub(super) async fn seat(&self) -> v1::Attach {
        let created = self.rooms.create(NewRoom::for_tests());
        let room = created.await.expect("a room").handle;
        let joined = room.join(JoinRequest::for_tests("Ada"));
        let Joined { ticket, .. } = joined.await.expect("a free seat");
        attachment(&ticket)
    }
}

pub(super) fn attachment<T>(ticket: &Token<T>) -> v1::Attach {
    v1::Attach {
        ticket: ticket.to_text(),
        ..v1::Attach::default()
    }
}
