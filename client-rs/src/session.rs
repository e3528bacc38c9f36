//! The seats of agents on one stream: converts responses to the commands to send next, without a
//! stream or a clock, so every sequence of events can be tested as data. `tickets` attaches them,
//! `seat` handles a seat's updates, and `run` carries the messages.

use std::collections::BTreeMap;

use crate::seat::SeatSession;
use crate::tickets::{PARTICIPANT, TicketEvent, Tickets, pack};
use crate::v1;
use crate::{Agent, Outcome, PlayError, PlayOptions};

/// Creates the agent of a game in which a tournament participant is seated.
type MakeAgent<'a, A> = Box<dyn FnMut(&v1::Attached) -> A + Send + 'a>;

/// The seats of one call of `play`, or of one tournament participant.
pub(crate) struct Session<'a, A> {
    tickets: Tickets,
    /// Seats in play, by number of their ticket.
    seats: BTreeMap<u32, SeatSession<A>>,
    /// Results of the other seats, by number.
    outcomes: BTreeMap<u32, Result<Outcome, PlayError>>,
    /// Only for a participant.
    make: Option<MakeAgent<'a, A>>,
    /// The participant, once it has entered its tournament.
    entered: Option<v1::Entered>,
    /// How its participation ended.
    end: Option<Result<(), PlayError>>,
    /// Seats that may have to send something, in order.
    asked: Vec<u32>,
    progress: bool,
}

impl<'a, A: Agent> Session<'a, A> {
    /// Creates a session of seats, each with its agent.
    pub(crate) fn new(seats: impl IntoIterator<Item = (String, A)>, options: &PlayOptions) -> Self {
        let mut session = Self {
            tickets: Tickets::new(options.delivery, options.no_mask),
            seats: BTreeMap::new(),
            outcomes: BTreeMap::new(),
            make: None,
            entered: None,
            end: None,
            asked: Vec::new(),
            progress: false,
        };
        for (ticket, agent) in seats {
            let entropy = options.entropy.draw();
            let number = session.tickets.add(ticket, entropy.clone());
            session
                .seats
                .insert(number, SeatSession::new(agent, entropy));
        }
        session
    }

    /// Creates a session of the seats of a tournament participant. `make` creates the agent of each
    /// game in which it is seated.
    pub(crate) fn of_participant(
        ticket: String,
        make: impl FnMut(&v1::Attached) -> A + Send + 'a,
        options: &PlayOptions,
    ) -> Self {
        let mut session = Self {
            make: Some(Box::new(make)),
            ..Self::new([], options)
        };
        let entropy = options.entropy.draw();
        session.tickets.add_participant(ticket, entropy);
        session
    }

    /// The first requests of a new stream.
    pub(crate) fn attach(&mut self) -> Vec<v1::PlayRequest> {
        self.asked.clear();
        for seat in self.seats.values_mut() {
            seat.reconnect();
        }
        self.tickets.attach()
    }

    /// Processes a response, then collects the commands of every seat.
    pub(crate) fn receive(&mut self, response: v1::PlayResponse) -> Vec<v1::PlayRequest> {
        for update in response.updates {
            if let Some((number, event)) = self.tickets.take(update) {
                self.take_event(number, event);
            }
        }
        self.progress |= self.tickets.take_progress();
        let mut commands = self.tickets.detach();
        for number in self.asked.drain(..) {
            let handle = self.tickets.handle(number);
            if let Some((handle, seat)) = handle.zip(self.seats.get_mut(&number)) {
                seat.speak(handle, &mut commands);
            }
        }
        pack(commands)
    }

    /// Handles the loss of a stream: seats that know the result of their game are settled.
    pub(crate) fn disconnected(&mut self) {
        for number in self.tickets.disconnected() {
            if number == PARTICIPANT {
                self.end.get_or_insert(Ok(()));
            }
            self.settle(number, Ok(()));
        }
    }

    /// Gives up all seats in play.
    pub(crate) fn give_up(&mut self, error: &PlayError) {
        self.tickets.clear();
        while let Some(&number) = self.seats.keys().next() {
            self.settle(number, Err(error.clone()));
        }
        self.end.get_or_insert(Err(error.clone()));
    }

    /// Whether every seat has its result and no further seats can follow.
    pub(crate) fn is_over(&self) -> bool {
        self.tickets.is_empty()
    }

    /// Whether there was progress since the last call.
    pub(crate) fn take_progress(&mut self) -> bool {
        std::mem::take(&mut self.progress)
    }

    /// The participant, if it has entered its tournament.
    pub(crate) fn take_entered(&mut self) -> Option<v1::Entered> {
        self.entered.take()
    }

    /// The outcomes, in the order of the seats given.
    pub(crate) fn into_outcomes(self) -> Vec<Result<Outcome, PlayError>> {
        self.outcomes.into_values().collect()
    }

    /// The outcomes of a participant's games, in the order in which it was seated; an error if it
    /// could not take part to the end.
    pub(crate) fn into_played(self) -> Result<Vec<Outcome>, PlayError> {
        self.end.unwrap_or(Err(PlayError::Detached))?;
        let outcomes = self.outcomes.into_values();
        Ok(outcomes.filter_map(Result::ok).collect())
    }

    fn take_event(&mut self, number: u32, event: TicketEvent) {
        match event {
            TicketEvent::Entered(entered) => self.entered = Some(entered),
            TicketEvent::Attached(attached) => self.attached(number, attached),
            TicketEvent::Update(update) => {
                let Some(seat) = self.seats.get_mut(&number) else {
                    return;
                };
                self.progress |= seat.update(update);
                if seat.has_to_speak() && self.asked.last() != Some(&number) {
                    self.asked.push(number);
                }
            }
            TicketEvent::Over(_, end) => {
                if number == PARTICIPANT {
                    self.end.get_or_insert(end.clone());
                }
                self.settle(number, end);
            }
        }
    }

    /// Attaches a seat. One of a participant's game may be new, and gets its own agent.
    fn attached(&mut self, number: u32, attached: v1::Attached) {
        if let (false, Some(make)) = (self.seats.contains_key(&number), &mut self.make) {
            let seat = SeatSession::new(make(&attached), self.tickets.entropy(number));
            self.seats.insert(number, seat);
        }
        if let Some(seat) = self.seats.get_mut(&number) {
            seat.attached(attached);
        }
    }

    /// Settles a seat. Keeps only its outcome, to free agents during a long tournament.
    fn settle(&mut self, number: u32, end: Result<(), PlayError>) {
        let Some(seat) = self.seats.remove(&number) else {
            return;
        };
        if let (Some(_), Err(error)) = (&self.make, &end) {
            tracing::warn!(game = seat.game_id(), %error, "a game of the tournament was not played to its end");
        }
        self.outcomes.insert(number, seat.outcome(end));
    }
}

#[cfg(test)]
#[path = "session_tests.rs"]
mod tests;
