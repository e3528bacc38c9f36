//! Follows a tournament while the person plays in it, and finds the person's next game if the
//! server's report lacks it.

use chefshat_client::{Client, Error, v1};
use tokio::sync::mpsc;

use super::lobby::{Report, sits};
use super::part::PartInput;

/// Page size and maximum number of pages of games.
const GAMES_PAGE: u32 = 500;
const MAX_PAGES: usize = 20;

/// Passes on each report until the tournament is over.
pub(super) async fn follow(client: Client, entered: v1::Entered, heard: mpsc::Sender<PartInput>) {
    let mut follower = client.follow_tournament(&*entered.tournament_id);
    // The next game as found last.
    let mut found: Option<v1::TournamentGame> = None;
    loop {
        let mut report = match follower.next().await {
            Ok(Some(response)) => match Report::of(response) {
                Some(report) => report,
                None => continue,
            },
            Ok(None) => return,
            Err(error) => {
                // The receiver may be gone.
                let _ = heard
                    .send(PartInput::Unfollowed(error.message().to_owned()))
                    .await;
                return;
            }
        };
        // Reports of a round robin have only the games in progress.
        let round_robin = report.format() == v1::TournamentFormat::RoundRobin;
        let playing = report.tournament.state() == v1::TournamentState::Playing;
        if round_robin && playing && report.own_game(entered.participant).is_none() {
            // If the request fails, the last result is still valid.
            if let Ok(next) = next_game(&client, &entered).await {
                found = next;
            }
            report.next.clone_from(&found);
        }
        if heard
            .send(PartInput::Report(Box::new(report)))
            .await
            .is_err()
        {
            return;
        }
    }
}

/// The participant's first game that is due or in progress.
async fn next_game(
    client: &Client,
    entered: &v1::Entered,
) -> Result<Option<v1::TournamentGame>, Error> {
    let mut page_token = String::new();
    for _ in 0..MAX_PAGES {
        let request = v1::ListTournamentGamesRequest {
            tournament_id: entered.tournament_id.clone(),
            page_size: GAMES_PAGE,
            page_token,
        };
        let page = client.tournament_games(request).await?;
        let found = page.games.into_iter().find(|game| {
            use v1::TournamentGameState::{Due, Playing};
            [Due, Playing].contains(&game.state()) && sits(game, entered.participant)
        });
        if found.is_some() || page.next_page_token.is_empty() {
            return Ok(found);
        }
        page_token = page.next_page_token;
    }
    Ok(None)
}
