//! `chefshat room list` and `chefshat room show`.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_client::v1;
use clap::Args;

use super::super::connect::{SecretArgs, ServerArg};
use super::super::policy_args::visibility_mark;
use super::super::{CommandError, pages, say};
use crate::choice::choice;
use crate::kind::kind_name;
use crate::narration::{abort_reason, clean};
use crate::numbers::seat_number;

/// List the rooms of a server, newest first.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  chefshat room list --state playing")]
pub(super) struct List {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Only rooms in this state.
    #[arg(long, value_parser = choice(&STATES))]
    state: Option<v1::RoomState>,
    /// Print each room as a JSON line.
    #[arg(long)]
    json: bool,
}

/// Show one room.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  chefshat room show 5f0c6a4de2b14b7f8a3d9c1e7b60425d")]
pub(super) struct Show {
    /// ID of the room.
    #[arg(value_name = "ROOM-ID")]
    room_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Print the room as a JSON line.
    #[arg(long)]
    json: bool,
}

const STATES: [(&str, v1::RoomState, &str); 4] = [
    ("waiting", v1::RoomState::Waiting, ""),
    ("playing", v1::RoomState::Playing, ""),
    ("finished", v1::RoomState::Finished, ""),
    ("aborted", v1::RoomState::Aborted, ""),
];

impl List {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let fetch = async |page_token| {
            let request = v1::ListRoomsRequest {
                state: self.state.unwrap_or_default().into(),
                page_size: pages::PAGE,
                page_token,
            };
            let page = client.list_rooms(request).await?;
            Ok((page.rooms, page.next_page_token))
        };
        pages::print(fetch, self.json, in_a_line, "no rooms").await
    }
}

impl Show {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let room = client.get_room(self.room_id).await?;
        if self.json {
            say(serde_json::to_string(&room)?)?;
        } else {
            write!(anstream::stdout(), "{}", in_full(&room))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Name of a room's state.
pub(super) fn state(state: v1::RoomState) -> &'static str {
    match state {
        v1::RoomState::Unspecified => "in a state this program does not know",
        v1::RoomState::Waiting => "waiting",
        v1::RoomState::Playing => "playing",
        v1::RoomState::Finished => "finished",
        v1::RoomState::Aborted => "aborted",
    }
}

fn in_a_line(room: &v1::Room) -> String {
    let taken = room
        .seats
        .iter()
        .filter(|seat| !seat.name.is_empty())
        .count();
    let seats = room.seats.len();
    let state = state(room.state());
    let name = clean(&room.name, 30);
    let beginning = match room.origin() {
        v1::GameOrigin::Branched => "  (branched)",
        v1::GameOrigin::Scripted => "  (given hands)",
        v1::GameOrigin::Physical => "  (real cards)",
        _ => "",
    };
    let policy = room.policy.clone().unwrap_or_default();
    let line = format!(
        "{}  {state:<8}  {taken}/{seats} seats  {name}{beginning}{}",
        room.room_id,
        visibility_mark(policy.visibility()),
    );
    line.trim_end().to_owned()
}

fn in_full(room: &v1::Room) -> String {
    let mut out = format!("room  {}\ngame  {}\n", room.room_id, room.game_id);
    if !room.name.is_empty() {
        out.push_str(&format!("name  {}\n", clean(&room.name, 64)));
    }
    let why = match room.abort_reason() {
        v1::AbortReason::Unspecified => String::new(),
        reason => format!(": {}", abort_reason(reason)),
    };
    out.push_str(&format!("state {}{why}\n", state(room.state())));
    if let Some(words) = beginning(room) {
        out.push_str(&format!("start {words}\n"));
    }
    if room.origin() == v1::GameOrigin::Physical {
        out.push_str("deal  at a table\n");
    } else if room.seed_fixed {
        out.push_str("deal  from a seed its creator fixed\n");
    } else {
        out.push_str(&format!(
            "deal  committed to as {}\n",
            hex::encode(&room.seed_commitment)
        ));
    }
    let policy = room.policy.clone().unwrap_or_default();
    if policy.durability() == v1::Durability::Ephemeral {
        out.push_str("store in memory; the game is lost when the server stops\n");
    }
    match policy.visibility() {
        v1::Visibility::Unspecified | v1::Visibility::Public => {}
        v1::Visibility::Unlisted => out.push_str("seen  by anyone who knows its id\n"),
        v1::Visibility::Private => out.push_str("seen  by those who have a ticket of it\n"),
    }
    for seat in &room.seats {
        let number = seat_number(seat.seat);
        out.push_str(&format!("seat {number} {}\n", seat_in_words(seat)));
    }
    out
}

/// How the game of a room begins, if it is not dealt as usual.
pub(super) fn beginning(room: &v1::Room) -> Option<String> {
    if let Some(point) = &room.branched_from {
        let (game, decisions) = (clean(&point.game_id, 40), point.decisions);
        let deals = if point.same_deals {
            "later deals as there"
        } else {
            "later deals of its own"
        };
        return Some(format!(
            "as game {game} until after decision {decisions}, {deals}"
        ));
    }
    match room.origin() {
        v1::GameOrigin::Scripted => Some("with hands its creator gave".to_owned()),
        v1::GameOrigin::Physical => Some("with real cards".to_owned()),
        _ => None,
    }
}

fn seat_in_words(seat: &v1::Participant) -> String {
    if seat.name.is_empty() {
        return match seat.reserved_for() {
            v1::ParticipantKind::Unspecified => "free for anyone".to_owned(),
            kind => format!("free for {}s", kind_name(kind)),
        };
    }
    let name = clean(&seat.name, 30);
    if let Some(player) = &seat.replay {
        let game = clean(&player.game_id, 40);
        let number = seat_number(player.seat);
        return format!("{name}, imitates seat {number} of game {game}");
    }
    if !seat.built_in_agent.is_empty() {
        let agent = clean(&seat.built_in_agent, 64);
        return match name == agent {
            true => format!("{name}, played by the server"),
            false => format!("{name}, played by the server as {agent}"),
        };
    }
    if seat.at_table {
        return format!("{name}, {}, at the table", kind_name(seat.kind()));
    }
    let there = match (seat.substituted, seat.connected) {
        (true, _) => "substituted",
        (false, true) => "connected",
        (false, false) => "not connected",
    };
    format!("{name}, {}, {there}", kind_name(seat.kind()))
}

#[cfg(test)]
mod tests {
    use crate::room::show::*;

    #[test]
    fn a_branched_room_says_where_it_comes_from() {
        let room = v1::Room {
            room_id: "a".into(),
            game_id: "b".into(),
            state: v1::RoomState::Playing.into(),
            policy: Some(v1::RoomPolicy {
                durability: v1::Durability::Ephemeral.into(),
                ..v1::RoomPolicy::default()
            }),
            seats: vec![
                v1::Participant {
                    name: "replay".into(),
                    built_in_agent: "replay".into(),
                    replay: Some(v1::RecordedPlayer {
                        game_id: "c".into(),
                        seat: 2,
                    }),
                    ..v1::Participant::default()
                },
                v1::Participant {
                    seat: 1,
                    ..v1::Participant::default()
                },
            ],
            seed_fixed: true,
            origin: v1::GameOrigin::Branched.into(),
            branched_from: Some(v1::BranchPoint {
                game_id: "c".into(),
                decisions: 40,
                same_deals: true,
            }),
            ..v1::Room::default()
        };
        assert_eq!(
            in_full(&room),
            "room  a\ngame  b\nstate playing\n\
             start as game c until after decision 40, later deals as there\n\
             deal  from a seed its creator fixed\n\
             store in memory; the game is lost when the server stops\n\
             seat 1 replay, imitates seat 3 of game c\n\
             seat 2 free for anyone\n"
        );
        assert_eq!(in_a_line(&room), "a  playing   1/2 seats    (branched)");
        let scripted = v1::Room {
            origin: v1::GameOrigin::Scripted.into(),
            ..v1::Room::default()
        };
        let words = beginning(&scripted);
        assert_eq!(words.as_deref(), Some("with hands its creator gave"));
        assert_eq!(beginning(&v1::Room::default()), None);
    }

    #[test]
    fn a_physical_room_has_no_deal_of_the_server() {
        let room = v1::Room {
            room_id: "a".into(),
            game_id: "b".into(),
            state: v1::RoomState::Playing.into(),
            origin: v1::GameOrigin::Physical.into(),
            seats: vec![v1::Participant {
                name: "Ada".into(),
                kind: v1::ParticipantKind::Human.into(),
                at_table: true,
                ..v1::Participant::default()
            }],
            ..v1::Room::default()
        };
        assert_eq!(
            in_full(&room),
            "room  a\ngame  b\nstate playing\nstart with real cards\ndeal  at a table\n\
             seat 1 Ada, human, at the table\n"
        );
        assert_eq!(in_a_line(&room), "a  playing   1/1 seats    (real cards)");
    }
}
