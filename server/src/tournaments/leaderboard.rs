//! The ratings of all who have played a rated game on this server, worked out from the summaries of its games. They are worked out anew when
//! somebody asks and games have ended since, but not more often than [`LEADERBOARD_AGE`] allows.

use std::collections::BTreeSet;
use std::sync::Arc;

use chefshat_arena::BuiltInAgent;
use chefshat_arena::ratings::Ratings;
use chefshat_proto::v1;
use tokio::sync::Mutex;
use tokio::time::Instant;

use crate::config::LEADERBOARD_AGE;
use crate::store::{Store, StoreError};

/// Summaries read at a time.
const PAGE: usize = 1_000;

/// Who is rated: name, number of the kind, and whether it is a built-in agent.
pub type Who = (String, i32, bool);

/// Why there is no leaderboard.
pub type BoardError = StoreError;

/// The leaderboard of a server.
#[derive(Debug)]
pub struct Leaderboard {
    store: Arc<dyn Store>,
    /// The ratings, and when they were worked out.
    known: Mutex<Option<(Instant, Arc<Ratings<Who>>)>>,
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
    pub async fn ratings(&self) -> Result<Arc<Ratings<Who>>, BoardError> {
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

    async fn work_out(&self) -> Result<Ratings<Who>, BoardError> {
        let filter = v1::RecordFilter {
            state: v1::RoomState::Finished.into(),
            origin: v1::GameOrigin::Dealt.into(),
            hosted_here: true,
            ..v1::RecordFilter::default()
        };
        let mut games: Vec<(u64, String, Vec<(Who, u32)>)> = Vec::new();
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
fn rated(summary: &v1::RecordSummary) -> Option<Vec<(Who, u32)>> {
    if summary.substituted {
        return None;
    }
    let mut different = BTreeSet::new();
    let mut placed = Vec::with_capacity(summary.seats.len());
    for standing in &summary.standings {
        let seat = summary
            .seats
            .iter()
            .find(|seat| seat.seat == standing.seat)?;
        let built_in = !seat.built_in_agent.is_empty();
        let name = match built_in {
            true if seat.built_in_agent == BuiltInAgent::REPLAY => return None,
            true => &seat.built_in_agent,
            false => &seat.name,
        };
        let who = (name.clone(), seat.kind, built_in);
        if !different.insert(who.clone()) {
            return None;
        }
        placed.push((who, standing.place));
    }
    (placed.len() >= 2).then_some(placed)
}
