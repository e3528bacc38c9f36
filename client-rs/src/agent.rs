//! The trait of agents: one method that answers decisions, and optional hooks. `run` sends the
//! answers; `mask` reads the legal actions of a request.

use std::fmt;

use crate::{Outcome, v1};

/// The index of an action: of a bit in [`v1::DecisionRequest::action_mask`]. `Client::action_table`
/// returns their texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActionId(pub u32);

impl fmt::Display for ActionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Plays one seat.
///
/// The run loop calls all methods on its own task, one at a time and in the order of the game:
/// everything the seat received before a decision reaches `on_event` and `on_result` before
/// `decide`.
///
/// An agent that computes for more than about a millisecond should do so inside
/// [`tokio::task::block_in_place`] (on the multi-threaded runtime), so that the connection is
/// served meanwhile. Slow seats should not share a stream: each call of
/// [`Client::play`](crate::Client::play) opens its own stream on the same connection.
pub trait Agent: Send {
    /// Chooses an action, any of [`legal_actions`](crate::legal_actions). Called again with the
    /// same request if the answer was invalid and the decision is still open; then
    /// `invalid_attempts_left` is updated, and the times are those of the original request.
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId;

    /// Chooses an action as [`Agent::decide`] does, which it calls by default, or none: then the
    /// decision stays open until its time is over, and the server decides as the policy says. A
    /// substitute that takes the seat over for such decisions keeps it.
    fn try_decide(&mut self, request: &v1::DecisionRequest) -> Option<ActionId> {
        Some(self.decide(request))
    }

    /// Annotations to record with the decision; called after [`Agent::decide`]. See
    /// [`v1::Annotations`] for the limits.
    fn annotate(&mut self) -> Option<v1::Annotations> {
        None
    }

    /// Called when the seat is attached: at the start, and after every reconnection.
    fn on_attached(&mut self, _attached: &v1::Attached) {}

    /// Called for every event of the game, once and in order, also across lost connections, except
    /// for those before a snapshot.
    fn on_event(&mut self, _event: &v1::GameEvent) {}

    /// Called in place of events that the room of a long game no longer has: when the seat is attached
    /// late, or again after a long outage. The start of the game may be among them.
    fn on_snapshot(&mut self, _snapshot: &v1::Snapshot) {}

    /// Called when the game waits for a different seat among the others, or for none of them (no
    /// `seat`), and with none when a new connection begins. Only for seats that receive events at
    /// once.
    fn on_awaited(&mut self, _awaited: &v1::Awaited) {}

    /// Called with the result of an answer.
    fn on_result(&mut self, _result: &v1::AnswerResult) {}

    /// Called last, when the game is over.
    fn on_game_over(&mut self, _outcome: &Outcome) {}
}

/// Containers of agents are agents: `play(ticket, &mut agent)` leaves the agent with the caller,
/// and boxes allow agents of different types on one stream.
macro_rules! forward_agent {
    ($($generics:tt)*) => {
        impl $($generics)* {
            fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
                (**self).decide(request)
            }
            fn try_decide(&mut self, request: &v1::DecisionRequest) -> Option<ActionId> {
                (**self).try_decide(request)
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
            fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
                (**self).on_snapshot(snapshot);
            }
            fn on_awaited(&mut self, awaited: &v1::Awaited) {
                (**self).on_awaited(awaited);
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
