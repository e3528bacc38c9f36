//! Kinds of participants as an argument of the command line.

use chefshat_client::v1::ParticipantKind;
pub use chefshat_record::convert::kind_name;

/// What a participant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum KindArg {
    /// A program.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
    /// A language model.
    Model,
}

impl From<KindArg> for ParticipantKind {
    fn from(kind: KindArg) -> Self {
        match kind {
            KindArg::Agent => Self::Agent,
            KindArg::Human => Self::Human,
            KindArg::Robot => Self::Robot,
            KindArg::Model => Self::Model,
        }
    }
}

/// The kind to filter by, of all kinds by default.
pub fn kind_filter(kind: Option<KindArg>) -> ParticipantKind {
    kind.map_or(ParticipantKind::Unspecified, ParticipantKind::from)
}
