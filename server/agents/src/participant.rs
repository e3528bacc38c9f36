//! Kinds of participants.

/// The kind of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ParticipantKind {
    /// A program that is not a language model.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
    /// A language model.
    Model,
}
