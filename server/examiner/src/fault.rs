//! The faults the examiner can find: stable codes and advice. `exam` finds them.

use std::fmt;

/// Something an agent got wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// The command could not be started.
    CommandFailed,
    /// It took no seat.
    NeverJoined,
    /// It asked for a seat and was refused.
    JoinRefused,
    /// It took a seat but did not attach to it.
    NeverAttached,
    /// Its attachment was refused.
    AttachRefused,
    /// It asked for a second seat.
    JoinedAgain,
    /// It plays without the stream that can be examined.
    NoPlayStream,
    /// It let a decision time out.
    NotAnswered,
    /// Its answers came too late.
    TooSlow,
    /// It answered with an illegal action.
    IllegalAction,
    /// It answered with an action that does not exist in the game.
    ActionOutOfSpace,
    /// It answered a decision twice without a refusal in between.
    AnsweredTwice,
    /// It answered a decision that was never requested.
    AnsweredUnasked,
    /// It answered a decision again after the result CLOSED.
    RepeatedAfterClosed,
    /// It used a handle that was never announced.
    HandleUnknown,
    /// It sent far more messages than necessary.
    Flooding,
    /// Annotations of its decisions were dropped.
    AnnotationsDropped,
    /// A command was refused.
    CommandRefused,
    /// A message was refused, and its stream ended.
    MessageRefused,
    /// It did not read its stream.
    NotReading,
    /// It did not answer again after a refused answer.
    GaveUpWhenRefused,
    /// It did not reconnect after its connection was lost.
    DidNotReconnect,
    /// It reconnected but skipped events it had not received.
    EventsSkipped,
    /// It stopped playing after one of its answers came too late.
    StoppedAfterClosed,
    /// It did not take over again from its substitute.
    NeverResumed,
    /// It played the games of a tournament one by one.
    OneAtATime,
    /// Its process exited before the game was over.
    ExitedEarly,
    /// It left before the game was over.
    LeftEarly,
    /// It kept its stream open after everything was over.
    NeverLeft,
    /// Its process did not exit.
    NeverExited,
    /// Its process exited with an error.
    ExitStatus,
    /// The case exceeded its time limit.
    CaseTooLong,
    /// The game had no result.
    GameAborted,
    /// The game ended before the case could be examined.
    NotExamined,
}

impl Fault {
    /// All faults, in the order in which they can occur in a game.
    pub const ALL: [Fault; 34] = [
        Self::CommandFailed,
        Self::NeverJoined,
        Self::JoinRefused,
        Self::NeverAttached,
        Self::AttachRefused,
        Self::JoinedAgain,
        Self::NoPlayStream,
        Self::NotAnswered,
        Self::TooSlow,
        Self::IllegalAction,
        Self::ActionOutOfSpace,
        Self::AnsweredTwice,
        Self::AnsweredUnasked,
        Self::RepeatedAfterClosed,
        Self::HandleUnknown,
        Self::Flooding,
        Self::AnnotationsDropped,
        Self::CommandRefused,
        Self::MessageRefused,
        Self::NotReading,
        Self::GaveUpWhenRefused,
        Self::DidNotReconnect,
        Self::EventsSkipped,
        Self::StoppedAfterClosed,
        Self::NeverResumed,
        Self::OneAtATime,
        Self::ExitedEarly,
        Self::LeftEarly,
        Self::NeverLeft,
        Self::NeverExited,
        Self::ExitStatus,
        Self::CaseTooLong,
        Self::GameAborted,
        Self::NotExamined,
    ];

    /// Stable code.
    pub fn code(self) -> &'static str {
        match self {
            Self::CommandFailed => "COMMAND_FAILED",
            Self::NeverJoined => "NEVER_JOINED",
            Self::JoinRefused => "JOIN_REFUSED",
            Self::NeverAttached => "NEVER_ATTACHED",
            Self::AttachRefused => "ATTACH_REFUSED",
            Self::JoinedAgain => "JOINED_AGAIN",
            Self::NoPlayStream => "NO_PLAY_STREAM",
            Self::NotAnswered => "NOT_ANSWERED",
            Self::TooSlow => "TOO_SLOW",
            Self::IllegalAction => "ILLEGAL_ACTION",
            Self::ActionOutOfSpace => "ACTION_OUT_OF_SPACE",
            Self::AnsweredTwice => "ANSWERED_TWICE",
            Self::AnsweredUnasked => "ANSWERED_UNASKED",
            Self::RepeatedAfterClosed => "REPEATED_AFTER_CLOSED",
            Self::HandleUnknown => "HANDLE_UNKNOWN",
            Self::Flooding => "FLOODING",
            Self::AnnotationsDropped => "ANNOTATIONS_DROPPED",
            Self::CommandRefused => "COMMAND_REFUSED",
            Self::MessageRefused => "MESSAGE_REFUSED",
            Self::NotReading => "NOT_READING",
            Self::GaveUpWhenRefused => "GAVE_UP_WHEN_REFUSED",
            Self::DidNotReconnect => "DID_NOT_RECONNECT",
            Self::EventsSkipped => "EVENTS_SKIPPED",
            Self::StoppedAfterClosed => "STOPPED_AFTER_CLOSED",
            Self::NeverResumed => "NEVER_RESUMED",
            Self::OneAtATime => "ONE_AT_A_TIME",
            Self::ExitedEarly => "EXITED_EARLY",
            Self::LeftEarly => "LEFT_EARLY",
            Self::NeverLeft => "NEVER_LEFT",
            Self::NeverExited => "NEVER_EXITED",
            Self::ExitStatus => "EXIT_STATUS",
            Self::CaseTooLong => "CASE_TOO_LONG",
            Self::GameAborted => "GAME_ABORTED",
            Self::NotExamined => "NOT_EXAMINED",
        }
    }

    /// How to correct it.
    pub fn advice(self) -> &'static str {
        match self {
            Self::CommandFailed => {
                "Give the command that starts your agent after --, as you would type it in a shell."
            }
            Self::NeverJoined => {
                "Connect to {address} and call RoomService.JoinRoom with the join code {code}; for a tournament call JoinTournament with {tournament}. Then attach."
            }
            Self::JoinRefused => {
                "Call JoinRoom with exactly the given join code and a name of 1 to 64 characters."
            }
            Self::NeverAttached => {
                "Open PlayService.Play and send an Attach with the ticket of the JoinRoomResponse, without waiting for anything in between."
            }
            Self::AttachRefused => {
                "Send exactly the ticket you received, with at most 32 bytes of entropy."
            }
            Self::JoinedAgain => {
                "Join once and keep the ticket. After a lost connection open a stream and attach with it."
            }
            Self::NoPlayStream => {
                "Play over the bidirectional stream PlayService.Play. Watch and Act are for browsers and are not examined."
            }
            Self::NotAnswered => {
                "Answer every DecisionRequest, of any kind, within its time; any bit that is set in action_mask will do."
            }
            Self::TooSlow => {
                "Answer within the request's time_left_ms with the best action found so far."
            }
            Self::IllegalAction => {
                "Answer with the index of a bit that is set in action_mask: action i is bit i%8 of byte i/8. Every decision has its own mask."
            }
            Self::ActionOutOfSpace => {
                "Take the number of actions from GameStarted.action_space or from the mask: it depends on the rule set."
            }
            Self::AnsweredTwice => {
                "Answer once. Answer again only after a result INVALID, or when the decision is requested again on a new stream."
            }
            Self::AnsweredUnasked => "Wait for a DecisionRequest and answer with its decision_id.",
            Self::RepeatedAfterClosed => {
                "Ignore a decision whose result is CLOSED; answer the newest one."
            }
            Self::HandleUnknown => {
                "Send commands with the handle of the DecisionRequest; handles start at 0 on every stream."
            }
            Self::Flooding => "Send only answers to requests; do not poll or repeat.",
            Self::AnnotationsDropped => {
                "Limit annotations to 4 KiB per decision and 256 KiB per game, with finite numbers."
            }
            Self::CommandRefused => "Correct the command; the reason says how.",
            Self::MessageRefused => {
                "Limit messages to 64 KiB and 1024 commands, encoded as in the .proto files."
            }
            Self::NotReading => {
                "Read the stream of responses all the time, also while your agent computes."
            }
            Self::GaveUpWhenRefused => {
                "After a result INVALID answer the same decision_id again with a legal action; the decision is not requested again."
            }
            Self::DidNotReconnect => {
                "When the stream ends with UNAVAILABLE, or no connection is possible, wait a moment, open a new stream and attach with the same ticket; try for minutes."
            }
            Self::EventsSkipped => {
                "Attach with from_sequence = the number of the last event received plus one; 0 requests all events again."
            }
            Self::StoppedAfterClosed => {
                "A result CLOSED is not an error: continue with the following decisions."
            }
            Self::NeverResumed => {
                "On an event Substituted for your own seat, or an update Substitution with `active`, send ResumeSeat, or attach again."
            }
            Self::OneAtATime => {
                "Join the tournament with max_games of 2 or more, and play every seat that the server attaches to the stream."
            }
            Self::ExitedEarly => {
                "Play until the seat receives Detached (GAME_OVER). The end of a Shift or an error of one decision does not end the game."
            }
            Self::LeftEarly => "Keep the stream open until the seat receives Detached (GAME_OVER).",
            Self::NeverLeft => {
                "After Detached (GAME_OVER) of your last seat, half-close or end the stream."
            }
            Self::NeverExited => {
                "Exit when the game is over: close the channel, stop threads, do not wait for input."
            }
            Self::ExitStatus => "Exit with status 0 after a complete game.",
            Self::CaseTooLong => "Answer faster, or increase --patience.",
            Self::GameAborted => {
                "Check the agent's log. If the agent did nothing wrong, please report this."
            }
            Self::NotExamined => "Run the case again.",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.code())
    }
}

/// A fault that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The fault.
    pub fault: Fault,
    /// What was expected, in words.
    pub expected: String,
    /// What happened, the first time.
    pub got: String,
    /// Number of occurrences.
    pub times: u32,
}

#[cfg(test)]
mod tests {
    use crate::fault::*;

    #[test]
    fn the_documentation_lists_every_fault_and_what_to_do() {
        let page = include_str!("../../../docs/check-agent.md");
        let rows: Vec<&str> = page
            .lines()
            .filter(|line| line.starts_with("| `"))
            .collect();
        for fault in Fault::ALL {
            let (start, end) = (
                format!("| `{fault}` | "),
                format!(" | {} |", fault.advice()),
            );
            let listed = |row: &&str| row.starts_with(&start) && row.ends_with(&end);
            assert_eq!(rows.iter().copied().filter(listed).count(), 1, "{fault}");
        }
    }
}
