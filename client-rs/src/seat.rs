//! What an agent does on one seat: updates go in, commands come out. No ticket (see `tickets`), no
//! stream, no clock and no other seats (see `session`).

use prost::Message as _;

use crate::tickets::command;
use crate::v1::{self, game_event, seat_command::Command, seat_update::Update};
use crate::{Agent, Ending, Outcome, PlayError};

/// Larger annotations are not sent: the server drops them above 4 KiB, and a message of 64 KiB
/// would end the stream.
const MAX_ANNOTATIONS_BYTES: usize = 16 * 1024;

/// What a seat has to send for its open decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owed {
    /// Nothing: there is no decision, or the answer has been sent.
    Nothing,
    /// A new decision of the agent.
    Decision,
    /// The previous answer, whose acknowledgement may have been lost.
    SameAnswer,
}

/// One seat, from its first attachment to its outcome, across any number of connections.
#[derive(Debug)]
pub(crate) struct SeatSession<A> {
    agent: A,
    entropy: Vec<u8>,
    room_id: String,
    game_id: String,
    seat: u32,
    /// Events below this number happened before the seat was last attached.
    live_from: u64,
    open: Option<v1::DecisionRequest>,
    /// The last answer, until it is acknowledged.
    answered: Option<v1::Answer>,
    owed: Owed,
    /// A substitute plays for the attached seat.
    substituted: bool,
    /// The agent chose no action for the last decision.
    left_open: bool,
    /// The agent knows of somebody whom the game waits for.
    awaits: bool,
    answers: u64,
    ending: Option<Ending>,
}

impl<A: Agent> SeatSession<A> {
    pub(crate) fn new(agent: A, entropy: Vec<u8>) -> Self {
        Self {
            agent,
            entropy,
            room_id: String::new(),
            game_id: String::new(),
            seat: 0,
            live_from: 1,
            open: None,
            answered: None,
            owed: Owed::Nothing,
            substituted: false,
            left_open: false,
            awaits: false,
            answers: 0,
            ending: None,
        }
    }

    /// Prepares for a new connection. An unacknowledged answer is stored: the server requests its
    /// decision again if the answer never arrived.
    pub(crate) fn reconnect(&mut self) {
        self.open = None;
        self.owed = Owed::Nothing;
        self.substituted = false;
    }

    /// The game it was last attached to; empty before the first attachment.
    pub(crate) fn game_id(&self) -> &str {
        &self.game_id
    }

    pub(crate) fn attached(&mut self, attached: v1::Attached) {
        self.agent.on_attached(&attached);
        // Unless the server says so again, the game does not wait for whom it waited for before.
        if self.awaits {
            self.awaited(&v1::Awaited::default());
        }
        self.live_from = attached.next_sequence;
        self.seat = attached.seat;
        self.room_id = attached.room_id;
        self.game_id = attached.game_id;
    }

    /// Handles an update. Returns whether it closed or changed the open decision.
    pub(crate) fn update(&mut self, update: Update) -> bool {
        match update {
            Update::Events(batch) => {
                for event in batch.events {
                    self.agent.on_event(&event);
                    self.follow(event);
                }
            }
            Update::Snapshot(snapshot) => self.agent.on_snapshot(&snapshot),
            Update::Awaited(awaited) => self.awaited(&awaited),
            // Whether a substitute plays for the seat, where no event says so.
            Update::Substitution(substitution) => self.substituted = substitution.active,
            Update::Decision(request) => self.decision(request),
            Update::Result(result) => return self.result(&result),
            Update::Refused(refused) => {
                let (seat, reason) = (self.seat, refused.reason);
                tracing::warn!(seat, reason, "{}", refused.message);
            }
            Update::Attached(_) | Update::Detached(_) | Update::Entered(_) => {}
        }
        false
    }

    /// Passes on whom the game waits for.
    fn awaited(&mut self, awaited: &v1::Awaited) {
        self.awaits = awaited.seat.is_some();
        self.agent.on_awaited(awaited);
    }

    /// Updates the state after an event. Attaching ends earlier substitutions.
    fn follow(&mut self, event: v1::GameEvent) {
        match event.kind {
            Some(game_event::Kind::Substituted(it)) if it.seat == self.seat => {
                self.substituted = event.sequence >= self.live_from;
            }
            Some(game_event::Kind::Returned(it)) if it.seat == self.seat => {
                self.substituted = false;
            }
            Some(game_event::Kind::GameEnded(end)) => self.ending = Some(Ending::Finished(*end)),
            Some(game_event::Kind::GameAborted(end)) => self.ending = Some(Ending::Aborted(*end)),
            _ => {}
        }
    }

    fn decision(&mut self, request: v1::DecisionRequest) {
        let answered = self.answered.as_ref().map(|answer| answer.decision_id);
        self.owed = if answered == Some(request.decision_id) {
            Owed::SameAnswer
        } else {
            self.answered = None;
            Owed::Decision
        };
        self.open = Some(request);
    }

    /// Processes the result of an answer. Returns whether it closed or changed the open decision.
    fn result(&mut self, result: &v1::AnswerResult) -> bool {
        self.agent.on_result(result);
        let answered = self.answered.as_ref();
        let ours = answered
            .is_some_and(|it| it.decision_id == result.decision_id && it.action == result.action);
        if !ours {
            return false;
        }
        self.answered = None;
        self.owed = Owed::Nothing;
        let exhausted = result.invalid_attempts_left == Some(0);
        match (result.status(), &mut self.open) {
            (v1::AnswerStatus::Invalid, Some(request)) if !exhausted => {
                request.invalid_attempts_left = result.invalid_attempts_left;
                self.owed = Owed::Decision;
            }
            _ => self.open = None,
        }
        true
    }

    /// The outcome of a seat that is settled.
    pub(crate) fn outcome(mut self, end: Result<(), PlayError>) -> Result<Outcome, PlayError> {
        end?;
        let outcome = Outcome {
            room_id: self.room_id,
            game_id: self.game_id,
            seat: self.seat,
            ending: self.ending.ok_or(PlayError::EndingUnknown)?,
            entropy: self.entropy,
            answers: self.answers,
        };
        self.agent.on_game_over(&outcome);
        Ok(outcome)
    }

    /// Whether `speak` would add commands.
    pub(crate) fn has_to_speak(&self) -> bool {
        self.substituted || self.owed != Owed::Nothing
    }

    /// Adds the commands to send now; calls the agent if necessary.
    pub(crate) fn speak(&mut self, handle: u32, out: &mut Vec<v1::SeatCommand>) {
        // Who leaves decisions open leaves them to the substitute.
        if std::mem::take(&mut self.substituted) && !self.left_open {
            out.push(command(handle, Command::Resume(v1::ResumeSeat {})));
        }
        let owed = std::mem::replace(&mut self.owed, Owed::Nothing);
        match (owed, &self.open) {
            (Owed::Decision, Some(request)) => {
                let action = self.agent.try_decide(request);
                self.left_open = action.is_none();
                let Some(action) = action else {
                    return;
                };
                let annotations = self.agent.annotate().filter(|annotations| {
                    let fits = annotations.encoded_len() <= MAX_ANNOTATIONS_BYTES;
                    if !fits {
                        tracing::warn!(seat = self.seat, "annotations too large to be sent");
                    }
                    fits
                });
                self.answers += 1;
                self.answered = Some(v1::Answer {
                    decision_id: request.decision_id,
                    action: action.0,
                    annotations,
                });
            }
            (Owed::SameAnswer, Some(_)) => {}
            _ => return,
        }
        if let Some(answer) = &self.answered {
            out.push(command(handle, Command::Answer(answer.clone())));
        }
    }
}
