//! Enums that messages have too: their values have the same names there, and there is one more,
//! unspecified.

use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use chefshat_referee as referee;
use chefshat_room::journal::{AbortReason, ParticipantKind, ReportSource, SeatLabels, Source};
use chefshat_room::policy::{AbortPolicy, Durability, Visibility};
use chefshat_study as study;
use chefshat_tournament as tournament;

/// An enum that messages have too.
pub trait Mirrored: Copy {
    /// It in messages.
    type Message: TryFrom<i32>;

    /// The value in messages.
    fn to_proto(self) -> Self::Message;

    /// The value of a message; `None` if it is unspecified.
    fn of(message: Self::Message) -> Option<Self>;

    /// The value of a field; `None` if it is unspecified.
    ///
    /// # Errors
    /// The number is not a value.
    fn from_proto(field: &'static str, number: i32) -> Result<Option<Self>, FieldProblem> {
        let message = Self::Message::try_from(number);
        message
            .map(Self::of)
            .map_err(|_| FieldProblem::unknown(field, number))
    }
}

/// Converts a kind to its number.
pub(super) fn kind_to_proto(kind: Option<ParticipantKind>) -> i32 {
    let kind = kind.map_or(v1::ParticipantKind::Unspecified, Mirrored::to_proto);
    kind.into()
}

macro_rules! mirrored {
    ($($ours:ty = $theirs:ident { $($value:ident),+ $(,)? })+) => {
        $(
            impl Mirrored for $ours {
                type Message = v1::$theirs;

                fn to_proto(self) -> v1::$theirs {
                    match self {
                        $(Self::$value => v1::$theirs::$value,)+
                    }
                }

                fn of(message: v1::$theirs) -> Option<Self> {
                    match message {
                        v1::$theirs::Unspecified => None,
                        $(v1::$theirs::$value => Some(Self::$value),)+
                    }
                }
            }
        )+
    };
}

mirrored! {
    ParticipantKind = ParticipantKind { Agent, Human, Robot, Model }
    AbortPolicy = AbortPolicy { AllLost, AnyLost, Never }
    Durability = Durability { Durable, Ephemeral }
    Visibility = Visibility { Public, Unlisted, Private }
    AbortReason = AbortReason { Closed, Shutdown, ParticipantsLost, NeverStarted, TooLong }
    Source = DecisionSource {
        Agent, Timeout, Invalid, Disconnected, Substitute, Recorded, Table,
    }
    ReportSource = ReportSource { Camera, Attendant, Robot }
    referee::ViolatedRule = ViolatedRule {
        Turn, Face, Size, Form, Opening, Pass, Cards, SpecialAction, Gift, Role, Decision, Correction,
    }
    tournament::State = TournamentState { Open, Playing, Finished, Closed }
    tournament::Format = TournamentFormat { Knockout, RoundRobin, Swiss }
    tournament::Deals = TournamentDeals { Independent, SameAtAllTables, Rotated }
    study::Order = StudyOrder { Between, Within }
    study::LeftOverPolicy = StudyLeftOver { Dismiss, Agents }
    study::Pointer = StudyPointer { None, Coarse, Fine }
    study::Hide = StudyHide { Log, Lookup, Expressions, Played, Pages }
    study::Labels = StudyLabels { AsTheyAre, Kinds, Players }
    SeatLabels = StudyLabels { AsTheyAre, Kinds, Players }
    study::Status = StudyParticipantState {
        Invited, Active, Completed, Withdrawn, DroppedOut, Removed, ScreenedOut, LeftOver,
    }
    study::End = StudyEndReason {
        Completed, Withdrawn, DataDeleted, DroppedOut, Removed, ScreenedOut, LeftOver,
    }
}
