//! A tournament participant on a stream: it enters, gets a seat in each of its games, and leaves
//! when the tournament is over. `seat` handles its seats, which share the stream with others (see
//! `session`).

use crate::seat::{SeatSession, attach};
use crate::v1;
use crate::{Error, PlayError, PlayOptions};

/// Creates the agent of a game in which the participant is seated.
type MakeAgent<'a, A> = Box<dyn FnMut(&v1::Attached) -> A + Send + 'a>;

/// One participant, from its ticket to the end of the tournament, across any number of connections.
pub(crate) struct Participant<'a, A> {
    ticket: String,
    make: MakeAgent<'a, A>,
    /// One contribution to the seed for all its games, as in the protocol.
    entropy: Vec<u8>,
    /// Its handle on the current stream.
    handle: Option<u32>,
    /// How its participation ended.
    end: Option<Result<(), PlayError>>,
}

impl<'a, A> Participant<'a, A> {
    pub(crate) fn new(
        ticket: String,
        make: impl FnMut(&v1::Attached) -> A + Send + 'a,
        options: &PlayOptions,
    ) -> Self {
        Self {
            ticket,
            make: Box::new(make),
            entropy: options.entropy.draw(),
            handle: None,
            end: None,
        }
    }

    /// Attaches on a new connection.
    pub(crate) fn attach(&mut self, request_id: u32, options: &PlayOptions) -> v1::SeatCommand {
        self.handle = None;
        attach(&self.ticket, request_id, 0, &self.entropy, options)
    }

    pub(crate) fn entered(&mut self, handle: u32) {
        self.handle = Some(handle);
    }

    /// Whether a handle of the current stream is the participant's.
    pub(crate) fn has(&self, handle: u32) -> bool {
        self.handle == Some(handle)
    }

    /// Creates a seat with its own agent.
    pub(crate) fn seated(&mut self, attached: &v1::Attached) -> SeatSession<A>
    where
        A: crate::Agent,
    {
        let agent = (self.make)(attached);
        SeatSession::new(attached.ticket.clone(), agent, self.entropy.clone())
    }

    pub(crate) fn refused(&mut self, refused: v1::Refused) {
        self.settle(Err(PlayError::Refused(Error::refused(refused))));
    }

    pub(crate) fn detached(&mut self, reason: v1::DetachReason) {
        self.handle = None;
        self.settle(match reason {
            v1::DetachReason::TournamentOver => Ok(()),
            v1::DetachReason::Superseded => Err(PlayError::Superseded),
            _ => Err(PlayError::Detached),
        });
    }

    /// Settles how the participation ended; the first call counts.
    pub(crate) fn settle(&mut self, end: Result<(), PlayError>) {
        self.end.get_or_insert(end);
    }

    pub(crate) fn is_settled(&self) -> bool {
        self.end.is_some()
    }

    pub(crate) fn into_end(self) -> Result<(), PlayError> {
        self.end.unwrap_or(Err(PlayError::Detached))
    }
}
