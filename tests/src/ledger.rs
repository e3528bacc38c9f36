//! Records what clients sent and received, independently of any server, for comparison with what a
//! server has stored.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use chefshat_client::{ActionId, Agent, Outcome};
use chefshat_proto::v1::{self, record_line::Line};
use tokio::sync::watch;

/// A decision: its game, its seat, its number.
type Key = (String, u32, u64);

/// All answers of all agents, and all acknowledgements.
#[derive(Debug, Default)]
pub struct Ledger {
    sent: Mutex<BTreeMap<Key, u32>>,
    accepted: Mutex<BTreeMap<Key, u32>>,
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

    /// Records something that must not happen.
    pub fn unexpected(&self, what: String) {
        self.unexpected.lock().expect("no panic").push(what);
    }

    /// Checks that nothing unexpected happened.
    ///
    /// # Panics
    /// Something unexpected happened.
    pub fn assert_nothing_unexpected(&self) {
        let unexpected = self.unexpected.lock().expect("no panic");
        assert!(unexpected.is_empty(), "{unexpected:#?}");
    }

    /// Compares the record of a game with the clients' knowledge: it contains every acknowledged
    /// decision once, unchanged, and every decision it attributes to their agents was taken by one.
    /// Returns the number of acknowledged decisions. every decision that it says an agent of theirs
    /// took is one that the agent took. Gives the number of acknowledged decisions.
    ///
    /// # Panics
    /// At the first difference.
    pub fn assert_committed(&self, game: &str, record: &[v1::RecordLine]) -> usize {
        let sent = self.sent.lock().expect("no panic");
        let accepted = self.accepted.lock().expect("no panic");
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
        let lost = (accepted.keys()).find(|key| key.0 == game && !found.contains(*key));
        assert_eq!(lost, None, "an acknowledged decision is lost");
        acknowledged
    }
}

/// An agent whose answers and acknowledgements are recorded.
#[derive(Debug)]
pub struct Recorded<A> {
    agent: A,
    game: String,
    seat: u32,
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
