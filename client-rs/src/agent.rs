//! What an agent is: one method that answers a decision, and hooks for what it may want to know besides. How its answers reach the
//! server is not here (see `run`), nor how legal actions are read from a request (see `mask`).

use std::fmt;

use crate::{Outcome, v1};

/// The index of an action: of a bit in [`v1::DecisionRequest::action_mask`]. `Client::action_table` gives the text of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActionId(pub u32);

impl fmt::Display for ActionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Plays one seat.
///
/// The run loop calls every method on its own task, one at a time, in the order of the game: what a seat is told before a decision
/// reaches `on_event` and `on_result` before `decide` is called for it.
///
/// An agent that thinks for more than about a millisecond should wrap its thinking in [`tokio::task::block_in_place`] (on the
/// multi-threaded runtime), so that the connection is served meanwhile. Seats that think for long should not share a stream: each call
/// of [`Client::play`](crate::Client::play) has one of its own, on the same connection.
pub trait Agent: Send {
    /// Chooses an action, any of [`legal_actions`](crate::legal_actions). Called again with the same request if the server refused
    /// the answer and the decision is still open; `invalid_attempts_left` is then brought up to date, the times are as first told.
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId;

    /// What to record with the decision just made; asked right after [`Agent::decide`]. See [`v1::Annotations`] for the limits.
    fn annotate(&mut self) -> Option<v1::Annotations> {
        None
    }

    /// The seat is attached: to begin with, and again after every lost connection.
    fn on_attached(&mut self, _attached: &v1::Attached) {}

    /// Something happened in the game. Every event comes once and in order, lost connections or not.
    fn on_event(&mut self, _event: &v1::GameEvent) {}

    /// The server's word on an answer.
    fn on_result(&mut self, _result: &v1::AnswerResult) {}

    /// The game is over; the last call.
    fn on_game_over(&mut self, _outcome: &Outcome) {}
}

/// What holds an agent plays as the agent does: `play(ticket, &mut agent)` gives the agent back, boxes let agents of different types
/// share a stream.
macro_rules! forward_agent {
    ($($generics:tt)*) => {
        impl $($generics)* {
            fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
                (**self).decide(request)
            }
            fn annotate(&mut self) -> Option<v1::Annotations> {
                (**self).annotate()
            }
            fn on_attached(&mut self, attached: &v1::Attached) {
                (**self).on_attached(attached);
            }
            fn on_event(&mut self, event: &v1::GameEvent) {
                (**self).on_event(event);
            }
            fn on_result(&mut self, result: &v1::AnswerResult) {
                (**self).on_result(result);
            }
            fn on_game_over(&mut self, outcome: &Outcome) {
                (**self).on_game_over(outcome);
            }
        }
    };
}

forward_agent!(<A: Agent + ?Sized> Agent for &mut A);
forward_agent!(<A: Agent + ?Sized> Agent for Box<A>);
