//! All seats of one stream: turns responses into the commands to send next, without a stream or a clock of its own. What a single
//! seat makes of an update is in `seat`; who carries the messages is `run`.

use prost::Message as _;

use crate::seat::SeatSession;
use crate::v1::{self, seat_update::Update};
use crate::{Agent, Outcome, PlayError, PlayOptions};

/// The protocol's limit of commands in a message.
const MAX_COMMANDS: usize = 1024;
/// Requests are cut at this size; servers take 64 KiB a message.
const MAX_REQUEST_BYTES: usize = 32 * 1024;
/// Upper bound of what an encoded command adds to its message besides its own length: a tag and a length.
const COMMAND_OVERHEAD_BYTES: usize = 6;

/// The seats of one call of `play`.
#[derive(Debug)]
pub(crate) struct Session<A> {
    seats: Vec<SeatSession<A>>,
    options: PlayOptions,
    /// The seat behind each handle of the present stream.
    by_handle: Vec<Option<usize>>,
    /// Handles whose seats may owe an answer, in the order in which they were told so.
    asked: Vec<u32>,
    unsettled: usize,
    progress: bool,
}

impl<A: Agent> Session<A> {
    pub(crate) fn new(seats: impl IntoIterator<Item = (String, A)>, options: &PlayOptions) -> Self {
        let seats: Vec<_> = seats
            .into_iter()
            .map(|(ticket, agent)| SeatSession::new(ticket, agent, options))
            .collect();
        Self {
            by_handle: vec![None; seats.len()],
            asked: Vec::new(),
            unsettled: seats.len(),
            seats,
            options: options.clone(),
            progress: false,
        }
    }

    /// What to say first on a new stream: an attachment of every seat whose game goes on.
    pub(crate) fn attach(&mut self) -> Vec<v1::PlayRequest> {
        self.by_handle.fill(None);
        self.asked.clear();
        let mut commands = Vec::with_capacity(self.unsettled);
        for (request_id, seat) in (1u32..).zip(&mut self.seats) {
            if !seat.is_settled() {
                commands.push(seat.attach(request_id, &self.options));
            }
        }
        pack(commands)
    }

    /// Takes one response, all of it, then has every seat say what it owes.
    pub(crate) fn receive(&mut self, response: v1::PlayResponse) -> Vec<v1::PlayRequest> {
        for update in response.updates {
            if let Some(what) = update.update {
                self.update(update.handle, what);
            }
        }
        let mut commands = Vec::with_capacity(self.asked.len());
        for &handle in &self.asked {
            if let Some(index) = self.by_handle[handle as usize] {
                self.seats[index].speak(handle, &mut commands);
            }
        }
        self.asked.clear();
        pack(commands)
    }

    /// The stream is gone: seats whose games are known to be over need no other.
    pub(crate) fn disconnected(&mut self) {
        for index in 0..self.seats.len() {
            self.settling(index, SeatSession::finish);
        }
    }

    /// Gives up all seats whose games go on.
    pub(crate) fn give_up(&mut self, error: &PlayError) {
        for index in 0..self.seats.len() {
            self.settling(index, |seat| seat.settle(Err(error.clone())));
        }
    }

    /// Whether every seat has its outcome.
    pub(crate) fn is_over(&self) -> bool {
        self.unsettled == 0
    }

    /// Whether anything new has happened since this was last asked.
    pub(crate) fn take_progress(&mut self) -> bool {
        std::mem::take(&mut self.progress)
    }

    /// The outcomes, in the order in which the seats were given.
    pub(crate) fn into_outcomes(self) -> Vec<Result<Outcome, PlayError>> {
        let outcomes = self.seats.into_iter().map(SeatSession::into_outcome);
        outcomes
            .map(|outcome| outcome.unwrap_or(Err(PlayError::EndingUnknown)))
            .collect()
    }

    fn update(&mut self, handle: u32, update: Update) {
        match update {
            Update::Attached(attached) => {
                let index = attached.request_id.wrapping_sub(1) as usize;
                let slot = self.by_handle.get_mut(handle as usize);
                if let (Some(seat), Some(slot)) = (self.seats.get_mut(index), slot) {
                    *slot = Some(index);
                    seat.attached(attached);
                }
            }
            Update::Refused(refused) if refused.request_id != 0 => {
                let index = refused.request_id.wrapping_sub(1) as usize;
                if index < self.seats.len() {
                    self.settling(index, |seat| seat.refused(refused));
                }
            }
            Update::Refused(refused) => {
                tracing::warn!(handle, reason = refused.reason, "{}", refused.message);
            }
            update => self.seat_update(handle, update),
        }
    }

    /// Updates of seats that are attached. A handle without a seat is no reason to stop the others.
    fn seat_update(&mut self, handle: u32, update: Update) {
        let Some(index) = self.by_handle.get(handle as usize).copied().flatten() else {
            tracing::warn!(handle, "update for a seat that is not attached");
            return;
        };
        let seat = &mut self.seats[index];
        match update {
            Update::Events(batch) => self.progress |= seat.events(batch),
            Update::Decision(request) => seat.decision(request),
            Update::Result(result) => self.progress |= seat.result(&result),
            Update::Detached(detached) => {
                self.by_handle[handle as usize] = None;
                self.settling(index, |seat| seat.detached(detached.reason()));
                return;
            }
            Update::Snapshot(_) | Update::Attached(_) | Update::Refused(_) => {}
        }
        if seat.has_to_speak() && self.asked.last() != Some(&handle) {
            self.asked.push(handle);
        }
    }

    /// Does what may settle a seat, and keeps count.
    fn settling(&mut self, index: usize, act: impl FnOnce(&mut SeatSession<A>)) {
        let seat = &mut self.seats[index];
        if !seat.is_settled() {
            act(seat);
            self.unsettled -= usize::from(seat.is_settled());
        }
    }
}

/// Commands in as few messages as the limits allow; nearly always one.
fn pack(commands: Vec<v1::SeatCommand>) -> Vec<v1::PlayRequest> {
    let mut requests: Vec<v1::PlayRequest> = Vec::new();
    let mut bytes = 0;
    for command in commands {
        let length = command.encoded_len() + COMMAND_OVERHEAD_BYTES;
        bytes += length;
        match requests.last_mut() {
            Some(last) if bytes <= MAX_REQUEST_BYTES && last.commands.len() < MAX_COMMANDS => {
                last.commands.push(command);
            }
            _ => {
                bytes = length;
                requests.push(v1::PlayRequest {
                    commands: vec![command],
                });
            }
        }
    }
    requests
}

#[cfg(test)]
#[path = "session_tests.rs"]
mod tests;
