//! Flags that filter records.

use chefshat_client::v1;
use clap::Args;

use crate::choice::choice;
use crate::kind::{KindArg, kind_filter};

/// Filter of records; all given conditions must hold.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Which")]
pub(super) struct FilterArgs {
    /// Games with this end.
    #[arg(long, value_parser = choice(&ENDS))]
    state: Option<v1::RoomState>,
    /// Games with a participant of this name or a built-in agent of this kind.
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
    /// Games with this origin.
    #[arg(long, value_parser = choice(&ORIGINS))]
    origin: Option<v1::GameOrigin>,
    /// Games whose room was created at or after this time, in milliseconds since the Unix epoch.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0,
        hide_default_value = true
    )]
    created_from_ms: u64,
    /// Games whose room was created before this time, in milliseconds since the Unix epoch.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0,
        hide_default_value = true
    )]
    created_before_ms: u64,
    /// Games hosted by this server, not imported ones.
    #[arg(long)]
    hosted_here: bool,
}

const ENDS: [(&str, v1::RoomState, &str); 2] = [
    ("finished", v1::RoomState::Finished, "The game has a result"),
    ("aborted", v1::RoomState::Aborted, "The game was aborted"),
];
const ORIGINS: [(&str, v1::GameOrigin, &str); 6] = {
    use v1::GameOrigin::{Branched, Dealt, FixedSeed, Imported, Physical, Scripted};
    [
        ("dealt", Dealt, "Dealt from a seed the server committed to"),
        (
            "fixed-seed",
            FixedSeed,
            "Dealt from a seed fixed by the room's creator",
        ),
        ("scripted", Scripted, "Started with given hands"),
        ("branched", Branched, "Branched from another record"),
        (
            "imported",
            Imported,
            "Played with real cards elsewhere and imported",
        ),
        (
            "physical",
            Physical,
            "Played with real cards in a physical room",
        ),
    ]
};

impl FilterArgs {
    /// The filter for the server.
    pub(super) fn message(&self) -> v1::RecordFilter {
        v1::RecordFilter {
            state: self.state.unwrap_or_default().into(),
            participant: self.participant.clone(),
            kind: kind_filter(self.kind).into(),
            room_name: self.room_name.clone(),
            origin: self.origin.unwrap_or_default().into(),
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
