//! Every fault the examiner knows: its code, which programs and documents may rely on, and what to do about it. When a fault is found is
//! decided in `exam`.

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
    /// It took a seat and did not attach to it.
    NeverAttached,
    /// Its attachment was refused.
    AttachRefused,
    /// It asked for another seat although it had one.
    JoinedAgain,
    /// It plays without the stream that can be examined.
    NoPlayStream,
    /// It let a decision run out of time.
    NotAnswered,
    /// Its answers came too late.
    TooSlow,
    /// It answered an action that was not legal.
    IllegalAction,
    /// It answered an action that the game does not have.
    ActionOutOfSpace,
    /// It answered a decision again although it had not been refused.
    AnsweredTwice,
    /// It answered a decision that was never put to it.
    AnsweredUnasked,
    /// It answered a decision again after it had been told that it is closed.
    RepeatedAfterClosed,
    /// It spoke for a handle that was never announced.
    HandleUnknown,
    /// It said far more than it was asked for.
    Flooding,
    /// What it said about its decision was dropped.
    AnnotationsDropped,
    /// A command was refused.
    CommandRefused,
    /// A message was refused, and the stream with it.
    MessageRefused,
    /// It did not read what it was sent.
    NotReading,
    /// It did not answer again after an answer was refused.
    GaveUpWhenRefused,
    /// It did not come back after its connection was lost.
    DidNotReconnect,
    /// It came back, but left out events that it had not been told.
    EventsSkipped,
    /// It stopped playing when an answer of its came too late.
    StoppedAfterClosed,
    /// It did not take over again from its substitute.
    NeverResumed,
    /// It played the games of a tournament one by one.
    OneAtATime,
    /// Its process ended before its game.
    ExitedEarly,
    /// It left before the game was over.
    LeftEarly,
    /// It kept its stream open although everything was over.
    NeverLeft,
    /// Its process did not end.
    NeverExited,
    /// Its process ended as failed.
    ExitStatus,
    /// The case took longer than a case may take.
    CaseTooLong,
    /// The game had no result.
    GameAborted,
    /// The game ended before the case could be played.
    NotExamined,
}

impl Fault {
    /// All of them, in the order in which a game may show them.
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

    /// Its code, which does not change.
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

    /// What to do about it.
    pub fn advice(self) -> &'static str {
        match self {
            Self::CommandFailed => {
                "Give the command that starts your agent after --, as you would type it."
            }
            Self::NeverJoined => {
                "Connect to {address} and call RoomService.JoinRoom with the join code {code}; for a tournament JoinTournament with {tournament}, then attach."
            }
            Self::JoinRefused => {
                "Call JoinRoom with the join code as given and a name of 1 to 64 characters."
            }
            Self::NeverAttached => {
                "Open PlayService.Play and send an Attach with the ticket of the JoinRoomResponse; do not wait for anything in between."
            }
            Self::AttachRefused => {
                "Send the ticket as it was given, with at most 32 bytes of entropy."
            }
            Self::JoinedAgain => {
                "Keep the ticket: after a lost connection open a stream and attach with it; a seat is joined once."
            }
            Self::NoPlayStream => {
                "Play over PlayService.Play, the stream both ways; Watch and Act are for browsers and are not examined."
            }
            Self::NotAnswered => {
                "Answer every DecisionRequest within the time it states, whatever its kind; any bit set in action_mask will do."
            }
            Self::TooSlow => {
                "Answer within time_left_ms of the request, with whatever your agent has found by then."
            }
            Self::IllegalAction => {
                "Answer the index of a bit set in action_mask: action i is bit i%8 of byte i/8. Every decision has a mask of its own."
            }
            Self::ActionOutOfSpace => {
                "Take the number of actions from GameStarted.action_space or the mask: it depends on the rule set."
            }
            Self::AnsweredTwice => {
                "Answer once, and again only after a result INVALID or when the decision is put again on a new stream."
            }
            Self::AnsweredUnasked => {
                "Wait for a DecisionRequest and name its decision_id in the answer."
            }
            Self::RepeatedAfterClosed => {
                "Let a decision go when its result is CLOSED; answer the newest one."
            }
            Self::HandleUnknown => {
                "Send commands with the handle that came with the DecisionRequest; handles begin at 0 on every stream."
            }
            Self::Flooding => "Speak when there is something to answer; do not poll or repeat.",
            Self::AnnotationsDropped => {
                "Keep annotations to 4 KiB a decision and 256 KiB a game, with finite numbers."
            }
            Self::CommandRefused => "Mend the command as the reason says.",
            Self::MessageRefused => {
                "Keep messages to 64 KiB and 1024 commands, encoded as the .proto files say."
            }
            Self::NotReading => {
                "Read the stream of responses all the time, also while your agent thinks."
            }
            Self::GaveUpWhenRefused => {
                "On a result INVALID answer the same decision_id again, with an action of its mask; it is not put again."
            }
            Self::DidNotReconnect => {
                "When the stream ends with UNAVAILABLE, wait a moment, open another and attach with the same ticket."
            }
            Self::EventsSkipped => {
                "Attach with from_sequence = number of the last event you got, plus one; 0 gives all of them again."
            }
            Self::StoppedAfterClosed => {
                "A result CLOSED is no error: go on with the decisions that follow."
            }
            Self::NeverResumed => {
                "On an event Substituted for your own seat send ResumeSeat, or attach anew."
            }
            Self::OneAtATime => {
                "Join the tournament with max_games of 2 or more, and play every seat that the server attaches to the stream."
            }
            Self::ExitedEarly => {
                "Play until the seat is told Detached (GAME_OVER); a Shift's end is not the game's, and no error of one decision is."
            }
            Self::LeftEarly => "Keep the stream open until the seat is told Detached (GAME_OVER).",
            Self::NeverLeft => {
                "After Detached (GAME_OVER) of your last seat half-close the stream, or end it."
            }
            Self::NeverExited => {
                "End the process when the game is over: close the channel, stop threads, do not wait for input."
            }
            Self::ExitStatus => "End with status 0 after a game that was played to its end.",
            Self::CaseTooLong => "Answer faster, or give the examination more --patience.",
            Self::GameAborted => "Look into the agent's log; if it did nothing wrong, tell us.",
            Self::NotExamined => "Run the case again.",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.code())
    }
}

/// A fault as it was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Which.
    pub fault: Fault,
    /// What should have come, in words.
    pub expected: String,
    /// What came, the first time.
    pub got: String,
    /// How often.
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
