//! The task of a room under tokio's paused clock, with streams that do not read.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use async_trait::async_trait;
use chefshat_engine::SeedPlan;
use chefshat_engine::{RuleSetSpec, Seat, Stop};
use chefshat_proto::v1::{self, seat_update::Update};
use chefshat_record::signature::SigningKey;
use futures::FutureExt as _;
use futures::StreamExt as _;
use prost::Message as _;
use tokio::time::Instant;
use tokio_util::task::TaskTracker;

use super::subscriber::DeliveryOptions;
use super::{
    AttachRequest, GameEnd, Handle, JoinRequest, MAX_SPECTATORS, RoomError, RoomWatcher,
    SeatAction, SpectateError, SpectateRequest, Supersedes, TaskContext, spawn_room,
};
use crate::cluster::NodeLease;
use crate::record_writer::RecordWriter;
use crate::signing::Signer;
use crate::webhooks::Webhooks;
use chefshat_admission::access::TokenId;
use chefshat_admission::limits::{Background, Key, Payer, Searches, Shares};
use chefshat_base::clock::RoomClock;
use chefshat_base::metrics::{Metrics, SearchOutcome};
use chefshat_room::ids::{Id, RoomId, RoomToken, SecretHash};
use chefshat_room::journal::{Change, Entry, Fill, GameHeader};
use chefshat_room::policy::{AbortPolicy, Policy};
use chefshat_room::testing::header;
use chefshat_room::{Answer, ConnectionId, Core, JoinError, MAX_EVENTS_KEPT};
use chefshat_store::{Journal, MemoryStore, Store as _, StoreError, StoredGame};
use chefshat_wire::encoded::Updates;
use chefshat_wire::outbox::{Outbox, OutboxStream, StreamEnd};

struct NullWatcher;

impl RoomWatcher for NullWatcher {
    fn game_over(&self, _room: RoomId, _end: GameEnd) {}
    fn gone(&self, _room: RoomId, _has_failed: bool) {}
}

/// The owner's secret.
const OWNER: [u8; 32] = [9; 32];
/// The policy of a game that goes on without its players.
fn never_aborted() -> Policy {
    Policy {
        abort: AbortPolicy::Never,
        ..Policy::default()
    }
}

/// A seat that anybody may take.
const FREE: Fill = Fill::Open { reserved_for: None };

async fn room(policy: Policy, shifts: u32) -> Handle {
    room_with(policy, shifts, |journal| journal).await
}

/// Starts a room whose journal is replaced.
async fn room_with(
    policy: Policy,
    shifts: u32,
    change: impl FnOnce(Box<dyn Journal>) -> Box<dyn Journal>,
) -> Handle {
    room_of(vec![FREE; 4], policy, shifts, Arc::default(), change).await
}

async fn room_of(
    fills: Vec<Fill>,
    policy: Policy,
    shifts: u32,
    metrics: Arc<Metrics>,
    change: impl FnOnce(Box<dyn Journal>) -> Box<dyn Journal>,
) -> Handle {
    room_of_node(None, fills, policy, shifts, metrics, change).await
}

async fn room_of_node(
    lease: Option<Arc<NodeLease>>,
    fills: Vec<Fill>,
    policy: Policy,
    shifts: u32,
    metrics: Arc<Metrics>,
    change: impl FnOnce(Box<dyn Journal>) -> Box<dyn Journal>,
) -> Handle {
    let store = Arc::default();
    room_in(store, lease, fills, policy, shifts, metrics, change).await
}

async fn room_in(
    store: Arc<MemoryStore>,
    lease: Option<Arc<NodeLease>>,
    fills: Vec<Fill>,
    policy: Policy,
    shifts: u32,
    metrics: Arc<Metrics>,
    change: impl FnOnce(Box<dyn Journal>) -> Box<dyn Journal>,
) -> Handle {
    let rules = RuleSetSpec {
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    };
    let header = Arc::new(GameHeader {
        seed: SeedPlan::Fixed { game_seed: [3; 32] },
        owner: SecretHash::of(&OWNER),
        ..header(policy, fills, rules)
    });
    let journal = store
        .create(Arc::clone(&header), Vec::new())
        .await
        .expect("a memory store");
    let background = Background::new(Shares::default(), 1_000_000).expect("threads");
    let background = Arc::new(background);
    let searches = Searches::new(Arc::clone(&metrics)).expect("threads");
    let process_clock = Arc::default();
    spawn_room(
        Core::new(header),
        RoomClock::of_age(Duration::ZERO, &process_clock),
        None,
        change(journal),
        TaskContext {
            lease,
            signer: Signer::new(Some(Arc::new(SigningKey::from_seed(&[7; 32])))),
            record_writer: RecordWriter::new(
                store.clone(),
                None,
                TaskTracker::new(),
                Arc::clone(&background),
            ),
            store,
            retention: Duration::from_secs(1_000_000),
            connections: Arc::new(AtomicU64::new(1)),
            tracker: TaskTracker::new(),
            metrics,
            watcher: Arc::new(NullWatcher),
            background,
            searches: Arc::new(searches),
            webhooks: Webhooks::default(),
            stored: Arc::default(),
            owner: Key::Local,
            creator: None,
            shares: Shares::default(),
            process_clock,
        },
    )
}

struct AttachedSeat {
    seat: Seat,
    connection: ConnectionId,
    ticket: RoomToken,
    updates: OutboxStream,
}

async fn take_seat(room: &Handle) -> AttachedSeat {
    take_seat_from(room, Key::Local).await
}

async fn take_all_seats(room: &Handle) -> Vec<AttachedSeat> {
    let mut seats = Vec::new();
    for _ in 0..4 {
        seats.push(take_seat(room).await);
    }
    seats
}

/// Takes a seat from an address.
async fn take_seat_from(room: &Handle, charged: Key) -> AttachedSeat {
    let joined = room
        .join(JoinRequest::for_tests("somebody"))
        .await
        .expect("a free seat");
    attach_from(room, joined.ticket, charged).await
}

fn attachment(ticket: &RoomToken, outbox: Arc<Outbox>) -> AttachRequest {
    AttachRequest {
        secret: ticket.secret,
        request_id: 0,
        outbox,
        charged: Key::Local.into(),
        handle: 0,
        options: DeliveryOptions {
            at_once: true,
            no_mask: false,
            snapshot: false,
            from: 0,
        },
        by_gateway: false,
        supersedes: Supersedes::Any,
        entropy: Vec::new(),
        arrived: Instant::now(),
        detached: Arc::default(),
        assigned_ticket: None,
    }
}

async fn attach(room: &Handle, ticket: RoomToken) -> AttachedSeat {
    attach_from(room, ticket, Key::Local).await
}

async fn attach_from(room: &Handle, ticket: RoomToken, charged: Key) -> AttachedSeat {
    attach_with(room, ticket, |attachment| {
        attachment.charged = charged.into()
    })
    .await
}

/// Attaches a seat with a changed request.
async fn attach_with(
    room: &Handle,
    ticket: RoomToken,
    change: impl FnOnce(&mut AttachRequest),
) -> AttachedSeat {
    let (outbox, updates) = Outbox::new();
    let mut attachment = attachment(&ticket, outbox);
    change(&mut attachment);
    let attached = room.attach(attachment).await.expect("a valid ticket");
    AttachedSeat {
        seat: attached.seat,
        connection: attached.connection,
        ticket,
        updates,
    }
}

/// The next updates of a seat.
async fn received(seat: &mut AttachedSeat) -> Option<impl Iterator<Item = Update> + use<>> {
    seat.updates.next().await.map(decoded)
}

/// The next updates of a seat, if they wait.
fn waiting(updates: &mut OutboxStream) -> Option<impl Iterator<Item = Update> + use<>> {
    updates.next().now_or_never().flatten().map(decoded)
}

fn decoded(updates: Result<Updates, StreamEnd>) -> impl Iterator<Item = Update> + use<> {
    let written = updates.expect("no error").encode_to_vec();
    let response = v1::PlayResponse::decode(written.as_slice()).expect("a response");
    let updates = response.updates.into_iter();
    updates.map(|update| update.update.expect("an update"))
}

/// Reads until the end of the game; answers decisions with their first legal action if `answering`.
/// Returns the numbers of all events, also of those that a snapshot stood for, and the number of
/// snapshots.
async fn read(room: &Handle, seat: &mut AttachedSeat, answering: bool) -> (Vec<u64>, usize) {
    read_until(usize::MAX, room, seat, answering).await
}

/// The same, until there are this many events.
async fn read_until(
    most: usize,
    room: &Handle,
    seat: &mut AttachedSeat,
    answering: bool,
) -> (Vec<u64>, usize) {
    let (mut numbers, mut snapshots) = (Vec::new(), 0);
    while numbers.len() < most {
        let updates = (received(seat).await).expect("the stream ended before the game");
        for update in updates {
            match update {
                Update::Events(batch) => {
                    numbers.extend(batch.events.iter().map(|event| event.sequence));
                }
                Update::Snapshot(snapshot) => {
                    let next = numbers.last().map_or(1, |last| last + 1);
                    numbers.extend(next..snapshot.next_sequence);
                    snapshots += 1;
                }
                Update::Decision(decision) if answering => {
                    let action = SeatAction::Answer(Answer::new(
                        decision.decision_id,
                        first_legal(&decision),
                    ));
                    room.perform(seat.seat, seat.connection, action, Instant::now())
                        .await
                        .expect("the room exists");
                }
                Update::Detached(detached) => {
                    assert_eq!(detached.reason(), v1::DetachReason::GameOver);
                    return (numbers, snapshots);
                }
                _ => {}
            }
        }
    }
    (numbers, snapshots)
}

fn first_legal(decision: &v1::DecisionRequest) -> u32 {
    (0..)
        .find(|action: &u32| {
            let byte = decision.action_mask[usize::try_from(action / 8).expect("small")];
            byte & (1 << (action % 8)) != 0
        })
        .expect("a legal action")
}

#[tokio::test(start_paused = true)]
async fn a_stalled_stream_delays_nobody_and_receives_the_end() {
    // So long that its events neither fit an outbox nor are all kept.
    let policy = never_aborted();
    let room = room(policy, 30).await;
    let mut seats = take_all_seats(&room).await;
    let mut stalled = seats.pop().expect("there are four");
    let played = futures::future::join_all(seats.iter_mut().map(|seat| read(&room, seat, true)));
    let played = played.await;
    let expected: Vec<u64> = (1..).take(played[0].0.len()).collect();
    let most = chefshat_wire::outbox::OUTBOX_CAPACITY + MAX_EVENTS_KEPT;
    assert!(expected.len() > most, "{}", expected.len());
    // Not compared by assert_eq!, which would print all of them.
    assert!(played.iter().all(|played| *played == (expected.clone(), 0)));
    // The stalled stream reads at last: its pending updates, then the last events.
    let behind = read(&room, &mut stalled, false).await;
    let last = &expected[expected.len() - MAX_EVENTS_KEPT..];
    assert!(behind.0.ends_with(last) && behind.1 == 0);
    // And seats that attach only now, from the beginning and from what everybody has left is kept.
    let mut late = attach(&room, stalled.ticket).await;
    let late = read(&room, &mut late, false).await;
    assert!(late.0.ends_with(last) && late.1 == 0);
    let from = expected.len() - MAX_EVENTS_KEPT;
    let later = attach_with(&room, stalled.ticket, |it| it.options.from = from);
    let mut later = later.await;
    let (numbers, snapshots) = read(&room, &mut later, false).await;
    assert!(numbers == expected[from..] && snapshots == 0);
    // And a spectator, whom no snapshot could tell the result.
    let (snapshot, events) = watched_from_the_beginning(&room).await;
    assert!(snapshot.is_none() && (2..=expected[from]).contains(&events[0].sequence));
}

#[tokio::test(start_paused = true)]
async fn who_is_too_far_behind_in_a_game_receives_a_snapshot() {
    let policy = never_aborted();
    let room = room(policy, 1_000).await;
    let mut seats = take_all_seats(&room).await;
    let mut stalled = seats.pop().expect("there are four");
    let enough = chefshat_wire::outbox::OUTBOX_CAPACITY + 2 * MAX_EVENTS_KEPT;
    let playing = (seats.iter_mut()).map(|seat| read_until(enough, &room, seat, true));
    futures::future::join_all(playing).await;
    // The stream that has not been read until now: a substitute plays for its seat, which the events
    // that it has lost would have said.
    let mut next = 1;
    let mut after_snapshot = None;
    while after_snapshot.is_none() {
        let mut updates = received(&mut stalled).await.expect("the game is played");
        while let Some(update) = updates.next() {
            match update {
                Update::Events(batch) => next = batch.events.last().expect("one").sequence + 1,
                Update::Snapshot(snapshot) => {
                    assert!(snapshot.observation.is_some());
                    assert!(snapshot.next_sequence > next);
                    after_snapshot = Some(updates.next());
                }
                _ => {}
            }
        }
    }
    let substituted = Update::Substitution(v1::Substitution { active: true });
    assert_eq!(after_snapshot, Some(Some(substituted)));
    // A seat that attaches, and a spectator, from the beginning.
    let mut late = attach(&room, stalled.ticket).await;
    let updates: Vec<Update> = (received(&mut late).await).expect("updates").collect();
    let is_snapshot = |update: &Update| matches!(update, Update::Snapshot(_));
    assert!(updates.iter().any(is_snapshot), "{updates:?}");
    let (snapshot, _) = watched_from_the_beginning(&room).await;
    let snapshot = snapshot.expect("in place of what is gone");
    assert!(snapshot.observation.is_some() && snapshot.next_sequence > next);
}

/// The stream of a spectator who asks for all events.
async fn spectate(room: &Handle, charged: Key) -> Result<OutboxStream, RoomError<SpectateError>> {
    let (outbox, watched) = Outbox::new();
    let request = SpectateRequest {
        outbox,
        from: 0,
        snapshot: false,
        is_owner: false,
        charged,
    };
    room.spectate(request).await.map(|()| watched)
}

/// What a spectator receives who asks for all events: a snapshot, or else the first events.
async fn watched_from_the_beginning(room: &Handle) -> (Option<v1::Snapshot>, Vec<v1::GameEvent>) {
    let mut watched = spectate(room, Key::Local).await.expect("admitted");
    loop {
        let message = watched.next().await.expect("a message").expect("no error");
        let message = v1::SpectatorServiceWatchResponse::decode(message.encode_to_vec().as_slice());
        let message = message.expect("a response");
        if message.snapshot.is_some() || !message.events.is_empty() {
            return (message.snapshot, message.events);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_delayed_spectator_receives_no_snapshot_but_the_events_that_are_left() {
    let policy = Policy {
        spectator_delay_decisions: 100,
        ..Policy::default()
    };
    let room = room(policy, 1_000).await;
    let mut seats = take_all_seats(&room).await;
    let enough = 2 * MAX_EVENTS_KEPT;
    let playing = (seats.iter_mut()).map(|seat| read_until(enough, &room, seat, true));
    futures::future::join_all(playing).await;
    let (snapshot, events) = watched_from_the_beginning(&room).await;
    assert_eq!(snapshot, None);
    assert!(events[0].sequence > 1);
}

#[tokio::test(start_paused = true)]
async fn a_seat_that_is_given_up_in_the_batch_of_its_attachment_is_not_attached() {
    // By the tournament, while the game is played.
    let room = room(Policy::default(), 1).await;
    let seats = take_all_seats(&room).await;
    let removed = &seats[0];
    let (outbox, mut updates) = Outbox::new();
    let again = room.attach(attachment(&removed.ticket, outbox));
    let (again, ()) = tokio::join!(again, room.retire(removed.seat));
    assert!(matches!(again, Err(RoomError::SecretUnknown)));
    assert!(
        updates.next().now_or_never().flatten().is_none(),
        "nothing was sent"
    );
    let described = room.describe().await.expect("the room exists");
    let seat = &described.seats[removed.seat.index()];
    assert!(seat.substituted && !seat.connected, "{seat:?}");
    // By its participant, before the game.
    let room = self::room(Policy::default(), 1).await;
    let seat = take_seat(&room).await;
    let (outbox, _updates) = Outbox::new();
    let again = room.attach(attachment(&seat.ticket, outbox));
    let (again, left) = tokio::join!(again, room.leave(seat.ticket.secret));
    assert!(matches!(again, Err(RoomError::SecretUnknown)));
    left.expect("the game has not started");
    let described = room.describe().await.expect("the room exists");
    assert!(!described.seats[seat.seat.index()].connected);
}

#[tokio::test(start_paused = true)]
async fn deadlines_fire_without_any_input() {
    let policy = never_aborted();
    let begun = Instant::now();
    let room = room(policy, 1).await;
    let mut seats = take_all_seats(&room).await;
    // No seat answers: each one uses up its bank and three decisions, then substitutes end the
    // game.
    let read = futures::future::join_all(seats.iter_mut().map(|seat| read(&room, seat, false)));
    let numbers = read.await;
    assert!(numbers[0].0.len() > 12);
    let patience = Policy::default();
    let longest = 4 * (patience.bank + 3 * patience.decision_time);
    assert!(begun.elapsed() <= longest + Duration::from_secs(1));
    assert!(begun.elapsed() >= patience.bank + patience.decision_time);
}

/// What one seat's stream received: its first update of this kind.
async fn update<T>(seat: &mut AttachedSeat, wanted: impl Fn(Update) -> Option<T>) -> T {
    while let Some(mut updates) = received(seat).await {
        if let Some(found) = updates.find_map(&wanted) {
            return found;
        }
    }
    panic!("the stream ended")
}

#[tokio::test(start_paused = true)]
async fn a_pause_of_the_process_costs_a_seat_no_time() {
    const SECOND: Duration = Duration::from_secs(1);
    const MINUTE: Duration = Duration::from_mins(1);
    let accepted = v1::AnswerStatus::Accepted;
    let too_late = v1::AnswerStatus::Closed;
    for (is_watched, pauses, status, longest_ms) in [
        (true, vec![6 * SECOND], accepted, 600),
        // Of each pause, at most a tenth of a second counts.
        (true, vec![6 * SECOND; 3], accepted, 800),
        (true, vec![10 * MINUTE], accepted, 600),
        // At most ten minutes of one.
        (true, vec![10 * MINUTE + 2 * SECOND], too_late, 0),
        // The process is slow, but runs.
        (true, vec![SECOND * 9 / 10; 7], too_late, 0),
        (false, vec![6 * SECOND], too_late, 0),
    ] {
        let policy = Policy {
            decision_time: 2 * SECOND,
            bank: Duration::ZERO,
            ..never_aborted()
        };
        let built_in = Fill::BuiltIn("greedy".parse().expect("an agent"));
        let mut fills = vec![built_in; 4];
        fills[0] = FREE;
        let room = room_of(fills, policy, 1, Arc::default(), |journal| journal).await;
        let watching = is_watched.then(|| tokio::spawn(room.clock().process().clone().watch()));
        let mut seat = take_seat(&room).await;
        let decision = update(&mut seat, |update| match update {
            Update::Decision(decision) => Some(decision),
            _ => None,
        });
        let decision = decision.await;
        tokio::time::sleep(SECOND / 2).await;
        for pause in &pauses {
            // Nothing runs meanwhile: then the timer of the room and the watcher are both due.
            tokio::time::advance(*pause).await;
        }
        let answer = Answer::new(decision.decision_id, first_legal(&decision));
        let action = SeatAction::Answer(answer);
        room.perform(seat.seat, seat.connection, action, Instant::now())
            .await
            .expect("the room exists");
        let result = update(&mut seat, |update| match update {
            Update::Result(result) => Some(result),
            _ => None,
        });
        let result = result.await;
        assert_eq!(result.status(), status, "{pauses:?}");
        if status == accepted {
            let time_ms = result.decision_time_us / 1_000;
            assert!(
                (500..=longest_ms).contains(&time_ms),
                "{pauses:?}: {time_ms}"
            );
        }
        if let Some(watching) = watching {
            watching.abort();
        }
    }
}

#[tokio::test]
async fn a_flood_stops_neither_the_clock_nor_searches() {
    let policy = Policy {
        decision_time: Duration::from_millis(50),
        bank: Duration::ZERO,
        max_timeouts: 1,
        ..never_aborted()
    };
    let searcher = "monte_carlo:200:random".parse().expect("an agent");
    let fills = vec![FREE, FREE, FREE, Fill::BuiltIn(searcher)];
    let metrics: Arc<Metrics> = Arc::default();
    let room = room_of(fills, policy, 1, Arc::clone(&metrics), |journal| journal).await;
    let mut seats = Vec::new();
    for _ in 0..3 {
        seats.push(take_seat(&room).await);
    }
    // No decision is answered; several clients send requests endlessly, so the mailbox is never
    // empty.
    let (seat, connection) = (seats[0].seat, seats[0].connection);
    let flood: Vec<_> = (0..8)
        .map(|_| {
            let room = room.clone();
            tokio::spawn(async move {
                loop {
                    let unknown = SeatAction::Answer(Answer::new(u64::MAX, 0));
                    if room
                        .perform(seat, connection, unknown, Instant::now())
                        .await
                        .is_err()
                    {
                        return;
                    }
                }
            })
        })
        .collect();
    let read = futures::future::join_all(seats.iter_mut().map(|seat| read(&room, seat, false)));
    let numbers = tokio::time::timeout(Duration::from_secs(300), read).await;
    for flood in flood {
        flood.abort();
    }
    assert!(numbers.expect("the game ends")[0].0.len() > 12);
    assert!(metrics.searches(SearchOutcome::Searched) > 0);
}

#[tokio::test(start_paused = true)]
async fn a_full_outbox_has_space_for_the_last_update() {
    let policy = never_aborted();
    let room = room(policy, 30).await;
    let mut seats = take_all_seats(&room).await;
    let mut stalled = seats.pop().expect("there are four");
    let played = futures::future::join_all(seats.iter_mut().map(|seat| read(&room, seat, true)));
    played.await;
    let newer = attach(&room, stalled.ticket).await;
    let mut last = None;
    while let Some(updates) = waiting(&mut stalled.updates) {
        last = updates.last();
    }
    let Some(Update::Detached(detached)) = last else {
        panic!("it was not notified that a newer connection has its seat");
    };
    assert_eq!(detached.reason(), v1::DetachReason::Superseded);
    drop(newer);
}

/// A journal that panics after a number of appends.
struct PanicsAfter {
    appends: usize,
    /// Whether it stores at once, so that answers are handled in place.
    at_once: bool,
    journal: Box<dyn Journal>,
}

impl PanicsAfter {
    fn count(&mut self) {
        self.appends = self
            .appends
            .checked_sub(1)
            .expect("the journal is asked to panic");
    }
}

#[async_trait]
impl Journal for PanicsAfter {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        if self.at_once {
            self.count();
            self.journal.append_now(entries);
        }
        self.at_once
    }

    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        self.count();
        self.journal.append(entries).await
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        self.journal.entries().await
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        self.journal.finish(summary, signature).await
    }
}

#[tokio::test]
async fn one_caller_cannot_take_all_places_of_spectators() {
    let room = room_with(Policy::default(), 1, |journal| journal).await;
    let mut streams = Vec::new();
    let full = loop {
        match spectate(&room, Key::Local).await {
            Ok(stream) => streams.push(stream),
            Err(error) => break error,
        }
    };
    assert_eq!(full, RoomError::Refused(SpectateError::Full));
    assert_eq!(streams.len(), MAX_SPECTATORS / 2);
    let other = Key::Address([192, 0, 2, 1].into());
    let _other = spectate(&room, other).await.expect("another caller");
    // Those who leave make room, also if nothing happens in the game.
    streams.clear();
    let again = spectate(&room, Key::Local).await;
    drop(again.expect("the others have left"));
}

#[tokio::test(start_paused = true)]
async fn the_streams_of_a_room_that_panics_end() {
    for at_once in [false, true] {
        check_streams_end_after_panic(at_once).await;
    }
}

async fn check_streams_end_after_panic(at_once: bool) {
    // Four seats are taken and attached, then the first answer panics.
    let room = room_with(Policy::default(), 1, |journal| {
        Box::new(PanicsAfter {
            appends: 5,
            at_once,
            journal,
        })
    })
    .await;
    let mut seats = take_all_seats(&room).await;
    let mut watched = spectate(&room, Key::Local).await.expect("admitted");
    for seat in &seats {
        for action in 0..u32::from(u8::MAX) {
            let answer = Answer::new(1, action);
            if at_once {
                // Once the room is gone, answers are given back.
                let _ = room.answer_in_place(seat.seat, seat.connection, answer, Instant::now());
            } else {
                let action = SeatAction::Answer(answer);
                // A room that is gone accepts no messages.
                let _ = (room.perform(seat.seat, seat.connection, action, Instant::now())).await;
            }
        }
    }
    for stream in seats
        .iter_mut()
        .map(|seat| &mut seat.updates)
        .chain([&mut watched])
    {
        let mut end = None;
        while let Some(updates) = stream.next().await {
            end = updates.err();
        }
        assert_eq!(end, Some(StreamEnd::RoomGone));
    }
    assert!(room.describe().await.is_err());
}

/// A journal that may fail to read back, and reports whether its game ends with a signature.
struct Observed {
    /// How often reading fails before it succeeds.
    failures: u32,
    signed: Arc<OnceLock<bool>>,
    journal: Box<dyn Journal>,
}

#[async_trait]
impl Journal for Observed {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        self.journal.append(entries).await
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        match self.failures.checked_sub(1) {
            None => self.journal.entries().await,
            Some(left) => {
                self.failures = left;
                Err(StoreError::Failed("no reader is free".into()))
            }
        }
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        self.signed.set(signature.is_some()).expect("one end");
        self.journal.finish(summary, signature).await
    }
}

#[tokio::test(start_paused = true)]
async fn a_game_that_cannot_be_read_back_ends_unsigned() {
    let lease = Arc::new(NodeLease::new());
    lease.set(Instant::now() + Duration::from_hours(1_000));
    // A node waits for its database as long as it does to commit the end.
    for (lease, failures, is_signed) in [
        (None, 0, true),
        (None, 1, false),
        (Some(&lease), 200, true),
        (Some(&lease), u32::MAX, false),
    ] {
        let signed = Arc::new(OnceLock::new());
        let room = room_of_node(
            lease.cloned(),
            vec![FREE; 4],
            Policy::default(),
            1,
            Arc::default(),
            |journal| {
                Box::new(Observed {
                    failures,
                    signed: Arc::clone(&signed),
                    journal,
                })
            },
        );
        let room = room.await;
        let mut seats = take_all_seats(&room).await;
        let reads = seats.iter_mut().map(|seat| read(&room, seat, true));
        futures::future::join_all(reads).await;
        assert_eq!(signed.get(), Some(&is_signed));
    }
}

#[tokio::test(start_paused = true)]
async fn answers_are_handled_in_place_while_the_task_waits_and_the_mailbox_is_empty() {
    let room = room(Policy::default(), 1).await;
    let mut seats = take_all_seats(&room).await;
    let (mut in_place, mut through_mailbox) = (0, 0);
    loop {
        // The task of the room runs and then waits.
        tokio::task::yield_now().await;
        let mut decisions = Vec::new();
        let mut is_over = false;
        for seat in &mut seats {
            while let Some(updates) = waiting(&mut seat.updates) {
                for update in updates {
                    match update {
                        Update::Decision(decision) => {
                            decisions.push((seat.seat, seat.connection, decision));
                        }
                        Update::Detached(_) => is_over = true,
                        _ => {}
                    }
                }
            }
        }
        if is_over {
            break;
        }
        for (seat, connection, decision) in decisions {
            let answer = Answer::new(decision.decision_id, first_legal(&decision));
            let again = Answer::new(decision.decision_id, answer.action);
            // Messages in the mailbox come first.
            let sent = room.perform(seat, connection, SeatAction::Answer(answer), Instant::now());
            if decision.decision_id % 2 == 0 {
                sent.await.expect("the room is there");
                assert!((room.answer_in_place(seat, connection, again, Instant::now())).is_err());
                through_mailbox += 1;
            } else {
                drop(sent);
                let taken = room.answer_in_place(seat, connection, again, Instant::now());
                taken.expect("the task waits");
                in_place += 1;
            }
        }
    }
    assert!(
        in_place > 20 && through_mailbox > 20,
        "{in_place}, {through_mailbox}"
    );
    let record = room.describe().await.expect("the room is shown");
    assert_eq!(record.state(), v1::RoomState::Finished);
}

#[tokio::test(start_paused = true)]
async fn a_flood_of_annotations_drops_those_of_its_sender_alone() {
    let policy = Policy::default();
    let store = Arc::new(MemoryStore::outliving_server());
    let metrics = Arc::default();
    let room = room_in(store, None, vec![FREE; 4], policy, 1, metrics, |it| it).await;
    let address = |last| Key::Address([192, 0, 2, last].into());
    let mut seats = Vec::new();
    for last in 1..=4 {
        seats.push(take_seat_from(&room, address(last)).await);
    }
    // Nobody's decision: its annotations are read all the same.
    let flood = || Answer {
        annotations: Some(vec![0; 65 << 20].into()),
        ..Answer::new(u64::MAX, 0)
    };
    let sender = &seats[0];
    let sent = SeatAction::Answer(flood());
    let sent = room.perform(sender.seat, sender.connection, sent, Instant::now());
    sent.await.expect("the room exists");
    let mut dropped = Vec::new();
    while dropped.len() < 4 {
        for seat in &mut seats {
            let (seat, connection, updates) = (seat.seat, seat.connection, &mut seat.updates);
            tokio::task::yield_now().await;
            for update in waiting(updates).into_iter().flatten() {
                match update {
                    Update::Decision(decision) => {
                        let answer = Answer {
                            annotations: Some([0].into()),
                            ..Answer::new(decision.decision_id, first_legal(&decision))
                        };
                        let action = SeatAction::Answer(answer);
                        let sent = room.perform(seat, connection, action, Instant::now());
                        sent.await.expect("the room exists");
                    }
                    Update::Result(result) if result.status() == v1::AnswerStatus::Accepted => {
                        dropped.push((seat.index(), result.annotations_dropped));
                    }
                    _ => {}
                }
            }
        }
    }
    for (seat, is_dropped) in dropped {
        assert_eq!(is_dropped, seat == seats[0].seat.index(), "seat {seat}");
    }
}

/// Who may close a room is its owner, whatever it showed when it took its seat.
#[tokio::test]
async fn an_owner_who_closes_its_room_leaves_the_seats_that_are_its_own() {
    let address = |last: u8| Key::Address([192, 0, 2, last].into());
    let with_token = |last| Payer {
        address: address(last),
        key: Key::Token(TokenId([last; 4])),
    };
    let of = |address: Key| Payer::from(address);
    // Who took the four seats, if that is known; who is connected to them; who closes; whose is lost.
    for (seated, connected, closes, lost) in [
        // Its token was not shown when it took the seat, or is not when it closes the room.
        (
            [1, 2, 3, 4].map(|it| Some(of(address(it)))),
            None,
            with_token(1),
            [0].as_slice(),
        ),
        (
            [1, 2, 3, 4].map(|it| Some(with_token(it))),
            None,
            of(address(2)),
            &[1],
        ),
        // Tokens of one address are different parties.
        (
            [
                with_token(1),
                Payer {
                    address: address(1),
                    ..with_token(2)
                },
                of(address(3)),
                of(address(4)),
            ]
            .map(Some),
            None,
            with_token(1),
            &[0],
        ),
        // After a restart, only the connections are known.
        (
            [None; 4],
            Some([1, 2, 3, 4].map(|it| of(address(it)))),
            with_token(3),
            &[2],
        ),
        // An organiser has no seat.
        (
            [1, 2, 3, 4].map(|it| Some(of(address(it)))),
            None,
            with_token(9),
            &[],
        ),
    ] {
        let store: Arc<MemoryStore> = Arc::default();
        let (policy, metrics) = (Policy::default(), Arc::default());
        let fills = vec![FREE; 4];
        let room = room_in(Arc::clone(&store), None, fills, policy, 1, metrics, |it| it).await;
        let mut seats = Vec::new();
        for index in 0..4_u32 {
            let joined = room.join(JoinRequest {
                seat: Some(index),
                client: seated[index as usize],
                ..JoinRequest::for_tests(format!("player {index}"))
            });
            let joined = joined.await.expect("a free seat");
            let charged = connected.map_or(of(address(100)), |them| them[index as usize]);
            let attached = attach_with(&room, joined.ticket, |it| it.charged = charged);
            seats.push(attached.await);
        }
        while room.describe().await.expect("shown").state() != v1::RoomState::Playing {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        let closed = room.close(OWNER, closes).await;
        closed.expect("its owner closes it");
        let entries = loop {
            match store
                .finished(Id::from_bytes([2; 16]))
                .await
                .expect("readable")
            {
                Some(StoredGame::Hosted(_, entries, _)) => break entries,
                _ => tokio::time::sleep(Duration::from_millis(5)).await,
            }
        };
        let left: Vec<usize> = (entries.iter())
            .filter_map(|entry| match &entry.change {
                Change::Disconnected { seat, .. } => Some(seat.index()),
                _ => None,
            })
            .collect();
        assert_eq!(left, lost, "{closes:?}");
    }
}

#[tokio::test]
async fn a_client_takes_one_seat_if_the_policy_says_so() {
    let request = |client: u8| JoinRequest {
        client: Some(Key::Address([10, 0, 0, client].into()).into()),
        ..JoinRequest::for_tests("somebody")
    };
    let join = async |room: &Handle, client: u8| {
        let joined = room.join(request(client)).await;
        joined.map(|joined| joined.ticket)
    };
    let open = room(Policy::default(), 1).await;
    for _ in 0..2 {
        join(&open, 1)
            .await
            .expect("by default as many as it wants");
    }
    let policy = Policy {
        one_seat_per_client: true,
        ..Policy::default()
    };
    let strict = room(policy, 1).await;
    let first = join(&strict, 1).await.expect("its seat");
    let again = join(&strict, 1).await.map(|_| ());
    assert_eq!(again, Err(RoomError::Refused(JoinError::ClientHasSeat)));
    join(&strict, 2).await.expect("another client");
    let left = strict.leave(first.secret).await;
    left.expect("the game has not started");
    join(&strict, 1).await.expect("its seat is free again");
}
