//! The ratings of all participants of rated games on this server and on those that share its store,
//! computed from the summaries of the games. They are brought up to date on request, as often as
//! [`LEADERBOARD_AGE`] and [`LEADERBOARD_SHARE`] allow, from the games that the store has listed
//! since. Now and then all are read again, because games may have been deleted, here or elsewhere.
//! In memory are the ratings and few games ([`HELD_BACK`]), however many are read.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_record::outcome::Identity;
use chefshat_record::rated::{RatedSeat, rated};
use chefshat_tournament::ratings::{Finish, Ratings};
use tokio::sync::Mutex;
use tokio::time::Instant;

use super::shared::{ComputeError, Shared};
use crate::rooms::Rooms;
use chefshat_store::{Listed, Part, Store, StoreError};

/// How old a cached leaderboard may be.
const LEADERBOARD_AGE: Duration = Duration::from_secs(2);
/// Time between two readings of all games for the leaderboard: until then it may count games that
/// were deleted, and show a name that another node deleted.
const LEADERBOARD_READ_AGAIN: Duration = Duration::from_secs(600);
/// 1/N of the time may be spent computing the leaderboard.
const LEADERBOARD_SHARE: u32 = 10;

/// Summaries read at a time.
const PAGE: usize = 1_000;
/// Games that are held back before they are rated. Ratings follow the order in which games ended;
/// the store lists them in that of their commits, which differs by a few games.
const HELD_BACK: usize = 1_000;

/// The leaderboard of a server.
#[derive(Debug)]
pub struct Leaderboard {
    rooms: Arc<Rooms>,
    known: Shared<Board>,
    /// What was read so far; taken by who reads on.
    folded: Arc<Mutex<Option<Folded>>>,
}

/// Computed ratings.
#[derive(Debug)]
struct Board {
    /// Those before, if the store failed, or why there are none.
    ratings: Result<Arc<Ratings<Identity>>, ComputeError>,
    /// Number of participants whose data had been deleted before.
    forgotten: u64,
    /// When they were computed, and how long that took.
    at: Instant,
    took: Duration,
}

impl Board {
    /// Whether it is still valid after this number of forgotten participants.
    fn is_current(&self, forgotten: u64) -> bool {
        let rest = LEADERBOARD_AGE.max(self.took * LEADERBOARD_SHARE);
        self.forgotten == forgotten && self.at.elapsed() < rest
    }
}

/// The games up to a number of the store's list.
#[derive(Debug)]
struct Folded {
    ratings: Ratings<Identity>,
    /// The newest games, by when they ended and their ids, with the results of their participants.
    held_back: BTreeMap<(u64, String), Vec<(Identity, Finish)>>,
    /// The ratings after all games, when all had been read.
    shown: Option<Arc<Ratings<Identity>>>,
    /// The last number.
    after: u64,
    /// Number of participants whose data had been deleted when the first game was read, and when
    /// that was.
    forgotten: u64,
    since: Instant,
}

impl Folded {
    fn new(forgotten: u64) -> Self {
        Self {
            ratings: Ratings::default(),
            held_back: BTreeMap::new(),
            shown: None,
            after: 0,
            forgotten,
            since: Instant::now(),
        }
    }

    /// Whether nothing that it has read is known to be deleted.
    fn is_valid(&self, forgotten: u64) -> bool {
        self.forgotten == forgotten && self.since.elapsed() < LEADERBOARD_READ_AGAIN
    }

    fn add(&mut self, page: Vec<Listed>) {
        for listed in page {
            self.after = listed.number;
            // One that cannot be read is named in the log.
            let Ok(summary) = listed.summary else {
                continue;
            };
            if let Some(placed) = results(&summary) {
                let ended = (summary.ended_at_ms, summary.game_id);
                self.held_back.insert(ended, placed);
            }
            if self.held_back.len() > HELD_BACK
                && let Some((_, placed)) = self.held_back.pop_first()
            {
                // Games without information were left out before.
                let _ = self.ratings.fold_finishes(&placed);
            }
        }
    }

    /// The ratings after all games so far.
    fn ratings(&self) -> Ratings<Identity> {
        let mut ratings = self.ratings.clone();
        for placed in self.held_back.values() {
            let _ = ratings.fold_finishes(placed);
        }
        ratings
    }
}

impl Leaderboard {
    /// Creates the leaderboard of the games in these rooms' store.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            known: Shared::default(),
            folded: Arc::default(),
        }
    }

    /// The current ratings, at most a moment old.
    ///
    /// # Errors
    /// The store failed.
    pub async fn ratings(&self) -> Result<Arc<Ratings<Identity>>, ComputeError> {
        let rooms = Arc::clone(&self.rooms);
        let known = Arc::clone(&self.folded);
        let work = async move {
            let (began, forgotten) = (Instant::now(), rooms.forgotten());
            // One works at a time.
            let former = known.lock().await.take();
            let former = former.filter(|it| it.forgotten == forgotten);
            let shown = former.as_ref().and_then(|it| it.shown.clone());
            let folded = former.filter(|it| it.is_valid(forgotten));
            let folded = folded.unwrap_or_else(|| Folded::new(forgotten));
            let (folded, failed) = read_on(rooms.store().as_ref(), folded).await?;
            let rating = tokio::task::spawn_blocking(move || {
                let ratings = match failed {
                    None => Ok(Arc::new(folded.ratings())),
                    Some(error) => shown.ok_or(error.into()),
                };
                (ratings, folded)
            });
            let (ratings, mut folded) = rating.await?;
            folded.shown = ratings.clone().ok();
            *known.lock().await = Some(folded);
            Ok(Board {
                ratings,
                forgotten,
                at: Instant::now(),
                took: began.elapsed(),
            })
        };
        let forgotten = self.rooms.forgotten();
        let board = self
            .known
            .get(|board| board.is_current(forgotten), work)
            .await?;
        board.ratings.clone()
    }
}

/// Adds what a store has listed since, page by page. Returns also why it stopped before the last one.
async fn read_on(
    store: &dyn Store,
    mut folded: Folded,
) -> Result<(Folded, Option<StoreError>), ComputeError> {
    let filter = v1::RecordFilter {
        origin: v1::GameOrigin::Dealt.into(),
        hosted_here: true,
        ..v1::RecordFilter::default()
    };
    loop {
        let page = match store.list(&filter, Part::After(folded.after), PAGE).await {
            Ok(page) if page.is_empty() => return Ok((folded, None)),
            Ok(page) => page,
            Err(error) => return Ok((folded, Some(error))),
        };
        let folding = tokio::task::spawn_blocking(move || {
            folded.add(page);
            folded
        });
        folded = folding.await?;
    }
}

/// The results of a rated game; `None` if it is not rated.
fn results(summary: &v1::RecordSummary) -> Option<Vec<(Identity, Finish)>> {
    Some(rated(summary).ok()?.into_iter().map(finish).collect())
}

/// The result of a participant, for ratings.
pub fn finish(seat: RatedSeat) -> (Identity, Finish) {
    let finish = match (seat.forfeited, seat.place) {
        (true, _) => Finish::Forfeited,
        (false, Some(place)) => Finish::Place(place),
        (false, None) => Finish::Unplaced,
    };
    (seat.identity, finish)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::atomic::Ordering;

    use chefshat_room::ids::Id;
    use chefshat_room::journal::GameHeader;
    use chefshat_room::testing::Chance;

    use crate::rooms::NewRoom;
    use crate::tournaments::leaderboard::*;
    use chefshat_store::MemoryStore;
    use chefshat_store::testing::FailingStore;

    /// Participants of equal skill, one of whom hosts games of its own.
    const PLAYERS: usize = 18;
    const FARMER: usize = 0;

    /// What the farmer does when it is not first in one of its own games.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    enum Trick {
        /// Nothing.
        Honest,
        /// It closes the room.
        Closes,
        /// It closes the room, in which the server cannot tell the participants apart.
        ClosesAmongItsOwn,
        /// It leaves, and a substitute plays on.
        Leaves,
        /// It leaves, and the policy of its room aborts the game.
        LeavesAndAborts,
        /// It asks for a hint.
        AsksForHint,
    }

    /// The summary of a game of these participants, best first.
    fn game(order: &[usize], trick: Trick) -> v1::RecordSummary {
        use v1::{AbortReason, RoomState};
        let is_played = order[0] == FARMER || !order.contains(&FARMER);
        let trick = if is_played { Trick::Honest } else { trick };
        let (state, reason) = match trick {
            Trick::Honest | Trick::Leaves | Trick::AsksForHint => {
                (RoomState::Finished, AbortReason::Unspecified)
            }
            Trick::Closes | Trick::ClosesAmongItsOwn => (RoomState::Aborted, AbortReason::Closed),
            Trick::LeavesAndAborts => (RoomState::Aborted, AbortReason::ParticipantsLost),
        };
        let seat = |(seat, who): (u32, &usize)| v1::Participant {
            seat,
            name: format!("player {who}"),
            kind: v1::ParticipantKind::Agent.into(),
            substituted: match trick {
                Trick::Honest => false,
                Trick::ClosesAmongItsOwn => true,
                _ => *who == FARMER,
            },
            ..v1::Participant::default()
        };
        let standing = |seat| v1::Standing {
            seat,
            points: 0,
            place: seat + 1,
        };
        v1::RecordSummary {
            state: state.into(),
            abort_reason: reason.into(),
            origin: v1::GameOrigin::Dealt.into(),
            seats: (0..).zip(order).map(seat).collect(),
            standings: match state {
                RoomState::Finished => (0..4).map(standing).collect(),
                _ => Vec::new(),
            },
            substituted: trick == Trick::Leaves,
            hinted: trick == Trick::AsksForHint,
            ..v1::RecordSummary::default()
        }
    }

    /// The ratings after the same games, with or without a trick.
    fn rated_with(trick: Trick) -> Ratings<Identity> {
        let mut chance = Chance(1);
        let mut games = Vec::new();
        for number in 0..372 {
            // Of the games 72 are the farmer's.
            let is_own = number % 31 < 6;
            let mut order = if is_own { vec![FARMER] } else { Vec::new() };
            while order.len() < 4 {
                let who = 1 + chance.index(PLAYERS - 1);
                if !order.contains(&who) {
                    order.push(who);
                }
            }
            for index in (1..4).rev() {
                order.swap(index, chance.index(index + 1));
            }
            if let Some(results) = results(&game(&order, trick)) {
                games.push((number, String::new(), results));
            }
        }
        restored(games)
    }

    fn farmer() -> Identity {
        Identity {
            name: format!("player {FARMER}"),
            kind: v1::ParticipantKind::Agent,
            built_in: false,
            name_fingerprint: String::new(),
        }
    }

    #[test]
    fn nobody_gains_by_breaking_off_the_games_that_it_does_not_win() {
        let honest = rated_with(Trick::Honest).rating(&farmer());
        for trick in [
            Trick::Closes,
            Trick::ClosesAmongItsOwn,
            Trick::Leaves,
            Trick::LeavesAndAborts,
            Trick::AsksForHint,
        ] {
            let ratings = rated_with(trick);
            let farmed = ratings.rating(&farmer());
            assert!(
                farmed.mean <= honest.mean,
                "{trick:?}: {farmed:?}, {honest:?}"
            );
            assert!(farmed.cautious() <= honest.cautious(), "{trick:?}");
            let board = ratings.leaderboard(|_| true, 0);
            assert_ne!(board[0].0, &farmer(), "{trick:?}");
            assert_eq!(
                ratings.get(&farmer()).expect("it played").games,
                72,
                "{trick:?}"
            );
        }
    }

    #[test]
    fn who_did_not_break_a_game_off_gains_from_it_and_is_not_compared_with_the_others() {
        let mut ratings = Ratings::default();
        let results = results(&game(&[1, 2, FARMER, 3], Trick::Closes)).expect("rated");
        ratings.fold_finishes(&results).expect("a game of four");
        let rating = |who: usize| {
            let identity = Identity {
                name: format!("player {who}"),
                ..farmer()
            };
            ratings.rating(&identity)
        };
        assert!(rating(FARMER).mean < chefshat_tournament::ratings::FIRST_MEAN);
        assert!(rating(1).mean > chefshat_tournament::ratings::FIRST_MEAN);
        assert_eq!((rating(1), rating(2)), (rating(2), rating(3)));
    }

    #[test]
    fn summaries_of_earlier_versions_that_name_nobody_are_not_rated() {
        for trick in [
            Trick::Closes,
            Trick::Leaves,
            Trick::LeavesAndAborts,
            Trick::AsksForHint,
        ] {
            let mut summary = game(&[1, 2, FARMER, 3], trick);
            assert!(results(&summary).is_some());
            for seat in &mut summary.seats {
                seat.substituted = false;
            }
            assert_eq!(results(&summary), None, "{trick:?}");
        }
        // All were lost: the network or the server was.
        let mut summary = game(&[1, 2, FARMER, 3], Trick::LeavesAndAborts);
        for seat in &mut summary.seats {
            seat.substituted = true;
        }
        assert_eq!(results(&summary), None);
    }

    /// The number, room and results of a game.
    type Played = (u64, String, Vec<(Identity, Finish)>);

    /// The ratings after these games, in their order.
    fn restored(games: Vec<Played>) -> Ratings<Identity> {
        let mut ratings = Ratings::default();
        for (_, _, results) in &games {
            ratings.fold_finishes(results).expect("a rated game");
        }
        ratings
    }

    fn board(took: Duration) -> Board {
        Board {
            ratings: Ok(Arc::default()),
            forgotten: 0,
            at: Instant::now(),
            took,
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_board_is_valid_until_it_is_old() {
        let board = board(Duration::ZERO);
        assert!(board.is_current(0));
        assert!(!board.is_current(1), "it shows a name that was deleted");
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(!board.is_current(0));
    }

    #[tokio::test(start_paused = true)]
    async fn a_board_that_took_long_is_valid_for_longer() {
        let board = board(LEADERBOARD_AGE);
        tokio::time::advance(LEADERBOARD_AGE * (LEADERBOARD_SHARE - 1)).await;
        assert!(board.is_current(0));
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert!(!board.is_current(0));
    }

    /// A game of two that the first wins.
    fn summary(game: u64, winner: &str) -> v1::RecordSummary {
        let names = [winner, "Bo"];
        v1::RecordSummary {
            game_id: format!("{game:032x}"),
            state: v1::RoomState::Finished.into(),
            origin: v1::GameOrigin::Dealt.into(),
            ended_at_ms: game,
            seats: (names.iter().zip(0..))
                .map(|(name, seat)| v1::Participant {
                    seat,
                    name: (*name).into(),
                    ..v1::Participant::default()
                })
                .collect(),
            standings: (0..2)
                .map(|seat| v1::Standing {
                    seat,
                    place: seat + 1,
                    ..v1::Standing::default()
                })
                .collect(),
            ..v1::RecordSummary::default()
        }
    }

    /// The rooms of a node that has this store.
    fn rooms(store: &Arc<dyn Store>) -> Arc<Rooms> {
        Rooms::for_tests(Arc::clone(store))
    }

    /// Stores a game that another node has played.
    async fn played(store: &dyn Store, header: &GameHeader, game: u64, winner: &str) {
        let header = GameHeader {
            game_id: Id::from_bytes(u128::from(game).to_be_bytes()),
            ..header.clone()
        };
        let created = store.create(Arc::new(header), Vec::new()).await;
        let mut journal = created.expect("a new game");
        let finished = journal.finish(Some(Box::new(summary(game, winner))), None);
        finished.await.expect("committed");
    }

    fn names(ratings: &Ratings<Identity>) -> BTreeSet<String> {
        let all = ratings.leaderboard(|_| true, 0);
        all.iter().map(|(who, _)| format!("{who:?}")).collect()
    }

    #[tokio::test(start_paused = true)]
    async fn a_node_where_no_game_ends_shows_those_of_others() {
        let store: Arc<dyn Store> = Arc::new(MemoryStore::default());
        let rooms = rooms(&store);
        let created = rooms.create(NewRoom::for_tests()).await.expect("a room");
        let header = rooms.header(created.handle.id()).expect("it exists");
        let board = Leaderboard::new(Arc::clone(&rooms));
        assert_eq!(board.ratings().await.expect("readable").games(), 0);
        for (game, winner) in [(1, "Ada"), (2, "Cem")] {
            played(store.as_ref(), &header, game, winner).await;
            tokio::time::advance(LEADERBOARD_AGE).await;
            let ratings = board.ratings().await.expect("readable");
            assert_eq!(ratings.games(), game);
        }
        // A deleted game counts until all are read again.
        store
            .delete(vec![Id::from_bytes(1_u128.to_be_bytes())])
            .await
            .expect("deleted");
        tokio::time::advance(LEADERBOARD_READ_AGAIN).await;
        let ratings = board.ratings().await.expect("readable");
        assert_eq!(ratings.games(), 1);
        assert_eq!(names(&ratings).len(), 2);
    }

    #[tokio::test(start_paused = true)]
    async fn a_store_that_fails_is_read_on_after_a_while_and_the_ratings_before_stay() {
        let store = Arc::new(FailingStore::after(u64::MAX));
        let rooms = rooms(&(Arc::clone(&store) as Arc<dyn Store>));
        let created = rooms.create(NewRoom::for_tests()).await.expect("a room");
        let header = rooms.header(created.handle.id()).expect("it exists");
        let board = Leaderboard::new(Arc::clone(&rooms));
        let reads = || store.take_reads().len();
        played(store.as_ref(), &header, 1, "Ada").await;
        // The first page can be read, and not the second.
        store.lists_left.store(1, Ordering::Relaxed);
        assert!(board.ratings().await.is_err());
        assert_eq!(reads(), 1);
        store.lists_left.store(u64::MAX, Ordering::Relaxed);
        assert!(board.ratings().await.is_err());
        assert_eq!(reads(), 0, "it is asked later");
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert_eq!(board.ratings().await.expect("readable").games(), 1);
        assert_eq!(reads(), 1, "the first page is known");

        played(store.as_ref(), &header, 2, "Cem").await;
        store.lists_left.store(0, Ordering::Relaxed);
        tokio::time::advance(LEADERBOARD_AGE).await;
        assert_eq!(board.ratings().await.expect("those before").games(), 1);
        // Those before may show a name that has been deleted.
        rooms.count_forgotten();
        assert!(board.ratings().await.is_err());
    }

    #[tokio::test]
    async fn pages_give_the_ratings_of_all_games_in_the_order_of_their_ends() {
        let winners = ["Ada", "Cem", "Dora"];
        let count = 2 * HELD_BACK as u64 + 77;
        // Their commits come in another order, as those of several nodes.
        let shuffled = |place: u64| place ^ 5;
        let numbered = (0..count - count % 8).map(|place| {
            let game = shuffled(place);
            let summary = summary(game + 1, winners[(game % 3) as usize]);
            Listed {
                number: place + 1,
                owner: None,
                summary: Ok(summary),
            }
        });
        let numbered: Vec<Listed> = numbered.collect();
        let mut folded = Folded::new(0);
        for page in numbered.chunks(100) {
            folded.add(page.to_vec());
            assert!(folded.held_back.len() <= HELD_BACK);
        }
        let games = numbered
            .into_iter()
            .filter_map(|listed| listed.summary.ok());
        let mut games: Vec<_> = games.collect();
        games.sort_by_key(|game| game.ended_at_ms);
        let mut expected = Ratings::default();
        for game in &games {
            let placed = results(game).expect("it is rated");
            expected.fold_finishes(&placed).expect("a game of two");
        }
        assert_eq!(folded.ratings(), expected);
    }
}
