//! All seats of one stream: converts responses to the commands to send next, without a stream or a
//! clock. `seat` handles a seat's updates, `participant` those of a tournament participant, and
//! `run` carries the messages.

use std::collections::BTreeMap;

use prost::Message as _;

use crate::participant::Participant;
use crate::seat::SeatSession;
use crate::v1::{self, seat_update::Update};
use crate::{Agent, Outcome, PlayError, PlayOptions};

/// Maximum number of commands in a message.
const MAX_COMMANDS: usize = 1024;
/// Requests are split at this size; servers accept 64 KiB per message.
const MAX_REQUEST_BYTES: usize = 32 * 1024;
/// Upper bound of a command's overhead in its message: a tag and a length.
const COMMAND_OVERHEAD_BYTES: usize = 6;
/// Number of the first seat.
const FIRST_SEAT: u32 = 1;
/// Request id of a participant's attachment, far from those of seats.
const PARTICIPANT: u32 = u32::MAX;

/// The seats of one call of `play`.
pub(crate) struct Session<'a, A> {
    /// Seats in play, by number; the number of a seat is the request id of its attachments.
    seats: BTreeMap<u32, SeatSession<A>>,
    /// Results of the other seats, by number.
    outcomes: BTreeMap<u32, Result<Outcome, PlayError>>,
    next_seat: u32,
    participant: Option<Participant<'a, A>>,
    options: PlayOptions,
    /// The seat of each handle of the current stream.
    by_handle: BTreeMap<u32, u32>,
    /// Handles of seats that may have to send something, in order.
    asked: Vec<u32>,
    /// Handles of seats whose games have already been played, and whether they still have to be
    /// detached. Their updates are ignored.
    played: BTreeMap<u32, bool>,
    progress: bool,
}

impl<'a, A: Agent> Session<'a, A> {
    /// Creates a session of seats, each with its agent.
    pub(crate) fn new(seats: impl IntoIterator<Item = (String, A)>, options: &PlayOptions) -> Self {
        let mut session = Self {
            seats: BTreeMap::new(),
            outcomes: BTreeMap::new(),
            next_seat: FIRST_SEAT,
            participant: None,
            options: options.clone(),
            by_handle: BTreeMap::new(),
            asked: Vec::new(),
            played: BTreeMap::new(),
            progress: false,
        };
        for (ticket, agent) in seats {
            session.add(SeatSession::new(ticket, agent, options.entropy.draw()));
        }
        session
    }

    /// Creates a session of the seats of a tournament participant.
    pub(crate) fn of_participant(participant: Participant<'a, A>, options: &PlayOptions) -> Self {
        Self {
            participant: Some(participant),
            ..Self::new([], options)
        }
    }

    /// The first requests of a new stream: attach every seat in play. The seats of a participant
    /// come before the participant, each with its own ticket, to resume after the last event seen
    /// and to receive results of games that ended meanwhile. The server keeps these attachments.
    pub(crate) fn attach(&mut self) -> Vec<v1::PlayRequest> {
        self.by_handle.clear();
        self.asked.clear();
        self.played.clear();
        let seats = self.seats.iter_mut();
        let mut commands: Vec<_> = seats
            .map(|(&number, seat)| seat.attach(number, &self.options))
            .collect();
        if let Some(participant) = &mut self.participant
            && !participant.is_settled()
        {
            commands.push(participant.attach(PARTICIPANT, &self.options));
        }
        pack(commands)
    }

    /// Processes a response, then collects the commands of every seat.
    pub(crate) fn receive(&mut self, response: v1::PlayResponse) -> Vec<v1::PlayRequest> {
        for update in response.updates {
            if let Some(what) = update.update {
                self.update(update.handle, what);
            }
        }
        let mut commands = Vec::with_capacity(self.asked.len());
        for (handle, attached) in &mut self.played {
            if std::mem::take(attached) {
                commands.push(detach(*handle));
            }
        }
        for handle in self.asked.drain(..) {
            let number = self.by_handle.get(&handle);
            if let Some(seat) = number.and_then(|number| self.seats.get_mut(number)) {
                seat.speak(handle, &mut commands);
            }
        }
        pack(commands)
    }

    /// Handles the loss of a stream: seats that know the result of their game are settled.
    pub(crate) fn disconnected(&mut self) {
        self.settling_all(SeatSession::finish);
    }

    /// Gives up all seats in play.
    pub(crate) fn give_up(&mut self, error: &PlayError) {
        self.settling_all(|seat| seat.settle(Err(error.clone())));
        if let Some(participant) = &mut self.participant {
            participant.settle(Err(error.clone()));
        }
    }

    /// Whether every seat has its result and no further seats can follow.
    pub(crate) fn is_over(&self) -> bool {
        self.seats.is_empty()
            && self
                .participant
                .as_ref()
                .is_none_or(Participant::is_settled)
    }

    /// Whether there was progress since the last call.
    pub(crate) fn take_progress(&mut self) -> bool {
        std::mem::take(&mut self.progress)
    }

    /// The outcomes, in the order of the seats given.
    pub(crate) fn into_outcomes(self) -> Vec<Result<Outcome, PlayError>> {
        self.outcomes.into_values().collect()
    }

    /// The outcomes of a participant's games, in the order in which it was seated; an error if it
    /// could not take part to the end.
    pub(crate) fn into_played(self) -> Result<Vec<Outcome>, PlayError> {
        if let Some(participant) = self.participant {
            participant.into_end()?;
        }
        let outcomes = self.outcomes.into_values();
        Ok(outcomes.filter_map(Result::ok).collect())
    }

    fn add(&mut self, seat: SeatSession<A>) -> u32 {
        let number = self.next_seat;
        self.next_seat += 1;
        self.seats.insert(number, seat);
        number
    }

    fn update(&mut self, handle: u32, update: Update) {
        match update {
            Update::Attached(attached) => {
                if let Some(number) = self.seat_attached(&attached) {
                    // The newest handle of a seat replaces older ones, whose updates are ignored.
                    self.by_handle.retain(|_, other| *other != number);
                    self.by_handle.insert(handle, number);
                    if let Some(seat) = self.seats.get_mut(&number) {
                        seat.attached(attached);
                    }
                } else if self.has_played(&attached.game_id) {
                    self.played.insert(handle, true);
                }
            }
            Update::Entered(_) => {
                if let Some(participant) = &mut self.participant {
                    participant.entered(handle);
                }
            }
            Update::Refused(refused) if refused.request_id == PARTICIPANT => {
                if let Some(participant) = &mut self.participant {
                    participant.refused(refused);
                }
            }
            Update::Refused(refused) if refused.request_id != 0 => {
                let number = refused.request_id;
                // The server may have attached it meanwhile, with its participant.
                if !self.by_handle.values().any(|it| *it == number) {
                    self.settling(number, |seat| seat.refused(refused));
                }
            }
            Update::Refused(refused) => {
                tracing::warn!(handle, reason = refused.reason, "{}", refused.message);
            }
            update => self.seat_update(handle, update),
        }
    }

    /// Finds the seat of an attachment: one that was requested, or one of a tournament's game,
    /// which may be new.
    fn seat_attached(&mut self, attached: &v1::Attached) -> Option<u32> {
        if attached.request_id != 0 {
            let number = attached.request_id;
            return self.seats.contains_key(&number).then_some(number);
        }
        // It ended on a connection that was lost before the server could count it.
        if self.has_played(&attached.game_id) {
            return None;
        }
        let participant = self.participant.as_mut()?;
        let mut seats = self.seats.iter();
        let known = seats.find(|(_, seat)| seat.game_id() == attached.game_id);
        if let Some((&number, _)) = known {
            return Some(number);
        }
        let seat = participant.seated(attached);
        Some(self.add(seat))
    }

    /// Whether the result of a game is known.
    fn has_played(&self, game_id: &str) -> bool {
        let mut outcomes = self.outcomes.values().flatten();
        outcomes.any(|outcome| outcome.game_id == game_id)
    }

    /// Handles updates of attached seats. Ignores unknown handles.
    fn seat_update(&mut self, handle: u32, update: Update) {
        if self.played.contains_key(&handle) {
            return;
        }
        // The end of the stream follows; the seats are attached again on the next one.
        if matches!(&update, Update::Detached(it) if it.reason() == v1::DetachReason::ServerStopping)
        {
            return;
        }
        if let (Update::Detached(detached), Some(participant)) = (&update, &mut self.participant)
            && participant.has(handle)
        {
            participant.detached(detached.reason());
            return;
        }
        let number = self.by_handle.get(&handle).copied();
        let Some((number, seat)) =
            number.and_then(|number| Some((number, self.seats.get_mut(&number)?)))
        else {
            tracing::warn!(handle, "update for a seat that is not attached");
            return;
        };
        match update {
            Update::Events(batch) => self.progress |= seat.events(batch),
            Update::Awaited(awaited) => seat.awaited(&awaited),
            Update::Substitution(substitution) => seat.substitution(substitution),
            Update::Decision(request) => seat.decision(request),
            Update::Result(result) => self.progress |= seat.result(&result),
            Update::Detached(detached) => {
                self.by_handle.remove(&handle);
                self.settling(number, |seat| seat.detached(detached.reason()));
                return;
            }
            Update::Snapshot(snapshot) => seat.snapshot(&snapshot),
            Update::Attached(_) | Update::Refused(_) | Update::Entered(_) => {}
        }
        if seat.has_to_speak() && self.asked.last() != Some(&handle) {
            self.asked.push(handle);
        }
    }

    fn settling_all(&mut self, mut act: impl FnMut(&mut SeatSession<A>)) {
        let numbers: Vec<u32> = self.seats.keys().copied().collect();
        for number in numbers {
            self.settling(number, &mut act);
        }
    }

    /// Runs an action that may settle a seat. Keeps only the outcome of a settled seat, to free
    /// agents during a long tournament.
    fn settling(&mut self, number: u32, act: impl FnOnce(&mut SeatSession<A>)) {
        let Some(seat) = self.seats.get_mut(&number) else {
            return;
        };
        act(seat);
        if let Some(outcome) = seat.take_outcome() {
            if let (Some(_), Err(error)) = (&self.participant, &outcome) {
                tracing::warn!(game = seat.game_id(), %error, "a game of the tournament was not played to its end");
            }
            self.seats.remove(&number);
            self.outcomes.insert(number, outcome);
        }
    }
}

/// Detaches a seat from the stream.
fn detach(handle: u32) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(v1::seat_command::Command::Detach(v1::Detach {})),
    }
}

/// Packs commands into as few messages as the limits allow; nearly always one.
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
