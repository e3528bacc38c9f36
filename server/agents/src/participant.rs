//! Kinds of participants.

/// The kind of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ParticipantKind {
    /// A program.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
}
