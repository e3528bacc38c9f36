//! How often public views of a tournament are computed, and how large they can become.

use chefshat_engine::MAX_SEATS;
use chefshat_tournament::{Change, Ended, MAX_PARTICIPANTS, MAX_REPLACEMENTS, SeatStatistics};
use prost::Message as _;

use super::*;
use chefshat_room::ids::{GameId, Id, RoomId, SeriesId};
use chefshat_wire::convert::MAX_NAME_CHARS;

/// Default message limit of gRPC clients, bytes.
const DEFAULT_MESSAGE_LIMIT: usize = 4 * 1024 * 1024;

impl TournamentHandle {
    fn started(self: Arc<Self>) -> Arc<Self> {
        let started = self.read(Tournament::begin).expect("there are enough");
        for change in started {
            self.committed().core.fold(&change);
        }
        self
    }

    /// Calls all games that can be called.
    fn call_games(&self) {
        let mut state = self.committed();
        while let Some(change) = state.core.next(0) {
            if let Change::Called { game, .. } = change {
                state.placed.insert(game, (Id::random(), Id::random()));
            }
            state.core.fold(&change);
        }
    }

    /// Ends all called games.
    fn end_games(&self) {
        let mut state = self.committed();
        let playing: Vec<usize> = state.core.playing().collect();
        for game in playing {
            let seats = state.core.games()[game].seats.len();
            let seats = (1..=seats).map(|place| SeatStatistics {
                place,
                points: 3,
                ..SeatStatistics::default()
            });
            let ended = Ended::Played {
                shifts: 1,
                seats: seats.collect(),
            };
            let change = state.core.ended(game, ended).expect("it was played");
            state.core.fold(&change);
        }
    }
}

fn test_permits() -> Arc<Semaphore> {
    Arc::new(Semaphore::new(1))
}

#[tokio::test]
async fn views_are_computed_once_for_each_change() {
    let (handle, permits) = (TournamentHandle::for_tests(8), test_permits());
    let follower_update = handle.follower_update(&permits).await.expect("computed");
    let results = handle.results(&permits).await.expect("computed");
    let same = handle.follower_update(&permits).await.expect("computed");
    assert!(Arc::ptr_eq(&follower_update, &same));
    let same = handle.results(&permits).await.expect("computed");
    assert!(Arc::ptr_eq(&results, &same));
    handle.notify();
    let other = handle.follower_update(&permits).await.expect("computed");
    assert!(!Arc::ptr_eq(&follower_update, &other));
    // A client that learned of the start before the change was counted sees no earlier state.
    let handle = handle.started();
    let started = handle.results(&permits).await.expect("computed");
    let state = started.message.tournament.as_ref().map(|it| it.state());
    assert_eq!(state, Some(v1::TournamentState::Playing));
}

#[tokio::test]
async fn computing_waits_for_a_permit_without_holding_a_lock() {
    let (handle, permits) = (TournamentHandle::for_tests(8), test_permits());
    let taken = Arc::clone(&permits)
        .acquire_owned()
        .await
        .expect("it is open");
    let mut asking = Box::pin(handle.results(&permits));
    assert!(futures::poll!(&mut asking).is_pending());
    assert_eq!(handle.describe().participants.len(), 8);
    drop(taken);
    let results = asking.await.expect("computed");
    assert_eq!(results.message.standings.len(), 8);
}

#[test]
fn followers_receive_the_running_games_and_the_last_ones() {
    let handle = TournamentHandle::with_settings(
        64,
        v1::TournamentSettings {
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 1,
            games_per_pairing: 1_000,
            ..v1::TournamentSettings::default()
        },
    )
    .started();
    handle.call_games();
    let first = handle.compute_update().games;
    assert_eq!(first.len(), MAX_GAMES_FOLLOWED);
    let in_state = |games: &[v1::TournamentGame], state| {
        let numbers = games.iter().filter(|game| game.state() == state);
        numbers.map(|game| game.game).collect::<Vec<_>>()
    };
    assert_eq!(in_state(&first, v1::TournamentGameState::Playing).len(), 64);
    let due = MAX_GAMES_FOLLOWED - 64;
    assert_eq!(in_state(&first, v1::TournamentGameState::Due).len(), due);
    for _ in 0..10 {
        handle.end_games();
        handle.call_games();
    }
    let follower_update = handle.compute_update();
    let playing: Vec<u32> = handle.read(|core| core.playing().map(convert::number).collect());
    assert_eq!(
        in_state(&follower_update.games, v1::TournamentGameState::Playing),
        playing
    );
    let counted: Vec<u32> = handle.read(|core| {
        let games = core.games().iter().enumerate();
        let counted = games.filter(|(_, game)| game.is_over());
        counted.map(|(number, _)| convert::number(number)).collect()
    });
    assert_eq!(counted.len(), 640);
    let shown = MAX_GAMES_FOLLOWED - playing.len();
    assert_eq!(
        in_state(&follower_update.games, v1::TournamentGameState::Counted),
        counted[counted.len() - shown..]
    );
    assert!(follower_update.games.is_sorted_by_key(|game| game.game));
    assert!(
        follower_update
            .games
            .iter()
            .all(|game| !game.room_id.is_empty() || game.calls == 0)
    );
}

#[test]
fn followers_of_a_round_robin_receive_the_running_games() {
    let handle = TournamentHandle::with_settings(
        8,
        v1::TournamentSettings {
            format: v1::TournamentFormat::RoundRobin.into(),
            max_parallel_games: 3,
            ..v1::TournamentSettings::default()
        },
    )
    .started();
    handle.call_games();
    handle.end_games();
    handle.call_games();
    let games = handle.compute_update().games;
    assert_eq!(games.len(), 3);
    let playing = v1::TournamentGameState::Playing;
    assert!(games.iter().all(|game| game.state() == playing));
}

#[test]
fn no_message_exceeds_the_default_limit_of_clients() {
    let handle = TournamentHandle::for_tests(MAX_PARTICIPANTS);
    let mut results = handle.compute_results();
    for standing in &mut results.standings {
        *standing = v1::TournamentStanding {
            place: u32::MAX,
            participant: u32::MAX,
            last_round: u32::MAX,
            games: u32::MAX,
            byes: u32::MAX,
            score: u64::MAX,
            points: u64::MAX,
            places: vec![u32::MAX; MAX_SEATS],
            forfeited: u32::MAX,
            substituted: u32::MAX,
            wrong_actions: u64::MAX,
            timeouts: u64::MAX,
            mean_decision_time_us: 1.0,
            performance_score: 1.0,
            rating: Some(v1::Rating {
                mean: 1.0,
                deviation: 1.0,
                games: u32::MAX,
            }),
        };
    }
    assert_eq!(results.standings.len(), MAX_PARTICIPANTS);
    let replaced = |mut tournament: v1::Tournament| {
        for participant in &mut tournament.participants {
            let former = v1::FormerParticipant {
                name: participant.name.clone(),
                kind: participant.kind,
                built_in_agent: participant.built_in_agent.clone(),
                games: u32::MAX,
            };
            participant.former = vec![former; MAX_REPLACEMENTS];
        }
        tournament
    };
    results.tournament = results.tournament.map(replaced);
    // Once a game has counted, there is one for each two neighbours.
    let pair = v1::OrderConfidence {
        upper: u32::MAX,
        lower: u32::MAX,
        difference: 1.0,
        standard_error: 1.0,
        confidence: 1.0,
        more_games: Some(u64::MAX),
    };
    results.confidence = vec![pair; MAX_PARTICIPANTS - 1];
    let size = results.encoded_len();
    assert!(size < DEFAULT_MESSAGE_LIMIT, "{size} bytes of results");
    let seat = v1::TournamentGameSeat {
        participant: u32::MAX,
        forfeited: true,
        substituted: true,
        place: u32::MAX,
        score: u32::MAX,
        points: u64::MAX,
        decisions: u64::MAX,
        wrong_actions: u64::MAX,
        timeouts: u64::MAX,
        decision_time_us: u64::MAX,
        timed_decisions: u64::MAX,
        performance_score: 1.0,
        left: true,
        former_name: "🍕".repeat(MAX_NAME_CHARS),
    };
    let game = v1::TournamentGame {
        game: u32::MAX,
        round: u32::MAX,
        table: u32::MAX,
        number: u32::MAX,
        state: v1::TournamentGameState::Counted.into(),
        seats: vec![seat; MAX_SEATS],
        room_id: RoomId::random().to_string(),
        game_id: GameId::random().to_string(),
        calls: u32::MAX,
        series_id: SeriesId::random().to_string(),
        rated: true,
        shifts: u32::MAX,
        physical: true,
        postponed: u32::MAX,
    };
    let follower_update = v1::FollowTournamentResponse {
        games: vec![game; MAX_GAMES_FOLLOWED],
        standings: results.standings,
        tournament: results.tournament,
    };
    let size = follower_update.encoded_len();
    assert!(size < DEFAULT_MESSAGE_LIMIT, "{size} bytes for a follower");
}
