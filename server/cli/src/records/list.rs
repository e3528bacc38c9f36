//! `chefshat records list`: lists records, one per line.

use std::process::ExitCode;

use chefshat_client::v1;
use clap::Args;

use super::super::connect::{SecretArgs, ServerArg};
use super::super::policy_args::visibility_mark;
use super::super::{CommandError, pages};
use super::filter::FilterArgs;
use crate::narration::{abort_reason, clean};
use crate::numbers::seat_number;

/// List the records of a server, oldest first.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  chefshat records list --state finished\n  \
                  chefshat records list --newest-first --participant Greta\n  \
                  chefshat records list --origin branched --json")]
pub(super) struct List {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    #[command(flatten)]
    filter: FilterArgs,
    /// List the newest record first.
    #[arg(long)]
    newest_first: bool,
    /// Print each record's summary as a JSON line.
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let filter = self.filter.message();
        let fetch = async |page_token| {
            let request = v1::ListRecordsRequest {
                filter: Some(filter.clone()),
                page_size: pages::PAGE,
                page_token,
                newest_first: self.newest_first,
            };
            let page = client.list_records(request).await?;
            Ok((page.records, page.next_page_token))
        };
        pages::print(fetch, self.json, in_a_line, "no records").await
    }
}

/// A record in one line: game, end, length, players.
pub(super) fn in_a_line(summary: &v1::RecordSummary) -> String {
    let state = match summary.state() {
        v1::RoomState::Finished => "finished",
        v1::RoomState::Aborted => "aborted",
        _ => "unknown",
    };
    let name = |seat: u32| {
        let participant = summary.seats.iter().find(|other| other.seat == seat);
        let name = participant.map_or("", |participant| participant.name.as_str());
        match name {
            "" => format!("seat {}", seat_number(seat)),
            name => clean(name, 20),
        }
    };
    let players: Vec<String> = if summary.standings.is_empty() {
        summary.seats.iter().map(|seat| name(seat.seat)).collect()
    } else {
        let lines = summary.standings.iter();
        lines
            .map(|line| format!("{} {}", name(line.seat), line.points))
            .collect()
    };
    let room = match summary.room_name.as_str() {
        "" => String::new(),
        room => format!("  ({})", clean(room, 30)),
    };
    let why = match summary.abort_reason() {
        v1::AbortReason::Unspecified => String::new(),
        reason => format!("  aborted: {}", abort_reason(reason)),
    };
    format!(
        "{}  {state:<8}  {:>3} {:<6}  {:>6} decisions  {}{room}{why}{}",
        clean(&summary.game_id, 32),
        summary.shifts,
        if summary.shifts == 1 {
            "Shift"
        } else {
            "Shifts"
        },
        summary.decisions,
        players.join(", "),
        visibility_mark(summary.visibility()),
    )
}

#[cfg(test)]
mod tests {
    use crate::records::list::*;

    #[test]
    fn a_record_fits_in_a_line() {
        let seat = |seat, name: &str| v1::Participant {
            seat,
            name: name.into(),
            ..v1::Participant::default()
        };
        let standing = |seat, points| v1::Standing {
            seat,
            points,
            place: 0,
        };
        let finished = v1::RecordSummary {
            game_id: "5f0c6a4de2b14b7f8a3d9c1e7b60425d".into(),
            room_name: "friday".into(),
            state: v1::RoomState::Finished.into(),
            seats: vec![seat(0, "Greta"), seat(1, "\u{1b}[2JRolf")],
            standings: vec![standing(1, 15), standing(0, 4)],
            shifts: 5,
            decisions: 203,
            ..v1::RecordSummary::default()
        };
        assert_eq!(
            in_a_line(&finished),
            "5f0c6a4de2b14b7f8a3d9c1e7b60425d  finished    5 Shifts     203 decisions  [2JRolf 15, Greta 4  (friday)"
        );
        let aborted = v1::RecordSummary {
            game_id: "5f0c6a4de2b14b7f8a3d9c1e7b60425d".into(),
            state: v1::RoomState::Aborted.into(),
            seats: vec![seat(0, "Greta"), seat(1, "")],
            shifts: 1,
            ..v1::RecordSummary::default()
        };
        assert_eq!(
            in_a_line(&aborted),
            "5f0c6a4de2b14b7f8a3d9c1e7b60425d  aborted     1 Shift        0 decisions  Greta, seat 2"
        );
    }
}
