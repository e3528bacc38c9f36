//! The protocol for one seat: updates go in, commands come out. No stream, no clock and no other
//! seats (see `session`), so every sequence of events can be tested as data.

use prost::Message as _;

use crate::v1::{self, game_event, seat_command::Command};
use crate::{Agent, Ending, Outcome, PlayError, PlayOptions};

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

/// One seat, from its ticket to its outcome, across any number of connections.
#[derive(Debug)]
pub(crate) struct SeatSession<A> {
    agent: A,
    ticket: String,
    entropy: Vec<u8>,
    room_id: String,
    game_id: String,
    seat: u32,
    /// Number of the next event.
    next_event: u64,
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
    outcome: Option<Result<Outcome, PlayError>>,
}

impl<A: Agent> SeatSession<A> {
    pub(crate) fn new(ticket: String, agent: A, entropy: Vec<u8>) -> Self {
        Self {
            agent,
            ticket,
            entropy,
            room_id: String::new(),
            game_id: String::new(),
            seat: 0,
            next_event: 1,
            live_from: 1,
            open: None,
            answered: None,
            owed: Owed::Nothing,
            substituted: false,
            left_open: false,
            awaits: false,
            answers: 0,
            ending: None,
            outcome: None,
        }
    }

    /// Attaches on a new connection. An unacknowledged answer is stored: the server requests its
    /// decision again if the answer never arrived.
    pub(crate) fn attach(&mut self, request_id: u32, options: &PlayOptions) -> v1::SeatCommand {
        self.open = None;
        self.owed = Owed::Nothing;
        self.substituted = false;
        attach(
            &self.ticket,
            request_id,
            self.next_event,
            &self.entropy,
            options,
        )
    }

    pub(crate) fn is_settled(&self) -> bool {
        self.outcome.is_some()
    }

    pub(crate) fn take_outcome(&mut self) -> Option<Result<Outcome, PlayError>> {
        self.outcome.take()
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

    /// Passes new events to the agent. Returns whether there were any.
    pub(crate) fn events(&mut self, batch: v1::EventBatch) -> bool {
        let mut any = false;
        for event in batch.events {
            if event.sequence < self.next_event {
                continue;
            }
            if event.sequence > self.next_event {
                tracing::warn!(
                    seat = self.seat,
                    expected = self.next_event,
                    got = event.sequence,
                    "events are missing"
                );
            }
            self.next_event = event.sequence.saturating_add(1);
            any = true;
            self.agent.on_event(&event);
            self.follow(event);
        }
        any
    }

    /// Goes on after a snapshot, which stands for the events before.
    pub(crate) fn snapshot(&mut self, snapshot: &v1::Snapshot) {
        self.next_event = self.next_event.max(snapshot.next_sequence);
    }

    /// Passes on whom the game waits for.
    pub(crate) fn awaited(&mut self, awaited: &v1::Awaited) {
        self.awaits = awaited.seat.is_some();
        self.agent.on_awaited(awaited);
    }

    /// Whether a substitute plays for the seat, where no event says so.
    pub(crate) fn substitution(&mut self, substitution: v1::Substitution) {
        self.substituted = substitution.active;
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

    pub(crate) fn decision(&mut self, request: v1::DecisionRequest) {
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
    pub(crate) fn result(&mut self, result: &v1::AnswerResult) -> bool {
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

    pub(crate) fn refused(&mut self, refused: v1::Refused) {
        self.settle(Err(PlayError::Refused(crate::Error::refused(refused))));
    }

    pub(crate) fn detached(&mut self, reason: v1::DetachReason) {
        match (reason, self.ending.is_some()) {
            (_, true) => self.finish(),
            (v1::DetachReason::GameOver, false) => self.settle(Err(PlayError::EndingUnknown)),
            (v1::DetachReason::Superseded, false) => self.settle(Err(PlayError::Superseded)),
            _ => self.settle(Err(PlayError::Detached)),
        }
    }

    /// Settles the seat if the result of its game is known.
    pub(crate) fn finish(&mut self) {
        if let Some(ending) = self.ending.take() {
            let outcome = Outcome {
                room_id: std::mem::take(&mut self.room_id),
                game_id: std::mem::take(&mut self.game_id),
                seat: self.seat,
                ending,
                entropy: std::mem::take(&mut self.entropy),
                answers: self.answers,
            };
            self.agent.on_game_over(&outcome);
            self.settle(Ok(outcome));
        }
    }

    /// Settles the seat.
    pub(crate) fn settle(&mut self, outcome: Result<Outcome, PlayError>) {
        self.outcome = Some(outcome);
        self.open = None;
        self.owed = Owed::Nothing;
    }

    /// Whether `speak` would add commands.
    pub(crate) fn has_to_speak(&self) -> bool {
        self.substituted || self.owed != Owed::Nothing
    }

    /// Adds the commands to send now; calls the agent if necessary.
    pub(crate) fn speak(&mut self, handle: u32, out: &mut Vec<v1::SeatCommand>) {
        if self.is_settled() {
            return;
        }
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

/// The command that attaches a seat, or a participant of a tournament.
pub(crate) fn attach(
    ticket: &str,
    request_id: u32,
    from_sequence: u64,
    entropy: &[u8],
    options: &PlayOptions,
) -> v1::SeatCommand {
    command(
        0,
        Command::Attach(v1::Attach {
            ticket: ticket.to_owned(),
            request_id,
            from_sequence,
            snapshot: false,
            delivery: options.delivery.into(),
            no_mask: options.no_mask,
            entropy: entropy.to_vec(),
        }),
    )
}

fn command(handle: u32, command: Command) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(command),
    }
}
