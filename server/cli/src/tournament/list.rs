//! `chefshat tournament list` and `chefshat tournament games`: list tournaments and games, one per
//! line.

use std::process::ExitCode;

use chefshat_client::{Client, v1};
use clap::Args;

use super::super::connect::{SecretArgs, ServerArg};
use super::super::numbers::{counted, ordinal};
use super::super::policy_args::visibility_mark;
use super::super::{CommandError, pages, say};
use super::words::{STATES, format_name, state};
use crate::choice::choice;
use crate::narration::clean;

/// Page size of the list of games.
const GAMES_PAGE: u32 = 500;

/// List the tournaments of a server, newest first.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  chefshat tournament list --state open")]
pub(super) struct List {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Only tournaments in this state.
    #[arg(long, value_parser = choice(&STATES))]
    state: Option<v1::TournamentState>,
    /// Print each tournament as a JSON line.
    #[arg(long)]
    json: bool,
}

/// List the games of a tournament, with their results and records.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament games 5f0c6a4de2b14b7f8a3d9c1e7b60425d --round 2\n  \
                  chefshat tournament games 5f0c6a4de2b14b7f8a3d9c1e7b60425d --json\n\n\
                  A record lies in the server's data directory as records/GAME-ID.jsonl; `chefshat records get GAME-ID` fetches it."
)]
pub(super) struct Games {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    tournament_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Only games of this round, from 1.
    #[arg(long, value_name = "ROUND")]
    round: Option<u32>,
    /// Print each game as a JSON line.
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let fetch = async |page_token| {
            let request = v1::ListTournamentsRequest {
                page_size: pages::PAGE,
                page_token,
                state: self.state.unwrap_or_default().into(),
            };
            let page = client.list_tournaments(request).await?;
            Ok((page.tournaments, page.next_page_token))
        };
        pages::print(fetch, self.json, in_a_line, "no tournaments").await
    }
}

impl Games {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let participants = client
            .tournament(self.tournament_id.as_str())
            .await?
            .participants;
        let wanted = |game: &v1::TournamentGame| self.round.is_none_or(|round| game.round == round);
        let mut count = 0;
        for game in all_games(&client, &self.tournament_id).await? {
            if !wanted(&game) {
                continue;
            }
            count += 1;
            if self.json {
                let record = record_of(&game);
                say(serde_json::json!({"event": "game", "game": game, "record": record}))?;
            } else {
                say(game_in_a_line(&game, &participants))?;
            }
        }
        if count == 0 && !self.json {
            say("no games have been drawn")?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// All games that have been drawn, in order.
///
/// # Errors
/// `TOURNAMENT_UNKNOWN`.
pub(super) async fn all_games(
    client: &Client,
    tournament_id: &str,
) -> Result<Vec<v1::TournamentGame>, CommandError> {
    let fetch = async |page_token| {
        let request = v1::ListTournamentGamesRequest {
            tournament_id: tournament_id.to_owned(),
            page_size: GAMES_PAGE,
            page_token,
        };
        let page = client.tournament_games(request).await?;
        Ok((page.games, page.next_page_token))
    };
    let mut games = Vec::new();
    let keep = |game| {
        games.push(game);
        Ok(())
    };
    pages::for_each(fetch, keep).await?;
    Ok(games)
}

/// Path of a game's record under the server's data directory, once it exists.
fn record_of(game: &v1::TournamentGame) -> Option<String> {
    let counted = game.state() == v1::TournamentGameState::Counted;
    counted.then(|| format!("records/{}.jsonl", clean(&game.game_id, 40)))
}

fn in_a_line(tournament: &v1::Tournament) -> String {
    let settings = tournament.settings.clone().unwrap_or_default();
    let games = counted(tournament.games.into(), "game");
    let policy = settings.policy.clone().unwrap_or_default();
    format!(
        "{}  {:<8}  {:<11}  {} of {games}  {}{}",
        clean(&tournament.tournament_id, 40),
        state(tournament.state()),
        format_name(settings.format()),
        tournament.games_over,
        clean(&settings.name, 40),
        visibility_mark(policy.visibility()),
    )
}

/// A game in one line: number, state, players with results, record.
pub(super) fn game_in_a_line(
    game: &v1::TournamentGame,
    participants: &[v1::TournamentParticipant],
) -> String {
    let name = |seat: &v1::TournamentGameSeat| {
        let who = usize::try_from(seat.participant)
            .ok()
            .and_then(|number| participants.get(number));
        who.map_or_else(
            || format!("participant {}", seat.participant),
            |who| clean(&who.name, 20),
        )
    };
    let over = game.state() == v1::TournamentGameState::Counted;
    let mut seats: Vec<&v1::TournamentGameSeat> = game.seats.iter().collect();
    if over {
        seats.sort_by_key(|seat| seat.place);
    }
    let seats: Vec<String> = seats
        .into_iter()
        .map(|seat| {
            let note = match (seat.forfeited, seat.left, seat.substituted) {
                (true, _, _) => " (forfeited)",
                (false, true, _) => " (left)",
                (false, false, true) => " (substituted)",
                (false, false, false) => "",
            };
            match over {
                true => format!(
                    "{} {} {}{note}",
                    ordinal(seat.place),
                    name(seat),
                    seat.points
                ),
                false => format!("{}{note}", name(seat)),
            }
        })
        .collect();
    let state = match game.state() {
        v1::TournamentGameState::Unspecified => "unknown",
        v1::TournamentGameState::Due => "due",
        v1::TournamentGameState::Playing => "playing",
        v1::TournamentGameState::Counted => "counted",
        v1::TournamentGameState::Void => "void",
    };
    let cards = if game.physical { "  (real cards)" } else { "" };
    let record = record_of(game).map_or_else(String::new, |record| format!("  {record}"));
    format!(
        "{:>4}  round {} table {} game {}  {state:<7}  {}{cards}{record}",
        game.game,
        game.round,
        game.table,
        game.number,
        seats.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use crate::tournament::list::*;

    #[test]
    fn a_game_fits_in_a_line() {
        let participant = |number, name: &str| v1::TournamentParticipant {
            participant: number,
            name: name.into(),
            ..v1::TournamentParticipant::default()
        };
        let participants = [participant(0, "Ada"), participant(1, "Bo\u{1b}[2J")];
        let seat = |participant, place, points| v1::TournamentGameSeat {
            participant,
            place,
            points,
            ..v1::TournamentGameSeat::default()
        };
        let mut game = v1::TournamentGame {
            game: 7,
            round: 2,
            table: 1,
            number: 1,
            state: v1::TournamentGameState::Counted.into(),
            seats: vec![seat(0, 2, 9), seat(1, 1, 15), seat(9, 3, 0)],
            game_id: "5f0c6a4de2b14b7f8a3d9c1e7b60425d".into(),
            ..v1::TournamentGame::default()
        };
        game.seats[0].substituted = true;
        game.seats[2].forfeited = true;
        assert_eq!(
            game_in_a_line(&game, &participants),
            "   7  round 2 table 1 game 1  counted  1st Bo[2J 15, 2nd Ada 9 (substituted), \
             3rd participant 9 0 (forfeited)  records/5f0c6a4de2b14b7f8a3d9c1e7b60425d.jsonl"
        );
        game.state = v1::TournamentGameState::Playing.into();
        game.physical = true;
        assert_eq!(
            game_in_a_line(&game, &participants),
            "   7  round 2 table 1 game 1  playing  Ada (substituted), Bo[2J, participant 9 (forfeited)  (real cards)"
        );
    }
}
