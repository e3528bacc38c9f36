//! The ratings of all participants of rated games on this server, computed from the summaries of
//! its games. They are recomputed on request if games have ended since, as often as
//! [`LEADERBOARD_AGE`] and [`LEADERBOARD_SHARE`] allow: all summaries are read each time, because
//! ratings follow the order in which games ended, which is not the order of the store.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::BuiltInAgent;
use chefshat_proto::v1;
use chefshat_record::outcome::Identity;
use chefshat_tournament::ratings::Ratings;
use tokio::time::Instant;

use super::shared::{ComputeError, Shared};
use crate::config::{LEADERBOARD_AGE, LEADERBOARD_SHARE};
use crate::rooms::Rooms;
use crate::store::{Part, Store, StoreError};

/// Summaries read at a time.
const PAGE: usize = 1_000;

/// A rated game: when it ended, its id, and the places of its participants.
type RatedGame = (u64, String, Vec<(Identity, u32)>);

/// The leaderboard of a server.
#[derive(Debug)]
pub struct Leaderboard {
    rooms: Arc<Rooms>,
    known: Shared<Board>,
}

/// Computed ratings.
#[derive(Debug)]
struct Board {
    ratings: Arc<Ratings<Identity>>,
    /// Number of games that had ended before.
    ended: u64,
    /// Number of participants whose data had been deleted before.
    forgotten: u64,
    /// When they were computed, and how long that took.
    at: Instant,
    took: Duration,
}

impl Board {
    /// Whether it is still valid after these numbers of ended games and forgotten participants.
    fn is_current(&self, ended: u64, forgotten: u64) -> bool {
        let rest = LEADERBOARD_AGE.max(self.took * LEADERBOARD_SHARE);
        self.forgotten == forgotten && (self.ended == ended || self.at.elapsed() < rest)
    }
}

impl Leaderboard {
    /// Creates the leaderboard of the games in these rooms' store.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            known: Shared::default(),
        }
    }

    /// The current ratings, at most a moment old.
    ///
    /// # Errors
    /// The store failed.
    pub async fn ratings(&self) -> Result<Arc<Ratings<Identity>>, ComputeError> {
        let rooms = Arc::clone(&self.rooms);
        let work = async move {
            let (began, ended) = (Instant::now(), rooms.ended());
            let forgotten = rooms.forgotten();
            let games = rated_games(rooms.store().as_ref()).await?;
            let folding = tokio::task::spawn_blocking(move || restored(games));
            Ok(Board {
                ratings: Arc::new(folding.await?),
                ended,
                forgotten,
                at: Instant::now(),
                took: began.elapsed(),
            })
        };
        let (ended, forgotten) = (self.rooms.ended(), self.rooms.forgotten());
        let board = self
            .known
            .get(|board| board.is_current(ended, forgotten), work)
            .await?;
        Ok(Arc::clone(&board.ratings))
    }
}

/// The rated games of a store, in its order.
async fn rated_games(store: &dyn Store) -> Result<Vec<RatedGame>, StoreError> {
    let filter = v1::RecordFilter {
        state: v1::RoomState::Finished.into(),
        origin: v1::GameOrigin::Dealt.into(),
        hosted_here: true,
        ..v1::RecordFilter::default()
    };
    let mut games = Vec::new();
    let mut after = 0;
    loop {
        let page = store.list(&filter, Part::After(after), PAGE).await?;
        let Some((last, _)) = page.last() else {
            return Ok(games);
        };
        after = *last;
        for (_, summary) in page {
            if let Some(placed) = rated(&summary) {
                games.push((summary.ended_at_ms, summary.game_id, placed));
            }
        }
    }
}

/// The ratings after these games, in the order in which they ended.
fn restored(mut games: Vec<RatedGame>) -> Ratings<Identity> {
    games.sort_by(|one, other| (one.0, &one.1).cmp(&(other.0, &other.1)));
    let mut ratings = Ratings::default();
    for (_, _, placed) in &games {
        // Games without information were left out before.
        let _ = ratings.fold(placed);
    }
    ratings
}

/// The places in a rated game; `None` if it is not rated.
fn rated(summary: &v1::RecordSummary) -> Option<Vec<(Identity, u32)>> {
    let replayed = |seat: &v1::Participant| seat.built_in_agent == BuiltInAgent::REPLAY;
    let wizard = |seat: &v1::Participant| seat.shown_kind() != v1::ParticipantKind::Unspecified;
    // What is not listed elsewhere does not show here either.
    let is_public = summary.visibility() == v1::Visibility::Unspecified;
    let helped = summary.substituted || summary.hinted;
    let unrated = |seat| replayed(seat) || wizard(seat);
    if !is_public || helped || summary.seats.iter().any(unrated) {
        return None;
    }
    let places: BTreeMap<u32, u32> = (summary.standings.iter())
        .map(|standing| (standing.seat, standing.place))
        .collect();
    let placed: BTreeMap<Identity, u32> = (summary.seats.iter())
        .map(|seat| Some((Identity::of(seat), *places.get(&seat.seat)?)))
        .collect::<Option<_>>()?;
    // A participant with more than one seat is listed once.
    let all_differ = placed.len() == summary.seats.len();
    (all_differ && placed.len() >= 2).then(|| placed.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use crate::tournaments::leaderboard::*;

    fn board(ended: u64, took: Duration) -> Board {
        Board {
            ratings: Arc::default(),
            ended,
            forgotten: 0,
            at: Instant::now(),
            took,
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_board_is_valid_until_it_is_old_and_games_have_ended() {
        let board = board(3, Duration::ZERO);
        assert!(board.is_current(3, 0) && board.is_current(4, 0));
        assert!(!board.is_current(3, 1), "it shows a name that was deleted");
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(board.is_current(3, 0));
        assert!(!board.is_current(4, 0));
    }

    #[tokio::test(start_paused = true)]
    async fn a_board_that_took_long_is_valid_for_longer() {
        let board = board(3, LEADERBOARD_AGE);
        tokio::time::advance(LEADERBOARD_AGE * (LEADERBOARD_SHARE - 1)).await;
        assert!(board.is_current(4, 0));
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(!board.is_current(4, 0));
    }
}
