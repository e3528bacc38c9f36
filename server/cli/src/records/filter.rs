//! The flags that say which records are wanted.

use chefshat_client::v1;
use clap::{Args, ValueEnum};

use crate::kind::{KindArg, kind_filter};

/// Which records: all conditions that are given must hold.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Which")]
pub(super) struct FilterArgs {
    /// Games that ended so.
    #[arg(long)]
    state: Option<EndArg>,
    /// Games in which a participant had this name, or the built-in agent of a seat is this.
    #[arg(
        long,
        value_name = "NAME",
        default_value = "",
        hide_default_value = true
    )]
    participant: String,
    /// Games with at least one participant of this kind.
    #[arg(long, value_enum)]
    kind: Option<KindArg>,
    /// Games of rooms with this name.
    #[arg(
        long,
        value_name = "NAME",
        default_value = "",
        hide_default_value = true
    )]
    room_name: String,
    /// Games that came about so.
    #[arg(long)]
    origin: Option<OriginArg>,
    /// Games whose room was created at this time or later, milliseconds since the Unix epoch.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0,
        hide_default_value = true
    )]
    created_from_ms: u64,
    /// Games whose room was created before this time, milliseconds since the Unix epoch.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0,
        hide_default_value = true
    )]
    created_before_ms: u64,
    /// Games that this server hosted: none that were added from elsewhere.
    #[arg(long)]
    hosted_here: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EndArg {
    /// With a result.
    Finished,
    /// Without one.
    Aborted,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum OriginArg {
    /// Dealt from a seed that the server committed to.
    Dealt,
    /// Dealt from a seed that the room's creator fixed.
    FixedSeed,
    /// Begun with given hands.
    Scripted,
    /// Branched from another record.
    Branched,
    /// Played elsewhere with real cards.
    Imported,
}

impl FilterArgs {
    /// The filter as a server is asked for it.
    pub(super) fn message(&self) -> v1::RecordFilter {
        let state = match self.state {
            None => v1::RoomState::Unspecified,
            Some(EndArg::Finished) => v1::RoomState::Finished,
            Some(EndArg::Aborted) => v1::RoomState::Aborted,
        };
        let origin = match self.origin {
            None => v1::GameOrigin::Unspecified,
            Some(OriginArg::Dealt) => v1::GameOrigin::Dealt,
            Some(OriginArg::FixedSeed) => v1::GameOrigin::FixedSeed,
            Some(OriginArg::Scripted) => v1::GameOrigin::Scripted,
            Some(OriginArg::Branched) => v1::GameOrigin::Branched,
            Some(OriginArg::Imported) => v1::GameOrigin::Imported,
        };
        v1::RecordFilter {
            state: state.into(),
            participant: self.participant.clone(),
            kind: kind_filter(self.kind).into(),
            room_name: self.room_name.clone(),
            origin: origin.into(),
            created_from_ms: self.created_from_ms,
            created_before_ms: self.created_before_ms,
            hosted_here: self.hosted_here,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::records::filter::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        filter: FilterArgs,
    }

    #[test]
    fn every_flag_sets_its_field() {
        let filter = |flags: &str| {
            let words = std::iter::once("test").chain(flags.split_whitespace());
            let only = Only::try_parse_from(words).expect("the flags are known");
            only.filter.message()
        };
        assert_eq!(filter(""), v1::RecordFilter::default());
        assert_eq!(
            filter(
                "--state aborted --participant Greta --kind robot --room-name friday --origin fixed-seed \
                 --created-from-ms 5 --created-before-ms 7 --hosted-here"
            ),
            v1::RecordFilter {
                state: v1::RoomState::Aborted.into(),
                participant: "Greta".into(),
                kind: v1::ParticipantKind::Robot.into(),
                room_name: "friday".into(),
                origin: v1::GameOrigin::FixedSeed.into(),
                created_from_ms: 5,
                created_before_ms: 7,
                hosted_here: true,
            }
        );
    }
}
