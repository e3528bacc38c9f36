//! Crashes and stops of the server: everything acknowledged is stored, unfinished games resume, and
//! agents reconnect on their own. `faults` tests failing disks and databases.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use chefshat_client::{Backoff, Client, PlayOptions, RandomAgent};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line, seat_update::Update};
use chefshat_record::{jsonl, replay};
use chefshat_tests::{
    BusyRooms, Launch, PATIENCE, RoomKind, StreamSeat, patiently, random_agents, room_of_four,
};
use rand::rngs::SmallRng;
use rand::{RngExt as _, SeedableRng as _};
use tokio::task::JoinSet;
use tonic::Code;

/// Number of kills; `CHEFSHAT_KILLS` overrides it.
const KILLS: u64 = 25;
/// Most decisions acknowledged between two kills.
const MOST_BETWEEN: u64 = 40;
/// Kills after which the next server is also killed while it starts.
const KILLED_AT_START: u64 = 8;
/// Longest time before a starting server is killed.
const LONGEST_START: Duration = Duration::from_millis(100);

fn shifts(count: u32) -> v1::RuleSet {
    v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(count)),
        ..v1::RuleSet::default()
    }
}

/// Eight rooms of all kinds: long and short games, shared and separate streams, events at once and
/// with decisions, with built-in agents.
fn eight_rooms() -> Vec<RoomKind> {
    let mut kinds: Vec<RoomKind> = (0..8)
        .map(|number| RoomKind {
            rules: shifts(1 + number % 3),
            one_stream: number % 2 == 1,
            delivery: match number % 4 {
                0 | 1 => v1::EventDelivery::AtOnce,
                _ => v1::EventDelivery::WithDecisions,
            },
            ..RoomKind::default()
        })
        .collect();
    for kind in &mut kinds[4..6] {
        kind.built_in = 1;
        kind.policy.pace_ms = Some(2);
    }
    kinds[7].rules = v1::RuleSet::default();
    kinds
}

async fn playing(client: &Client) -> usize {
    let mut count = 0;
    let mut page_token = String::new();
    loop {
        let request = v1::ListRoomsRequest {
            state: v1::RoomState::Playing.into(),
            page_token,
            ..v1::ListRoomsRequest::default()
        };
        let page = client.list_rooms(request).await.expect("it is up");
        count += page.rooms.len();
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return count;
        }
    }
}

async fn connect(launch: &Launch) -> Client {
    Client::connect(launch.url())
        .await
        .expect("the server listens")
}

#[tokio::test(flavor = "multi_thread")]
async fn every_acknowledged_decision_survives_sigkill() {
    let kills = std::env::var("CHEFSHAT_KILLS").map_or(KILLS, |count| {
        count.parse().expect("CHEFSHAT_KILLS is a number")
    });
    let begun = Instant::now();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path());
    let mut server = launch.start().await.expect("the server starts");
    let busy_rooms = BusyRooms::start(&launch.url(), eight_rooms());
    let ledger = &busy_rooms.ledger;
    let mut random = SmallRng::seed_from_u64(kills);
    let mut found_playing = 0;
    for kill in 1..=kills {
        let more = random.random_range(1..=MOST_BETWEEN);
        patiently("decisions", ledger.reaches(ledger.count() + more)).await;
        server.kill().await;
        if kill % KILLED_AT_START == 0 {
            let starting = launch.spawn();
            tokio::time::sleep(LONGEST_START.mul_f64(random.random())).await;
            starting.kill().await;
        }
        server = launch.start().await.expect("the server restarts");
        found_playing += usize::from(playing(&connect(&launch).await).await > 0);
        if kill % kills.div_ceil(10) == 0 {
            let (decisions, seconds) = (ledger.count(), begun.elapsed().as_secs());
            eprintln!("{kill} kills, {decisions} decisions acknowledged, {seconds} s");
        }
    }
    let ledger = Arc::clone(&busy_rooms.ledger);
    let games = busy_rooms.finish().await;
    let client = connect(&launch).await;
    assert_eq!(playing(&client).await, 0, "no game is running");

    let mut acknowledged = 0;
    let mut restarts = 0;
    let mut records = Vec::new();
    for game in &games {
        let record = client.record(game).await.expect("a stored record");
        let replayed = replay::replay(&record).unwrap_or_else(|error| panic!("{game}: {error}"));
        assert_eq!(replayed.state, v1::RoomState::Finished, "{game}");
        acknowledged += ledger.assert_committed(game, &record);
        restarts += restarts_in(&record);
        records.push(record);
    }
    assert_eq!(
        u64::try_from(acknowledged),
        Ok(ledger.count()),
        "all of them"
    );
    assert_eq!(listed(&client).await, games.iter().cloned().collect());
    // Every kill hit running games: mostly all eight.
    assert_eq!(u64::try_from(found_playing), Ok(kills));
    assert!(u64::try_from(restarts).expect("small") >= kills);

    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    for (game, record) in games.iter().zip(&records) {
        let file = jsonl::read(&jsonl::path_of(folder.path(), game)).expect("a record file");
        assert!(file == *record, "the file of {game} equals the record");
    }
    eprintln!(
        "{kills} kills, {} games, {acknowledged} decisions acknowledged, {restarts} times a game resumed; {:.1} s",
        games.len(),
        begun.elapsed().as_secs_f64()
    );
}

fn restarts_in(record: &[v1::RecordLine]) -> usize {
    let is_restart = |line: &&v1::RecordLine| match &line.line {
        Some(Line::Event(event)) => matches!(event.kind, Some(Kind::ServerRestarted(_))),
        _ => false,
    };
    record.iter().filter(is_restart).count()
}

/// The games whose records a server has.
async fn listed(client: &Client) -> BTreeSet<String> {
    use v1::record_service_client::RecordServiceClient;
    let mut service = RecordServiceClient::new(client.channel());
    let mut games = BTreeSet::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListRecordsRequest {
            page_size: 100,
            page_token,
            ..v1::ListRecordsRequest::default()
        };
        let page = service.list_records(request).await.expect("a page");
        let page = page.into_inner();
        for summary in page.records {
            assert!(games.insert(summary.game_id.clone()), "{summary:?} twice");
        }
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return games;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_suspends_durable_games_and_aborts_the_others() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut launch = Launch::new(folder.path()).with("--grace", 0);
    let mut server = launch.start().await.expect("the server starts");
    let mut kinds = eight_rooms();
    kinds.truncate(4);
    let busy_rooms = BusyRooms::start(&launch.url(), kinds);
    let mut aborted = Vec::new();
    for _ in 0..5 {
        let client = connect(&launch).await;
        let policy = v1::RoomPolicy {
            durability: v1::Durability::Ephemeral.into(),
            ..v1::RoomPolicy::default()
        };
        let (created, tickets) = room_of_four(&client, shifts(1), policy).await;
        let mut seats = Vec::new();
        for ticket in &tickets {
            seats.push(StreamSeat::attached(client.channel(), ticket).await);
        }
        let more = busy_rooms.ledger.count() + 20;
        patiently("decisions", busy_rooms.ledger.reaches(more)).await;
        server.request_stop().await;
        for seat in &mut seats {
            let reason = loop {
                match seat.next().await {
                    Update::Detached(detached) => break detached.reason(),
                    Update::Decision(_) => {}
                    other => panic!("unexpected {other:?}"),
                }
            };
            assert_eq!(reason, v1::DetachReason::GameOver);
            let last = seat.events.last().and_then(|event| event.kind.as_ref());
            let Some(Kind::GameAborted(end)) = last else {
                panic!("not aborted, but {last:?}");
            };
            assert_eq!(end.reason(), v1::AbortReason::Shutdown);
        }
        let ended = server.ended().await;
        assert!(ended.status.success(), "{ended:?}");
        aborted.push(created.room.expect("a room").game_id);
        server = launch.start().await.expect("the server restarts");
    }
    // If a durable game had been aborted, its agents would have received that.
    let ledger = Arc::clone(&busy_rooms.ledger);
    let games = busy_rooms.finish().await;
    let client = connect(&launch).await;
    for game in &games {
        let record = client.record(game).await.expect("a stored record");
        ledger.assert_committed(game, &record);
    }
    for game in &aborted {
        let record = client.record(game).await.expect("a stored record");
        let replayed = replay::replay(&record).expect("a valid record");
        assert_eq!(replayed.state, v1::RoomState::Aborted);
        let file = jsonl::read(&jsonl::path_of(folder.path(), game)).expect("a record file");
        assert!(file == record);
    }
    assert!(server.stop().await.status.success());
}

#[tokio::test(flavor = "multi_thread")]
async fn waiting_agents_return_after_a_stop_and_are_not_refused_during_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // The stop takes long enough for the agents to retry meanwhile: a game without clients delays
    // it.
    let mut launch = Launch::new(folder.path()).with("--grace", 2);
    let server = launch.start().await.expect("the server starts");
    let client = connect(&launch).await;
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(3_600_000),
        ..v1::RoomPolicy::default()
    };
    let (_, idle) = room_of_four(&client, shifts(1), policy.clone()).await;
    let mut seats = Vec::new();
    for ticket in &idle {
        seats.push(StreamSeat::attached(client.channel(), ticket).await);
    }
    let (waiting, mut tickets) = room_of_four(&client, shifts(1), policy).await;
    let last = tickets.pop().expect("four tickets");
    let options = PlayOptions {
        backoff: Backoff {
            first: Duration::from_millis(5),
            max: Duration::from_millis(50),
            give_up_after: PATIENCE,
            ..Backoff::default()
        },
        ..PlayOptions::default()
    };
    let mut playing = JoinSet::new();
    for (ticket, agent) in random_agents(tickets) {
        let (client, options) = (connect(&launch).await, options.clone());
        playing.spawn(async move { client.play_with(ticket, agent, &options).await });
    }
    let room_id = waiting.room.expect("a room").room_id;
    let all_here = async {
        loop {
            let room = client.get_room(&room_id).await.expect("still listed");
            if room.seats.iter().filter(|seat| seat.connected).count() == 3 {
                return;
            }
            tokio::task::yield_now().await;
        }
    };
    patiently("three agents to wait", all_here).await;
    let ended = server.stop().await;
    assert!(ended.status.success(), "{ended:?}");
    for seat in &mut seats {
        let end = loop {
            match seat.next_or_end().await {
                Ok(Some(Update::Detached(detached))) => {
                    assert_eq!(detached.reason(), v1::DetachReason::ServerStopping);
                    break seat.next_or_end().await;
                }
                Ok(Some(Update::Decision(_))) => {}
                other => panic!("not informed that the server stops, but {other:?}"),
            }
        };
        // The code after which SDKs connect again.
        assert_eq!(end.expect_err("an error").code(), Code::Unavailable);
    }
    let server = launch.start().await.expect("the server restarts");
    let mut left = random_agents(idle);
    left.push((last, RandomAgent::new(9)));
    for (ticket, agent) in left {
        let (client, options) = (connect(&launch).await, options.clone());
        playing.spawn(async move { client.play_with(ticket, agent, &options).await });
    }
    for outcome in patiently("both games to end", playing.join_all()).await {
        let outcome = outcome.expect("no agent was refused");
        assert_eq!(outcome.aborted(), None);
    }
    assert!(server.stop().await.status.success());
}
