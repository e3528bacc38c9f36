//! The last lines of `chefshat play`: how the game or tournament ended, where to find more, and how
//! to resume.

use std::process::ExitCode;

use chefshat_client::v1;

use super::app::{App, Link};
use super::lobby::Lobby;
use super::part::Part;
use crate::narration::view::End;
use crate::narration::{MAX_NAME, abort_reason};
use crate::numbers::{counted, ordinal};
use crate::tournament::tables::{NO_GAME_COUNTED, place_in_words};
use crate::tui::view::padded;
use crate::{CommandError, say};

/// Commands to suggest.
pub(super) struct Hints {
    /// Downloads the record of a game, or shows it.
    pub(super) record: Box<dyn Fn(&str) -> String + Send>,
    /// Where the pages of games are, if a server goes on.
    pub(super) page: Option<String>,
    /// Shows a tournament's results; its ID is added.
    pub(super) results: String,
    /// Resumes, if that is possible.
    pub(super) back: Option<String>,
}

/// Prints the end; returns the exit code.
///
/// # Errors
/// The seat, or the place in the tournament, was lost.
pub(super) fn print_end(part: &Part, hints: &Hints) -> Result<ExitCode, CommandError> {
    if let Some(lobby) = &part.lobby {
        return of_tournament(part, lobby, hints);
    }
    let link_lost = match &part.link {
        Link::Over(why) => why.clone(),
        _ => None,
    };
    let end = part.game.as_ref().and_then(|game| game.table.end.as_ref());
    match (&part.game, end) {
        (Some(game), Some(End::Finished(standings))) => {
            finished(game, standings, hints)?;
            Ok(ExitCode::SUCCESS)
        }
        (_, Some(End::Aborted(reason))) => {
            let why = abort_reason(*reason);
            say(format_args!(
                "the game was aborted and has no result: {why}"
            ))?;
            Ok(ExitCode::FAILURE)
        }
        (_, _) => {
            if let Some(why) = link_lost {
                return Err(lost("seat", &why, hints));
            }
            say("you left the table before the game ended")?;
            back(hints)?;
            Ok(ExitCode::FAILURE)
        }
    }
}

fn finished(game: &App, standings: &[v1::Standing], hints: &Hints) -> Result<(), CommandError> {
    for line in standings {
        let name = padded(&game.table.name(line.seat), MAX_NAME);
        let points = counted(line.points, "point");
        say(format_args!(
            "{}  {name}  {points:>10}",
            ordinal(line.place)
        ))?;
    }
    let mut mine = standings.iter().filter(|line| Some(line.seat) == game.me);
    if let Some(line) = mine.next() {
        say(format_args!(
            "you have place {} of {}",
            line.place,
            standings.len()
        ))?;
    }
    let id = &game.table.game_id;
    if let Some(page) = &hints.page {
        say(format_args!("the replay: {page}/replay/{id}"))?;
    }
    say(format_args!("the record: {}", (hints.record)(id)))
}

fn of_tournament(part: &Part, lobby: &Lobby, hints: &Hints) -> Result<ExitCode, CommandError> {
    let results = format!("the results: {} {}", hints.results, lobby.tournament_id);
    let state = lobby.report.as_ref().map(|it| it.tournament.state());
    let code = match (state, &part.link) {
        (Some(v1::TournamentState::Finished), _) => {
            say(standing(lobby, "the tournament is over"))?;
            ExitCode::SUCCESS
        }
        (Some(v1::TournamentState::Closed), _) => {
            say(standing(lobby, "the tournament was closed before its end"))?;
            ExitCode::FAILURE
        }
        (_, Link::Over(Some(why))) => {
            return Err(lost("place in the tournament", why, hints));
        }
        (_, Link::Over(None)) => {
            say(standing(lobby, "the tournament is over"))?;
            ExitCode::SUCCESS
        }
        _ if !lobby.has_games_to_come() => {
            say(standing(lobby, "your games are over"))?;
            ExitCode::SUCCESS
        }
        _ => {
            say("you left the tournament before its end")?;
            back(hints)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    say(results)?;
    Ok(code)
}

/// A sentence with the person's standing.
fn standing(lobby: &Lobby, what: &str) -> String {
    let place = lobby.report.as_ref().and_then(|report| {
        let line = report.standing(lobby.me)?;
        let place = place_in_words(line, report.standings.len());
        Some(place.map_or_else(|| NO_GAME_COUNTED.to_owned(), |it| format!("you are {it}")))
    });
    match place {
        Some(place) => format!("{what}: {place}"),
        None => what.to_owned(),
    }
}

/// The seat or place is lost. It can be resumed if only the connection was lost for too long.
fn lost(what: &str, why: &str, hints: &Hints) -> CommandError {
    match &hints.back {
        Some(back) => format!("the {what} is lost: {why}\nto resume: {back}").into(),
        None => format!("the {what} is lost: {why}").into(),
    }
}

fn back(hints: &Hints) -> Result<(), CommandError> {
    match &hints.back {
        Some(back) => say(format_args!("to resume: {back}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use crate::tui::play::ending::*;
    use crate::tui::play::lobby::Report;
    use crate::tui::play::part::PartInput;
    use crate::tui::play::tournament_session::TournamentSession;

    #[test]
    fn a_person_who_lost_the_connection_learns_how_to_resume() {
        let hints = Hints {
            record: Box::new(str::to_owned),
            page: None,
            results: String::new(),
            back: Some("chefshat play --ticket T".into()),
        };
        let outage = || PartInput::Over(Some("no connection for 600 s".into()));
        let mut seat = Part::new(None);
        seat.take(outage(), 0);
        let mut tournament = TournamentSession::new();
        tournament.handle(outage());
        for (part, what) in [
            (&seat, "seat"),
            (&tournament.part, "place in the tournament"),
        ] {
            let error = print_end(part, &hints).expect_err("it is lost");
            let words = "no connection for 600 s\nto resume: chefshat play --ticket T";
            assert_eq!(error.to_string(), format!("the {what} is lost: {words}"));
        }
    }

    /// A closed tournament reports no place before a game has counted.
    #[test]
    fn a_tournament_that_is_over_says_how_one_stands() {
        let standing = |participant, place, games| v1::TournamentStanding {
            participant,
            place,
            games,
            score: 6,
            ..v1::TournamentStanding::default()
        };
        let closed = "the tournament was closed before its end";
        let table = [
            (
                vec![standing(0, 0, 0), standing(1, 0, 0)],
                ": no game was counted",
            ),
            (
                vec![standing(0, 1, 3), standing(1, 2, 4)],
                ": you are 2nd of 2, score 1.50 a game in 4 games",
            ),
            (Vec::new(), ""),
        ];
        for (standings, words) in table {
            let mut lobby = Lobby::new("7ea82e54d878816e4e9bde8b21aa7dce".into(), 1);
            lobby.report = Some(Report {
                standings,
                ..Report::default()
            });
            assert_eq!(
                crate::tui::play::ending::standing(&lobby, closed),
                format!("{closed}{words}")
            );
        }
    }
}
