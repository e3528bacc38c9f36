//! Records what clients sent and received, independently of any server, for comparison with what a
//! server has stored.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use chefshat_client::{ActionId, Agent, Outcome};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use tokio::sync::watch;

/// A decision: its game, its seat, its number.
type Key = (String, u32, u64);

/// All answers of all agents, and all acknowledgements.
#[derive(Debug, Default)]
pub struct Ledger {
    sent: Mutex<BTreeMap<Key, u32>>,
    accepted: Mutex<BTreeMap<Key, u32>>,
    /// When an answer was acknowledged, and after which time.
    times: Mutex<BTreeMap<Key, (Instant, Duration)>>,
    /// By game, seat and number.
    received: Mutex<BTreeMap<Key, v1::GameEvent>>,
    unexpected: Mutex<Vec<String>>,
    count: watch::Sender<u64>,
}

impl Ledger {
    /// Wraps an agent whose answers are recorded here.
    pub fn wrap<A: Agent>(self: &Arc<Self>, agent: A) -> Recorded<A> {
        Recorded {
            agent,
            game: String::new(),
            seat: 0,
            sent_at: Instant::now(),
            ledger: Arc::clone(self),
        }
    }

    /// Number of acknowledged decisions.
    pub fn count(&self) -> u64 {
        *self.count.borrow()
    }

    /// Waits until this number of decisions have been acknowledged.
    pub async fn reaches(&self, count: u64) {
        let mut counted = self.count.subscribe();
        counted
            .wait_for(|counted| *counted >= count)
            .await
            .expect("the ledger holds the sender");
    }

    /// When the decisions of a game were acknowledged, and after which time each, in the order of
    /// the seats.
    pub fn times(&self, game: &str) -> Vec<(Instant, Duration)> {
        let times = self.times.lock().expect("no panic");
        times.range(all_of(game)).map(|(_, times)| *times).collect()
    }

    /// The games of which decisions have been acknowledged.
    pub fn games(&self) -> BTreeSet<String> {
        let accepted = self.accepted.lock().expect("no panic");
        accepted.keys().map(|(game, ..)| game.clone()).collect()
    }

    /// Records something that must not happen.
    pub fn unexpected(&self, what: String) {
        self.unexpected.lock().expect("no panic").push(what);
    }

    /// What must not happen and did.
    pub fn all_unexpected(&self) -> Vec<String> {
        self.unexpected.lock().expect("no panic").clone()
    }

    /// Checks that nothing unexpected happened.
    ///
    /// # Panics
    /// Something unexpected happened.
    pub fn assert_nothing_unexpected(&self) {
        let unexpected = self.all_unexpected();
        assert!(unexpected.is_empty(), "{unexpected:#?}");
    }

    /// Compares the record of a game with the clients' knowledge: it contains every acknowledged
    /// decision once, unchanged, every decision it attributes to their agents was taken by one, and
    /// every event that they received. Returns the number of acknowledged decisions.
    ///
    /// # Panics
    /// At the first difference.
    pub fn assert_committed(&self, game: &str, record: &[v1::RecordLine]) -> usize {
        let sent = self.sent.lock().expect("no panic");
        let accepted = self.accepted.lock().expect("no panic");
        self.assert_received(game, record);
        let mut found = BTreeSet::new();
        let mut acknowledged = 0;
        for line in record {
            let Some(Line::Decision(decision)) = &line.line else {
                continue;
            };
            let key = (game.to_owned(), decision.seat, decision.decision_id);
            if decision.source() == v1::DecisionSource::Agent
                && let Some(action) = sent.get(&key)
            {
                assert_eq!(*action, decision.action, "{key:?} differs from the answer");
            }
            if let Some(action) = accepted.get(&key) {
                assert_eq!(
                    *action, decision.action,
                    "{key:?} differs from its acknowledgement"
                );
                assert_eq!(decision.source(), v1::DecisionSource::Agent, "{key:?}");
                acknowledged += 1;
            }
            assert!(found.insert(key), "a decision twice: {decision:?}");
        }
        let mut accepted = accepted.range(all_of(game)).map(|(key, _)| key);
        let lost = accepted.find(|key| !found.contains(*key));
        assert_eq!(lost, None, "an acknowledged decision is lost");
        acknowledged
    }

    /// Checks that what the agents of a game received is in its record.
    fn assert_received(&self, game: &str, record: &[v1::RecordLine]) {
        let received = self.received.lock().expect("no panic");
        let recorded: BTreeMap<u64, &v1::GameEvent> = (record.iter())
            .filter_map(|line| match &line.line {
                Some(Line::Event(event)) => Some((event.sequence, event)),
                _ => None,
            })
            .collect();
        for ((_, seat, number), event) in received.range(all_of(game)) {
            let recorded = recorded.get(number).map(|event| as_seen_by(event, *seat));
            assert_eq!(
                recorded.as_ref(),
                Some(event),
                "what seat {seat} of {game} received is not in the record"
            );
        }
    }
}

/// The keys of a game.
fn all_of(game: &str) -> RangeInclusive<Key> {
    (game.to_owned(), 0, 0)..=(game.to_owned(), u32::MAX, u64::MAX)
}

/// An event of a record as a seat receives it.
fn as_seen_by(event: &v1::GameEvent, seat: u32) -> v1::GameEvent {
    let mut event = event.clone();
    event.rewards.retain(|reward| reward.seat == seat);
    match &mut event.kind {
        Some(Kind::ShiftStarted(started)) => started.hands.retain(|hand| hand.seat == seat),
        Some(Kind::CardsExchanged(exchanged))
            if ![exchanged.giver, exchanged.receiver].contains(&seat) =>
        {
            exchanged.cards.clear();
            exchanged.golden = false;
        }
        _ => {}
    }
    event
}

/// An agent whose answers and acknowledgements are recorded.
#[derive(Debug)]
pub struct Recorded<A> {
    agent: A,
    game: String,
    seat: u32,
    sent_at: Instant,
    ledger: Arc<Ledger>,
}

impl<A> Recorded<A> {
    fn key(&self, decision: u64) -> Key {
        (self.game.clone(), self.seat, decision)
    }
}

impl<A: Agent> Agent for Recorded<A> {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        let action = self.agent.decide(request);
        let key = self.key(request.decision_id);
        let mut sent = self.ledger.sent.lock().expect("no panic");
        let before = sent.insert(key.clone(), action.0);
        drop(sent);
        // An agent is asked again only after a refused answer, and these answers are never refused.
        if before.is_some() {
            self.ledger
                .unexpected(format!("{key:?} was requested twice"));
        }
        self.sent_at = Instant::now();
        action
    }

    fn annotate(&mut self) -> Option<v1::Annotations> {
        self.agent.annotate()
    }

    fn on_attached(&mut self, attached: &v1::Attached) {
        self.game.clone_from(&attached.game_id);
        self.seat = attached.seat;
        self.agent.on_attached(attached);
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        self.agent.on_event(event);
        let key = self.key(event.sequence);
        let mut received = self.ledger.received.lock().expect("no panic");
        let before = received.insert(key.clone(), event.clone());
        drop(received);
        if before.is_some_and(|before| before != *event) {
            let unexpected = format!("event {key:?} was received in two forms");
            self.ledger.unexpected(unexpected);
        }
    }

    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        self.agent.on_snapshot(snapshot);
    }

    fn on_result(&mut self, result: &v1::AnswerResult) {
        self.agent.on_result(result);
        let key = self.key(result.decision_id);
        if result.status() != v1::AnswerStatus::Accepted {
            let unexpected = format!("{key:?} was answered with {result:?}");
            return self.ledger.unexpected(unexpected);
        }
        let mut accepted = self.ledger.accepted.lock().expect("no panic");
        let before = accepted.insert(key.clone(), result.action);
        drop(accepted);
        let now = Instant::now();
        let mut times = self.ledger.times.lock().expect("no panic");
        (times.entry(key.clone())).or_insert((now, now - self.sent_at));
        drop(times);
        match before {
            None => self.ledger.count.send_modify(|count| *count += 1),
            Some(action) if action == result.action => {}
            Some(action) => self.ledger.unexpected(format!(
                "{key:?} was acknowledged as {action} and as {}",
                result.action
            )),
        }
    }

    fn on_game_over(&mut self, outcome: &Outcome) {
        self.agent.on_game_over(outcome);
    }
}
