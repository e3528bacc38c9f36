//! The public views of a tournament that are expensive to compute: updates for followers, and
//! results. Both are computed on a copy, on blocking threads, once for each change, however often
//! they are requested.

use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_tournament::ratings::Ratings;
use chefshat_tournament::{Format, Game, GameState, Tournament};
use tokio::sync::Semaphore;

use super::handle::TournamentHandle;
use super::shared::{AsOf, ComputeError, Mark};
use chefshat_wire::convert;

/// Most games in an update of a followed tournament. It keeps a message well below the 4 MB that
/// clients accept by default. At most half as many are played at a time.
const MAX_GAMES_FOLLOWED: usize = 512;

impl TournamentHandle {
    /// The current update for followers. Computed when a permit is available.
    ///
    /// # Errors
    /// The computation failed.
    pub async fn follower_update(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
    ) -> Result<Arc<AsOf<v1::FollowTournamentResponse>>, ComputeError> {
        let work = self.as_of_now(permits, Self::compute_update);
        let is_current = |follower_update: &AsOf<_>| follower_update.mark == self.mark();
        self.shared.follower_update.get(is_current, work).await
    }

    /// The current results. Computed when a permit is available.
    ///
    /// # Errors
    /// The computation failed.
    pub async fn results(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
    ) -> Result<Arc<AsOf<v1::GetTournamentResultsResponse>>, ComputeError> {
        let work = self.as_of_now(permits, Self::compute_results);
        let is_current = |results: &AsOf<_>| results.mark == self.mark();
        self.shared.results.get(is_current, work).await
    }

    fn mark(&self) -> Mark {
        let change = self.last_change();
        self.read(|core| Mark {
            change,
            state: core.state(),
            participants: core.participants().len(),
            games: core.games().len(),
            over: core.games_over(),
            by_hand: core.changes_by_hand(),
        })
    }

    /// Runs `work` on the tournament, on a blocking thread.
    fn as_of_now<M: Send + 'static>(
        self: &Arc<Self>,
        permits: &Arc<Semaphore>,
        work: fn(&Self) -> M,
    ) -> impl Future<Output = Result<AsOf<M>, ComputeError>> + Send + use<M> {
        let (handle, permits) = (Arc::clone(self), Arc::clone(permits));
        async move {
            // The semaphore is never closed; if it were, the work would merely not wait.
            let permit = permits.acquire_owned().await.ok();
            let working = tokio::task::spawn_blocking(move || {
                let _permit = permit;
                // The message may be newer than the mark, but not older.
                let mark = handle.mark();
                let message = work(&handle);
                AsOf { mark, message }
            });
            Ok(working.await?)
        }
    }

    fn compute_update(&self) -> v1::FollowTournamentResponse {
        // Copied, so that the lock is not held while standings are computed.
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

    fn compute_results(&self) -> v1::GetTournamentResultsResponse {
        let core = self.read(Tournament::clone);
        v1::GetTournamentResultsResponse {
            tournament: Some(self.described(&core)),
            standings: self.standings(&core),
            confidence: convert::confidence_to_proto(&core),
        }
    }

    /// The standings, with ratings from only the tournament's rated games.
    fn standings(&self, core: &Tournament) -> Vec<v1::TournamentStanding> {
        let ratings = match self.is_rated() {
            true => core.ratings(),
            false => Ratings::default(),
        };
        convert::standings_to_proto(core, &ratings)
    }
}

/// The games in updates for followers, in order: the running games of a round robin, else the games
/// of the round. If there are more than [`MAX_GAMES_FOLLOWED`], running games come first, then
/// ended ones, the last before the first, then games that are due.
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
