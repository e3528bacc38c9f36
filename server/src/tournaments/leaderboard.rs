//! The ratings of all who have played a rated game on this server, worked out from the summaries of its games. They are worked out anew when
//! somebody asks and games have ended since, but not more often than [`LEADERBOARD_AGE`] allows.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_arena::BuiltInAgent;
use chefshat_arena::ratings::Ratings;
use chefshat_proto::v1;
use chefshat_records::outcome::Identity;
use tokio::sync::Mutex;
use tokio::time::Instant;

use crate::config::LEADERBOARD_AGE;
use crate::store::{Store, StoreError};

/// Summaries read at a time.
const PAGE: usize = 1_000;

/// A rated game: when it ended, its id, and who took which place.
type RatedGame = (u64, String, Vec<(Identity, u32)>);

/// Why there is no leaderboard.
pub type BoardError = StoreError;

/// The leaderboard of a server.
#[derive(Debug)]
pub struct Leaderboard {
    store: Arc<dyn Store>,
    /// The ratings, and when they were worked out.
    known: Mutex<Option<(Instant, Arc<Ratings<Identity>>)>>,
}

impl Leaderboard {
    /// The leaderboard of the games of a store.
    pub fn new(store: Arc<dyn Store>) -> Self {
        Self {
            store,
            known: Mutex::new(None),
        }
    }

    /// The ratings as they are now, or were a moment ago.
    ///
    /// # Errors
    /// The store's.
    pub async fn ratings(&self) -> Result<Arc<Ratings<Identity>>, BoardError> {
        // Whoever asks meanwhile waits for the same answer.
        let mut known = self.known.lock().await;
        if let Some((at, ratings)) = known.as_ref()
            && at.elapsed() < LEADERBOARD_AGE
        {
            return Ok(Arc::clone(ratings));
        }
        let ratings = Arc::new(self.work_out().await?);
        *known = Some((Instant::now(), Arc::clone(&ratings)));
        Ok(ratings)
    }

    async fn work_out(&self) -> Result<Ratings<Identity>, BoardError> {
        let filter = v1::RecordFilter {
            state: v1::RoomState::Finished.into(),
            origin: v1::GameOrigin::Dealt.into(),
            hosted_here: true,
            ..v1::RecordFilter::default()
        };
        let mut games: Vec<RatedGame> = Vec::new();
        let mut after = 0;
        loop {
            let page = self.store.list(&filter, after, PAGE).await?;
            let Some((last, _)) = page.last() else { break };
            after = *last;
            for (_, summary) in page {
                if let Some(placed) = rated(&summary) {
                    games.push((summary.ended_at_ms, summary.game_id, placed));
                }
            }
        }
        // Games are numbered as they were made; ratings go by when they ended.
        games.sort_by(|one, other| (one.0, &one.1).cmp(&(other.0, &other.1)));
        let mut ratings = Ratings::default();
        for (_, _, placed) in &games {
            // Those that tell nothing were left out above.
            let _ = ratings.fold(placed);
        }
        Ok(ratings)
    }
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
