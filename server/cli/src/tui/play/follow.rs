//! Follows a tournament while the person plays in it, and finds the person's next game if the
//! server's report lacks it.

use chefshat_client::{Client, Error, v1};
use tokio::sync::mpsc;

use super::lobby::{Report, sits};
use super::part::PartInput;

/// Page size of games, and maximum number of pages for each report.
const GAMES_PAGE: u32 = 500;
const MAX_PAGES: usize = 20;

/// Passes on each report until the tournament is over.
pub(super) async fn follow(client: Client, entered: v1::Entered, heard: mpsc::Sender<PartInput>) {
    let mut follower = client.follow_tournament(&*entered.tournament_id);
    let mut search = Search::default();
    let page_of = |page_token| {
        let (client, tournament_id) = (client.clone(), entered.tournament_id.clone());
        async move {
            let request = v1::ListTournamentGamesRequest {
                tournament_id,
                page_size: GAMES_PAGE,
                page_token,
            };
            client.tournament_games(request).await
        }
    };
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
            let _ = search.go_on(entered.participant, page_of).await;
            report.next.clone_from(&search.next);
            report.is_searching = !search.is_known;
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

/// A search for the participant's next game, with each report a part: a round robin may have 200
/// pages of games.
#[derive(Default)]
struct Search {
    /// The page at which it continues; empty: the first.
    page_token: String,
    /// No page since the first has such a game.
    none_so_far: bool,
    /// The first game that is due or in progress, as found last.
    next: Option<v1::TournamentGame>,
    /// Whether it is known if there is one.
    is_known: bool,
}

impl Search {
    /// Continues. After an error, what was found last is still valid.
    async fn go_on<F>(
        &mut self,
        participant: u32,
        page_of: impl Fn(String) -> F,
    ) -> Result<(), Error>
    where
        F: Future<Output = Result<v1::ListTournamentGamesResponse, Error>>,
    {
        for _ in 0..MAX_PAGES {
            self.none_so_far |= self.page_token.is_empty();
            let page = page_of(self.page_token.clone()).await?;
            let found = page.games.into_iter().find(|game| {
                use v1::TournamentGameState::{Due, Playing};
                [Due, Playing].contains(&game.state()) && sits(game, participant)
            });
            let is_last = page.next_page_token.is_empty();
            if found.is_some() || (is_last && self.none_so_far) {
                // It may be on the same page the next time; without one it begins again.
                if found.is_none() {
                    self.page_token.clear();
                }
                self.none_so_far = false;
                self.next = found;
                self.is_known = true;
                return Ok(());
            }
            self.page_token = page.next_page_token;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// A page of a tournament with this many pages. Participant 1 has one game, on page `due`.
    fn page(token: &str, pages: usize, due: usize) -> v1::ListTournamentGamesResponse {
        let number = token.parse().unwrap_or(0);
        let game = v1::TournamentGame {
            state: v1::TournamentGameState::Due.into(),
            seats: vec![v1::TournamentGameSeat {
                participant: 1 + u32::from(number != due),
                ..v1::TournamentGameSeat::default()
            }],
            ..v1::TournamentGame::default()
        };
        let next = number + 1;
        v1::ListTournamentGamesResponse {
            games: vec![game],
            next_page_token: match next < pages {
                true => next.to_string(),
                false => String::new(),
            },
        }
    }

    #[tokio::test]
    async fn a_game_on_a_late_page_is_found_in_parts() {
        let (due, asked) = (Cell::new(45), Cell::new(0));
        let page_of = |token: String| {
            asked.set(asked.get() + 1);
            std::future::ready(Ok(page(&token, 50, due.get())))
        };
        let mut search = Search::default();
        for part in 1..=3 {
            assert!(!search.is_known, "before part {part}");
            search.go_on(1, page_of).await.expect("pages");
        }
        assert!(search.is_known && search.next.is_some());
        assert_eq!(asked.take(), 46);
        // It continues where it was.
        search.go_on(1, page_of).await.expect("pages");
        assert_eq!(asked.take(), 1);
        // That there is none is known once all pages have been seen.
        due.set(99);
        search.go_on(1, page_of).await.expect("pages");
        assert!(search.next.is_some(), "as found last");
        for _ in 0..2 {
            search.go_on(1, page_of).await.expect("pages");
        }
        assert!(search.is_known && search.next.is_none());
        assert!(asked.get() <= 3 * MAX_PAGES, "{}", asked.get());
    }
}
