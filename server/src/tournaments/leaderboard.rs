//! The ratings of all who have played a rated game on this server, worked out from the summaries of its games. They are worked out anew when
//! somebody asks and games have ended since, but not more often than [`LEADERBOARD_AGE`] and [`LEADERBOARD_PART`] allow: all summaries are read
//! each time, since ratings go by when games ended, which is not the order in which the store has them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::BuiltInAgent;
use chefshat_proto::v1;
use chefshat_record::outcome::Identity;
use chefshat_tournament::ratings::Ratings;
use tokio::time::Instant;

use super::shared::{NotWorkedOut, Shared};
use crate::config::{LEADERBOARD_AGE, LEADERBOARD_PART};
use crate::rooms::Rooms;
use crate::store::{Part, Store, StoreError};

/// Summaries read at a time.
const PAGE: usize = 1_000;

/// A rated game: when it ended, its id, and who took which place.
type RatedGame = (u64, String, Vec<(Identity, u32)>);

/// The leaderboard of a server.
#[derive(Debug)]
pub struct Leaderboard {
    rooms: Arc<Rooms>,
    known: Shared<Board>,
}

/// Ratings that were worked out.
#[derive(Debug)]
struct Board {
    ratings: Arc<Ratings<Identity>>,
    /// Games that had ended before.
    ended: u64,
    /// When they had been worked out, and how long that took.
    at: Instant,
    took: Duration,
}

impl Board {
    /// Whether it can be shown when so many games have ended.
    fn serves(&self, ended: u64) -> bool {
        let rest = LEADERBOARD_AGE.max(self.took * LEADERBOARD_PART);
        self.ended == ended || self.at.elapsed() < rest
    }
}

impl Leaderboard {
    /// The leaderboard of the games of these rooms' store.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            known: Shared::default(),
        }
    }

    /// The ratings as they are now, or were a moment ago.
    ///
    /// # Errors
    /// The store's.
    pub async fn ratings(&self) -> Result<Arc<Ratings<Identity>>, NotWorkedOut> {
        let rooms = Arc::clone(&self.rooms);
        let work = async move {
            let (began, ended) = (Instant::now(), rooms.ended());
            let games = rated_games(rooms.store().as_ref()).await?;
            let folding = tokio::task::spawn_blocking(move || folded(games));
            Ok(Board {
                ratings: Arc::new(folding.await?),
                ended,
                at: Instant::now(),
                took: began.elapsed(),
            })
        };
        let ended = self.rooms.ended();
        let board = self.known.get(|board| board.serves(ended), work).await?;
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
fn folded(mut games: Vec<RatedGame>) -> Ratings<Identity> {
    games.sort_by(|one, other| (one.0, &one.1).cmp(&(other.0, &other.1)));
    let mut ratings = Ratings::default();
    for (_, _, placed) in &games {
        // Those that tell nothing were left out before.
        let _ = ratings.fold(placed);
    }
    ratings
}

/// Who took which place in a game that is rated; `None` if it is not.
fn rated(summary: &v1::RecordSummary) -> Option<Vec<(Identity, u32)>> {
    let replayed = |seat: &v1::Participant| seat.built_in_agent == BuiltInAgent::REPLAY;
    if summary.substituted || summary.seats.iter().any(replayed) {
        return None;
    }
    let places: BTreeMap<u32, u32> = (summary.standings.iter())
        .map(|standing| (standing.seat, standing.place))
        .collect();
    let placed: BTreeMap<Identity, u32> = (summary.seats.iter())
        .map(|seat| Some((Identity::of(seat), *places.get(&seat.seat)?)))
        .collect::<Option<_>>()?;
    // Who had more than one seat stands there once.
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
            at: Instant::now(),
            took,
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_board_serves_until_games_have_ended_and_it_has_its_age() {
        let board = board(3, Duration::ZERO);
        assert!(board.serves(3) && board.serves(4));
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(board.serves(3));
        assert!(!board.serves(4));
    }

    #[tokio::test(start_paused = true)]
    async fn one_that_took_long_serves_long() {
        let board = board(3, LEADERBOARD_AGE);
        tokio::time::advance(LEADERBOARD_AGE * (LEADERBOARD_PART - 1)).await;
        assert!(board.serves(4));
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(!board.serves(4));
    }
}
