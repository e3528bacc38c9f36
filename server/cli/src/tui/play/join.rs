//! Gets a ticket: for a seat of a room, a place in a tournament, or a table created for this game.
//! Refusals come with advice.

use chefshat_client::{Client, Error, v1};

use super::app::App;
use super::run::Taken;
use crate::CommandError;
use crate::narration::view::GameView;

/// Decision time at a local table: only built-in agents wait.
const OWN_DECISION_MS: u32 = 3_600_000;

/// Joins the room or tournament with this code: only the server knows which it opens.
///
/// # Errors
/// The server's refusal.
pub(super) async fn by_code(
    client: Client,
    code: &str,
    name: &str,
    name_key: Vec<u8>,
) -> Result<Taken, CommandError> {
    match join_room(client.clone(), code, name, name_key.clone()).await {
        Ok(taken) => Ok(taken),
        Err(error) if error.reason() == Some("JOIN_CODE_WRONG") => {
            let joined = client
                .join_tournament(v1::JoinTournamentRequest {
                    join_code: code.to_owned(),
                    name: name.to_owned(),
                    kind: v1::ParticipantKind::Human.into(),
                    max_games: 1,
                    name_key,
                    ..v1::JoinTournamentRequest::default()
                })
                .await
                .map_err(|error| refused(&error))?;
            Ok(Taken {
                client,
                ticket: joined.ticket,
                game: None,
            })
        }
        Err(error) => Err(refused(&error)),
    }
}

/// A room for this person and built-in agents.
pub(super) fn own_room(
    rules: v1::RuleSet,
    seats: Vec<v1::SeatConfig>,
    pace_ms: u32,
) -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        name: "your table".into(),
        rules: Some(rules),
        seats,
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(OWN_DECISION_MS),
            pace_ms: Some(pace_ms),
            hints: true,
            ..v1::RoomPolicy::default()
        }),
        ..v1::CreateRoomRequest::default()
    }
}

async fn join_room(
    client: Client,
    code: &str,
    name: &str,
    name_key: Vec<u8>,
) -> Result<Taken, Error> {
    let joined = client
        .join(v1::JoinRoomRequest {
            join_code: code.to_owned(),
            name: name.to_owned(),
            kind: v1::ParticipantKind::Human.into(),
            name_key,
            ..v1::JoinRoomRequest::default()
        })
        .await?;
    let table = GameView::of_room(&joined.room.unwrap_or_default());
    Ok(Taken {
        client,
        ticket: joined.ticket,
        game: Some(App::new(table, Some(joined.seat))),
    })
}

/// A refusal with advice.
fn refused(error: &Error) -> CommandError {
    let what = error.message();
    let Some(todo) = error.reason().and_then(remedy) else {
        return error.to_string().into();
    };
    if error.reason() == Some("JOIN_CODE_WRONG") {
        return format!("no room and no tournament of this server has this join code; {todo}")
            .into();
    }
    format!("{what}; {todo}").into()
}

/// Advice for a refusal.
fn remedy(reason: &str) -> Option<&'static str> {
    Some(match reason {
        "JOIN_CODE_WRONG" => "check the code, and that --server is the right server",
        "ROOM_FULL" | "SEAT_TAKEN" => {
            "ask for the code of another room, or watch with `chefshat watch`"
        }
        "GAME_STARTED" => "resume your seat with --ticket, or watch with `chefshat watch`",
        "KIND_NOT_ADMITTED" => "people cannot join here: ask its host for a seat for a person",
        "TOURNAMENT_FULL" => "ask its host for another one",
        "TOURNAMENT_STARTED" => {
            "resume your place with --ticket, or follow it with `chefshat tournament follow`"
        }
        "NAME_TAKEN" => "choose another --name, or resume your place with --ticket",
        "NOT_STATELESS" => "people cannot take part in it: ask its host for other --deals",
        "NAME_REFUSED" => "choose another --name",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use crate::tui::play::join::remedy;

    /// All refusals of the protocol that a command line can cause.
    #[test]
    fn every_refusal_says_what_to_do() {
        let reasons = [
            "JOIN_CODE_WRONG",
            "ROOM_FULL",
            "SEAT_TAKEN",
            "GAME_STARTED",
            "KIND_NOT_ADMITTED",
            "TOURNAMENT_FULL",
            "TOURNAMENT_STARTED",
            "NAME_TAKEN",
            "NOT_STATELESS",
            "NAME_REFUSED",
        ];
        for reason in reasons {
            assert!(remedy(reason).is_some(), "{reason}");
        }
    }
}
