//! A node probes the others: whether it reaches them, and whether they sign records with its key. So
//! a cut between two nodes shows before a client needs the way between them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::metrics::Metrics;
use futures::{StreamExt as _, stream};
use tokio::time::{sleep, timeout};
use tracing::warn;

use crate::cluster::{AVOIDED_FOR, Directory, Peer};
use crate::peers::Peers;

/// Time between two rounds of probes.
const INTERVAL: Duration = Duration::from_secs(5);
/// How long another node may take to answer.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(4);
const _: () = assert!(
    INTERVAL.as_secs() + ANSWER_TIMEOUT.as_secs() < AVOIDED_FOR.as_secs(),
    "nothing new is for a node that is not reached, from one round to the next"
);
/// Other nodes that are asked at a time.
const ASKED_AT_ONCE: usize = 256;

/// What is wrong with another node, as far as this one sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Problem {
    /// It is not reached.
    Unreached,
    /// It signs records with another key.
    OtherKey,
}

/// The nodes with which something is wrong.
type Problems = BTreeMap<Peer, Problem>;

/// Probes all other nodes, round after round, and reports with which something is wrong. `signing_key`:
/// with which this node signs records, empty if it signs none.
pub(super) async fn probe(
    directory: Arc<dyn Directory>,
    peers: Arc<Peers>,
    signing_key: String,
    metrics: Arc<Metrics>,
) {
    let reach = |peer: Peer| {
        let peers = Arc::clone(&peers);
        async move {
            let reached = timeout(ANSWER_TIMEOUT, peers.reach(&peer)).await;
            let late = || format!("{} does not answer in time", peer.endpoint);
            reached.unwrap_or_else(|_| Err(late()))
        }
    };
    let mut problems = Problems::new();
    loop {
        sleep(INTERVAL).await;
        problems = probe_once(&*directory, reach, &signing_key, problems).await;
        let count = |problem| problems.values().filter(|it| **it == problem).count();
        metrics.peers(count(Problem::Unreached), count(Problem::OtherKey));
    }
}

/// Probes all other nodes once. What differs from the last round, whose result is `before`, is logged
/// as a warning, also the end of a problem.
async fn probe_once<F: Future<Output = Result<Option<String>, String>>>(
    directory: &dyn Directory,
    reach: impl Fn(Peer) -> F,
    own_key: &str,
    before: Problems,
) -> Problems {
    let (own, others) = directory.nodes().await;
    if own.is_empty() {
        // The nodes are unknown, or this one has no lease.
        return before;
    }
    // Of those that no other node reaches, one node less says nothing: they have an alert of their own.
    let new = directory.unreached().await;
    let asked = others.into_iter().filter(|peer| !new.contains(&peer.node));
    let asked = stream::iter(asked).map(|peer| {
        let reached = reach(peer.clone());
        async move { (peer, reached.await) }
    });
    let mut answers = std::pin::pin!(asked.buffer_unordered(ASKED_AT_ONCE));
    let mut problems = Problems::new();
    while let Some((peer, answer)) = answers.next().await {
        let last = before.get(&peer).copied();
        let (problem, why) = match answer {
            Err(why) => (Some(Problem::Unreached), why),
            Ok(Some(key)) if key != own_key => (Some(Problem::OtherKey), String::new()),
            Ok(_) => (None, String::new()),
        };
        if problem == Some(Problem::Unreached) {
            directory.avoid(&peer);
        }
        if problem != last {
            let node = &peer.node;
            match problem {
                Some(Problem::Unreached) => warn!(
                    %node, %why,
                    "this node does not reach another one: look at the network between them, the other one's --peer-endpoint and the authority of its certificate"
                ),
                Some(Problem::OtherKey) => warn!(
                    %node,
                    "another node signs records with another key: copy one signing-key into the data directories of all nodes"
                ),
                None => {
                    warn!(%node, "this node reaches another one again, and nothing is wrong with its key")
                }
            }
        }
        problems.extend(problem.map(|problem| (peer, problem)));
    }
    problems
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    use chefshat_admission::limits::Key;
    use chefshat_room::ids::TournamentId;

    use super::*;
    use crate::cluster::{FoundBy, Location};

    /// The other nodes, and those that nothing new is for.
    #[derive(Default)]
    struct Others {
        /// Whether they cannot be read.
        unknown: bool,
        nodes: Vec<Peer>,
        avoided: Mutex<Vec<Peer>>,
    }

    #[tonic::async_trait]
    impl Directory for Others {
        async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
            match self.unknown {
                true => (Arc::from(""), Vec::new()),
                false => (Arc::from("own"), self.nodes.clone()),
            }
        }

        async fn unreached(&self) -> BTreeSet<Arc<str>> {
            BTreeSet::from([Arc::from("new")])
        }

        fn avoid(&self, node: &Peer) {
            self.avoided.lock().expect("no panic").push(node.clone());
        }

        async fn is_over(&self, _: TournamentId) -> bool {
            unreachable!("nobody asks")
        }

        async fn locate(&self, _: &FoundBy, _: Key) -> Location {
            unreachable!("nobody asks")
        }

        fn forget(&self, _: &FoundBy) {}
    }

    #[tokio::test]
    async fn nodes_that_are_not_reached_are_avoided_and_other_keys_are_noticed() {
        let peer = |node: &str| Peer {
            node: node.into(),
            endpoint: "192.0.2.1:1".into(),
        };
        let mut others = Others {
            nodes: ["a", "b", "c", "earlier", "new"].map(peer).to_vec(),
            ..Others::default()
        };
        let answer = async |peer: Peer| match &*peer.node {
            "b" | "new" => Err("no answer".to_owned()),
            "c" => Ok(Some("theirs".to_owned())),
            "earlier" => Ok(None),
            _ => Ok(Some("ours".to_owned())),
        };
        let problems = probe_once(&others, answer, "ours", Problems::new()).await;
        let expected = [
            (peer("b"), Problem::Unreached),
            (peer("c"), Problem::OtherKey),
        ];
        assert_eq!(problems, BTreeMap::from(expected));
        assert_eq!(*others.avoided.lock().expect("no panic"), [peer("b")]);
        others.unknown = true;
        let problems = probe_once(&others, answer, "ours", problems).await;
        assert_eq!(problems.len(), 2, "as before");
        others.unknown = false;
        let fits = async |_| Ok(Some("ours".to_owned()));
        assert!(probe_once(&others, fits, "ours", problems).await.is_empty());
    }
}
