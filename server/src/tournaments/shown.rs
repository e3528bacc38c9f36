//! What everybody is shown of a tournament that takes a while to work out: what its followers are told, and its results. Both are worked out
//! on a copy, on threads that serve nobody, once for each change of the tournament, whoever asks how often.

use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_tournament::ratings::Ratings;
use chefshat_tournament::{Format, Game, GameState, State, Tournament};
use tokio::sync::Semaphore;

use super::handle::TournamentHandle;
use super::shared::{NotWorkedOut, Shared};
use crate::config::MAX_GAMES_FOLLOWED;
use crate::convert;

/// A message about a tournament, and where that stood.
#[derive(Debug)]
pub struct AsOf<M> {
    mark: Mark,
    /// The message.
    pub message: M,
}

/// Where a tournament stands, as far as that can be seen at once. The number of the last change comes a moment after the change; who was told
/// that a tournament has begun or is over is not to be shown how it stood before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Mark {
    change: u64,
    state: State,
    participants: usize,
    games: usize,
    over: usize,
}

/// What was shown last.
#[derive(Debug, Default)]
pub(super) struct Shown {
    told: Shared<AsOf<v1::FollowTournamentResponse>>,
    results: Shared<AsOf<v1::GetTournamentResultsResponse>>,
}

impl TournamentHandle {
    /// What followers are told now. It is worked out when one of the `turns` is free.
    ///
    /// # Errors
    /// It could not be worked out.
    pub async fn told(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
    ) -> Result<Arc<AsOf<v1::FollowTournamentResponse>>, NotWorkedOut> {
        let work = self.as_of_now(permits, Self::tell);
        let serves = |told: &AsOf<_>| told.mark == self.mark();
        self.shown.told.get(serves, work).await
    }

    /// The results now. They are worked out when one of the `turns` is free.
    ///
    /// # Errors
    /// They could not be worked out.
    pub async fn results(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
    ) -> Result<Arc<AsOf<v1::GetTournamentResultsResponse>>, NotWorkedOut> {
        let work = self.as_of_now(permits, Self::sum_up);
        let serves = |results: &AsOf<_>| results.mark == self.mark();
        self.shown.results.get(serves, work).await
    }

    fn mark(&self) -> Mark {
        let change = *self.changes.borrow();
        self.look(|core| Mark {
            change,
            state: core.state(),
            participants: core.participants().len(),
            games: core.games().len(),
            over: core.games_over(),
        })
    }

    /// What `work` makes of the tournament, on a thread that serves nobody.
    fn as_of_now<M: Send + 'static>(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
        work: fn(&Self) -> M,
    ) -> impl Future<Output = Result<AsOf<M>, NotWorkedOut>> + Send + use<M> {
        let (hosted, permits) = (Arc::clone(self), Arc::clone(permits));
        async move {
            // Nobody closes them; if somebody did, the work would merely not wait.
            let permit = permits.acquire_owned().await.ok();
            let working = tokio::task::spawn_blocking(move || {
                let _permit = permit;
                // The message may show more than the mark says, but not less.
                let mark = hosted.mark();
                let message = work(&hosted);
                AsOf { mark, message }
            });
            Ok(working.await?)
        }
    }

    fn tell(&self) -> v1::FollowTournamentResponse {
        // Copied and let go of: nobody waits while standings are worked out.
        let (core, games) = {
            let state = self.committed();
            let followed = followed(&state.core).into_iter();
            let games = followed.map(|number| self.game(&state, number)).collect();
            (state.core.clone(), games)
        };
        v1::FollowTournamentResponse {
            tournament: Some(self.described(&core)),
            standings: self.standings(&core),
            games,
        }
    }

    fn sum_up(&self) -> v1::GetTournamentResultsResponse {
        let core = self.look(Tournament::clone);
        v1::GetTournamentResultsResponse {
            tournament: Some(self.described(&core)),
            standings: self.standings(&core),
            confidence: convert::confidence_to_proto(&core),
        }
    }

    /// The standings, with ratings from the tournament's rated games alone.
    fn standings(&self, core: &Tournament) -> Vec<v1::TournamentStanding> {
        let ratings = match self.is_rated() {
            true => core.ratings(),
            false => Ratings::default(),
        };
        convert::standings_to_proto(core, &ratings)
    }
}

/// The games that followers are told of, in order: of a round robin those that are being played, else those of the round. If there are more
/// than [`MAX_GAMES_FOLLOWED`], those that are being played go before those that are over, the last of these before the first, and those that
/// are due come last.
fn followed(core: &Tournament) -> Vec<usize> {
    let (games, round) = (core.games(), core.round());
    let by_rounds = core.settings().format != Format::RoundRobin;
    let wanted = |number: &usize| !by_rounds || games[*number].round == round;
    let are = |state: fn(&Game) -> bool| {
        let numbers = (0..games.len()).filter(move |number| by_rounds && state(&games[*number]));
        numbers.filter(wanted)
    };
    let mut followed: Vec<usize> = core
        .playing()
        .filter(wanted)
        .chain(are(Game::is_over).rev())
        .chain(are(|game| game.state == GameState::Due))
        .take(MAX_GAMES_FOLLOWED)
        .collect();
    followed.sort_unstable();
    followed
}

#[cfg(test)]
mod tests;
