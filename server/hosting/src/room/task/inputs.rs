//! What the messages of a room's mailbox do. Their answers are released once the changes are
//! committed (`publishing`).

use std::sync::atomic::Ordering;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_record::convert::seat_number;
use chefshat_room::ids::{RoomToken, Token};
use chefshat_room::journal::SeatedParticipant;
use chefshat_room::{ConnectionId, Core, ExpressError, JoinError, MarkError, ReportOutcome};
use tokio::time::Instant;

use super::{AfterCommit, Room, answer, is_connection};
use crate::room::message::{
    AttachRequest, AttachedSeat, JoinRequest, Joined, Loss, MarkRequest, Message, NotAttached,
    Reply, ReportRefusal, RoomError, SeatAction,
};
use crate::room::subscriber::Subscriber;
use chefshat_admission::limits::{Key, NotStored};
use chefshat_wire::convert::{self, Deck};

impl Room {
    pub(super) fn receive(&mut self, message: Message) {
        match message {
            Message::Join(request, reply) => {
                let joined = self.join(*request);
                self.after_commit.push(AfterCommit::Join(reply, joined));
            }
            Message::Attach(request, reply) => self.attach(request, reply),
            Message::Lost(seat, connection, loss) => self.lost(seat, connection, loss),
            Message::Do(seat, connection, action, arrived) => {
                self.execute(seat, connection, action, arrived);
            }
            Message::Act((secret, charged), action, arrived, reply) => {
                match self.core.seat_of_ticket(&secret) {
                    Some(seat) => {
                        let acted = self.perform((seat, charged), action, arrived);
                        self.after_commit.push(AfterCommit::Acted(reply, acted));
                    }
                    None => answer(reply, Err(RoomError::SecretUnknown)),
                }
            }
            Message::Hint(secret, decision, id, reply) => {
                self.start_hint(&secret, decision, id, reply);
            }
            Message::Spectate(request, reply) => {
                self.after_commit
                    .push(AfterCommit::Spectate(request, reply));
            }
            Message::Describe(reply) => self.after_commit.push(AfterCommit::Describe(reply)),
            Message::HasTicket(secrets, reply) => {
                let seated = |secret: &[u8; 32]| self.core.seat_of_ticket(secret).is_some();
                answer(reply, secrets.iter().any(seated));
            }
            Message::SeatOf(secret, reply) => {
                let has_started = self.core.game().is_some();
                let seat = self.core.seat_of_ticket(&secret);
                answer(reply, seat.map(|seat| (seat, has_started)));
            }
            Message::HasStarted(reply) => answer(reply, self.core.game().is_some()),
            Message::Close(secret, client, reply) => {
                if self.core.header().owner.matches(&secret) {
                    let owner = Vec::from_iter([client].into_iter().chain(self.context.creator));
                    let connected = (self.connections.iter().flatten())
                        .filter_map(|subscriber| subscriber.connection())
                        .map(|connection| (connection.seat, connection.charged));
                    let seats = self.clients.seats_of(&self.core, connected, &owner);
                    self.core.close(self.now, seats);
                    self.after_commit.push(AfterCommit::Closed(reply));
                } else {
                    answer(reply, Err(RoomError::SecretUnknown));
                }
            }
            Message::Leave(secret, reply) => match self.core.seat_of_ticket(&secret) {
                Some(seat) => {
                    let left = self.core.leave(self.now, seat);
                    if left.is_ok()
                        && let Some(mut subscriber) = self.connections[seat.index()].take()
                    {
                        subscriber.detach(v1::DetachReason::Requested);
                    }
                    self.after_commit.push(AfterCommit::Left(reply, left));
                }
                None => answer(reply, Err(RoomError::SecretUnknown)),
            },
            Message::Report(secret, request, reply) => match self.report(&secret, *request) {
                Some(Ok(outcome)) => self
                    .after_commit
                    .push(AfterCommit::Reported(reply, outcome)),
                Some(Err(refusal)) => answer(reply, Err(RoomError::Refused(refusal))),
                None => answer(reply, Err(RoomError::SecretUnknown)),
            },
            Message::WatchTable(secret, reply) => match self.has_table(&secret) {
                true => self.after_commit.push(AfterCommit::WatchTable(reply)),
                false => answer(reply, Err(RoomError::SecretUnknown)),
            },
            Message::Mark(request, reply) => self.mark(*request, reply),
            Message::FollowMarkers(secret, position, reply) => {
                match self.core.header().owner.matches(&secret) {
                    true => self
                        .after_commit
                        .push(AfterCommit::FollowMarkers(position, reply)),
                    false => answer(reply, Err(RoomError::SecretUnknown)),
                }
            }
            Message::Retire(seat) => self.retire(seat),
            Message::Abort(reason) => self.core.abort(self.now, reason),
            Message::Suspend => self.suspended = true,
            Message::Wake => {}
        }
    }

    fn join(&mut self, request: JoinRequest) -> Result<Joined, JoinError> {
        let header = self.core.header();
        let ticket = match request.request_id {
            Some(id) => Token::of_request(header.room_id, &header.owner, &id),
            None => Token::random(header.room_id),
        };
        if let Some(seat) = self.core.seat_of_ticket(&ticket.secret) {
            return self.join_again(seat, ticket, &request);
        }
        let client = request.client.map(|client| client.key);
        self.clients.check(&self.core, client)?;
        let seat = self.core.join(
            self.now,
            request.seat,
            SeatedParticipant {
                name: request.name,
                name_fingerprint: request.name_fingerprint,
                kind: request.kind,
                ticket: ticket.hash(),
            },
        )?;
        self.clients.add(request.client, ticket.secret);
        Ok(Joined {
            seat,
            ticket,
            room: Box::new(convert::describe(&self.core)),
        })
    }

    /// Answers a repeated request for a seat.
    fn join_again(
        &self,
        seat: Seat,
        ticket: RoomToken,
        request: &JoinRequest,
    ) -> Result<Joined, JoinError> {
        let standing = self.core.standing(seat);
        let is_same = standing.participant.is_some_and(|seated| {
            seated.name == request.name
                && seated.name_fingerprint == request.name_fingerprint
                && seated.kind == request.kind
        });
        let own = seat_number(seat);
        let asked_for = request.seat.is_none_or(|wanted| wanted == own);
        match is_same && asked_for {
            true => Ok(Joined {
                seat,
                ticket,
                room: Box::new(convert::describe(&self.core)),
            }),
            false => Err(JoinError::RequestIdUsed),
        }
    }

    fn attach(&mut self, request: Box<AttachRequest>, reply: Reply<AttachedSeat, NotAttached>) {
        let Some(seat) = self.core.seat_of_ticket(&request.secret) else {
            return answer(reply, Err(RoomError::SecretUnknown));
        };
        if !request.outbox.is_open() {
            return answer(reply, Err(RoomError::Refused(NotAttached::StreamOver)));
        }
        if let Some(holder) = request.supersedes.kept_by(self.holder(seat)) {
            return answer(reply, Err(RoomError::Refused(NotAttached::HeldBy(holder))));
        }
        let connection = ConnectionId(self.context.connections.fetch_add(1, Ordering::Relaxed));
        let handed = self.handed();
        let (entropy, arrived) = (request.entropy.clone(), self.clock.at(request.arrived));
        self.core
            .attach(self.now, seat, connection, entropy, arrived, handed);
        if request.by_gateway {
            self.core.expect_delays(seat);
        }
        self.after_commit
            .push(AfterCommit::Attach(request, seat, connection, reply));
    }

    fn lost(&mut self, seat: Seat, connection: ConnectionId, loss: Loss) {
        if !self.is_current(seat, connection) {
            return;
        }
        let handed = self.handed();
        let lost = match loss {
            Loss::Gone | Loss::Detached => Core::lost,
            Loss::WithNode => Core::lost_with_node,
        };
        lost(&mut self.core, self.now, seat, connection, handed);
        if let Some(mut subscriber) = self.connections[seat.index()].take()
            && loss == Loss::Detached
        {
            subscriber.detach(v1::DetachReason::Requested);
        }
    }

    /// Gives up a seat whose participant has left the tournament or study.
    fn retire(&mut self, seat: Seat) {
        let handed = self.handed();
        self.core.retire(self.now, seat, handed);
        if let Some(mut subscriber) = self.connections[seat.index()].take() {
            subscriber.detach(v1::DetachReason::Requested);
        }
    }

    fn is_current(&self, seat: Seat, connection: ConnectionId) -> bool {
        self.connections[seat.index()]
            .as_ref()
            .is_some_and(|subscriber| is_connection(subscriber, connection))
    }

    /// Executes a command of a connection, unless a newer one has its seat. The result is released
    /// once the changes are committed.
    pub(super) fn execute(
        &mut self,
        seat: Seat,
        connection: ConnectionId,
        action: SeatAction,
        arrived: Instant,
    ) {
        let subscriber = self.connections[seat.index()].as_ref();
        let Some(current) = (subscriber.and_then(Subscriber::connection))
            .filter(|current| current.id == connection)
        else {
            return;
        };
        let by = (seat, current.charged.key);
        let release = match self.perform(by, action, arrived) {
            Ok(Some(result)) => AfterCommit::Result(seat, connection, result),
            Ok(None) => return,
            Err(error) => AfterCommit::Refuse(seat, connection, convert::express_refused(error)),
        };
        self.after_commit.push(release);
    }

    /// Executes a command of a seat. Its sender is charged for what is stored that the game does not
    /// need: a player uses up nobody else's share.
    fn perform(
        &mut self,
        (seat, charged): (Seat, Key),
        action: SeatAction,
        arrived: Instant,
    ) -> Result<Option<v1::AnswerResult>, ExpressError> {
        let context = &self.context;
        let may_store = |bytes: usize| context.may_store(charged, bytes);
        match action {
            SeatAction::Answer(mut answer) => {
                self.telemetry.answer_read(arrived);
                // The decision counts without them.
                answer.annotations_refused |= answer
                    .annotations
                    .take_if(|bytes| may_store(bytes.len()).is_err())
                    .is_some();
                let (decision_id, action) = (answer.decision_id, answer.action);
                let handed = self.connections[seat.index()]
                    .as_ref()
                    .and_then(|subscriber| subscriber.handed(decision_id));
                let arrived = self.clock.at(arrived);
                let answered = self.core.answer(self.now, seat, answer, arrived, handed);
                Ok(Some(convert::answer_result(decision_id, action, answered)))
            }
            SeatAction::Express(expression) => {
                may_store(expression.encoded.len()).map_err(|refused| match refused {
                    NotStored::DiskNearlyFull => ExpressError::DiskNearlyFull,
                    NotStored::TooFast(_) => ExpressError::TooFast,
                })?;
                let expressed = self.core.express(self.now, seat, expression);
                expressed.map(|()| None)
            }
            SeatAction::Resume => {
                self.core.resume(self.now, seat);
                Ok(None)
            }
        }
    }

    /// Whether a secret is that of the table's ticket.
    fn has_table(&self, secret: &[u8]) -> bool {
        (self.core.header().table).is_some_and(|table| table.matches(secret))
    }

    /// Takes a report from the physical table; `None` if the secret is not its ticket's.
    fn report(
        &mut self,
        secret: &[u8],
        request: v1::ReportRequest,
    ) -> Option<Result<ReportOutcome, ReportRefusal>> {
        if !self.has_table(secret) {
            return None;
        }
        let deck = Deck::of(&self.core.header().rules);
        let message = request.report.unwrap_or_default();
        let outcome = convert::reported_from_proto(&request.report_id, &message, deck)
            .map_err(ReportRefusal::Malformed)
            .and_then(|reported| {
                let outcome = self.core.report(self.now, reported);
                outcome.map_err(ReportRefusal::Refused)
            });
        if let (Ok(_), Some(table)) = (&outcome, &mut self.table) {
            table.keep_picture(&self.core, message);
        }
        Some(outcome)
    }

    /// Adds a marker, and answers once it is committed.
    fn mark(&mut self, request: MarkRequest, reply: Reply<v1::Marker, MarkError>) {
        if !self.core.header().owner.matches(&request.secret) {
            return answer(reply, Err(RoomError::SecretUnknown));
        }
        match self.core.mark(self.now, request.marked) {
            Ok(number) => self.after_commit.push(AfterCommit::Marked(reply, number)),
            Err(error) => answer(reply, Err(RoomError::Refused(error))),
        }
    }
}
