//! What a room does with a message: the core applies it, and what is to be said is put aside until it is kept.

use std::sync::atomic::Ordering;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::oneshot;
use tokio::time::Instant;

use super::Task;
use super::outputs::{Release, answer};
use crate::convert;
use crate::grpc::status::{Refusal, refused};
use crate::room::handle::{Acted, AttachRequest, JoinRequest, Joined, Message, SeatAction};
use chefshat_room::ids::Token;
use chefshat_room::journal::{AbortReason, SeatedParticipant};
use chefshat_room::{AnswerInput, Answered, ConnectionId, JoinError};

impl Task {
    pub(super) fn receive(&mut self, message: Message) {
        match message {
            Message::Join(request, reply) => {
                let joined = self.join(*request);
                self.releases.push(Release::Join(reply, joined));
            }
            Message::Attach(request, reply) => self.attach(request, reply),
            Message::Lost(seat, connection, reason) => self.lost(seat, connection, reason),
            Message::Do(seat, connection, action, arrived) => {
                if self.is_current(seat, connection) {
                    match self.perform(seat, action, arrived) {
                        Ok(Some(result)) => {
                            self.releases
                                .push(Release::Result(seat, connection, result));
                        }
                        Ok(None) => {}
                        Err(error) => {
                            let refused = refused(0, &Refusal::from(error).0);
                            self.releases
                                .push(Release::Refuse(seat, connection, refused));
                        }
                    }
                }
            }
            Message::Act(secret, action, arrived, reply) => {
                match self.core.seat_of_ticket(&secret) {
                    Some(seat) => {
                        let acted = self.perform(seat, action, arrived);
                        self.releases.push(Release::Acted(reply, acted));
                    }
                    None => answer(reply, None),
                }
            }
            Message::Spectate(request, reply) => {
                self.releases.push(Release::Spectate(request, reply));
            }
            Message::Describe(reply) => self.releases.push(Release::Describe(reply)),
            Message::Close(secret, reply) => {
                if self.core.header().owner.matches(&secret) {
                    self.core.abort(self.now, AbortReason::Closed);
                    self.releases.push(Release::Closed(reply));
                } else {
                    answer(reply, None);
                }
            }
            Message::Leave(secret, reply) => match self.core.seat_of_ticket(&secret) {
                Some(seat) => {
                    let left = self.core.leave(self.now, seat);
                    if left.is_ok()
                        && let Some(mut attachment) = self.attachments[seat.index()].take()
                    {
                        attachment.detach(v1::DetachReason::Requested);
                    }
                    self.releases.push(Release::Left(reply, left));
                }
                None => answer(reply, None),
            },
            Message::Abort(reason) => self.core.abort(self.now, reason),
            Message::PutDown => self.put_down = true,
            Message::Space => {}
        }
    }

    fn join(&mut self, request: JoinRequest) -> Result<Joined, JoinError> {
        let ticket = Token::random(self.core.header().room_id);
        let seat = self.core.join(
            self.now,
            request.seat,
            SeatedParticipant {
                name: request.name,
                kind: request.kind,
                ticket: ticket.hash(),
            },
        )?;
        Ok(Joined {
            seat,
            ticket,
            room: Box::new(convert::describe(&self.core)),
        })
    }

    fn attach(
        &mut self,
        request: Box<AttachRequest>,
        reply: oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ) {
        let Some(seat) = self.core.seat_of_ticket(&request.secret) else {
            answer(reply, None);
            return;
        };
        let connection = ConnectionId(self.context.connections.fetch_add(1, Ordering::Relaxed));
        let handed = self.handed();
        let (entropy, arrived) = (request.entropy.clone(), self.clock.at(request.arrived));
        self.core
            .attach(self.now, seat, connection, entropy, arrived, handed);
        self.releases
            .push(Release::Attach(request, seat, connection, reply));
    }

    fn lost(&mut self, seat: Seat, connection: ConnectionId, reason: Option<v1::DetachReason>) {
        if !self.is_current(seat, connection) {
            return;
        }
        let handed = self.handed();
        self.core.lost(self.now, seat, connection, handed);
        if let Some(mut attachment) = self.attachments[seat.index()].take()
            && let Some(reason) = reason
        {
            attachment.detach(reason);
        }
    }

    pub(super) fn is_current(&self, seat: Seat, connection: ConnectionId) -> bool {
        self.attachments[seat.index()]
            .as_ref()
            .is_some_and(|attachment| attachment.connection() == connection)
    }

    fn perform(&mut self, seat: Seat, action: SeatAction, arrived: Instant) -> Acted {
        match action {
            SeatAction::Answer {
                decision_id,
                action,
                annotations,
                annotations_refused,
            } => {
                let handed = self.attachments[seat.index()]
                    .as_ref()
                    .and_then(|attachment| attachment.handed(decision_id));
                let answered: Answered = self.core.answer(
                    self.now,
                    AnswerInput {
                        seat,
                        decision_id,
                        action,
                        annotations,
                        annotations_refused,
                        arrived: self.clock.at(arrived),
                        handed,
                    },
                );
                Ok(Some(convert::answer_result(decision_id, action, answered)))
            }
            SeatAction::Express {
                record_only,
                expression,
            } => self
                .core
                .express(self.now, seat, record_only, expression)
                .map(|()| None),
            SeatAction::Resume => {
                self.core.resume(self.now, seat);
                Ok(None)
            }
        }
    }
}
