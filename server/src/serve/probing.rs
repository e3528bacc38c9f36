//! A node looks all the time whether it reaches the others, and whether they sign records with its
//! key: a cut between two nodes shows before a client needs the way between them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::metrics::Metrics;
use futures::{StreamExt as _, stream};
use tokio::time::sleep;
use tracing::warn;

use crate::cluster::{Directory, Peer};
use crate::peers::Peers;

/// Time between two looks. Shorter than nothing new is for a node that was not reached.
const INTERVAL: Duration = Duration::from_secs(5);
/// Other nodes that are asked at a time.
const ASKED_AT_ONCE: usize = 64;

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

/// Reaches all other nodes again and again, and reports with which something is wrong. `signing_key`:
/// with which this node signs records, empty if it signs none.
pub(super) async fn probe(
    directory: Arc<dyn Directory>,
    peers: Arc<Peers>,
    signing_key: String,
    metrics: Arc<Metrics>,
) {
    let reach = |peer: Peer| {
        let peers = Arc::clone(&peers);
        async move { peers.reach(&peer).await }
    };
    let mut problems = Problems::new();
    loop {
        sleep(INTERVAL).await;
        problems = look(&*directory, reach, &signing_key, problems).await;
        let count = |problem| problems.values().filter(|it| **it == problem).count();
        metrics.peers(count(Problem::Unreached), count(Problem::OtherKey));
    }
}

/// Reaches all other nodes once. Logs what differs from the last look, whose result is `before`, as
/// warnings: who has read of a problem reads that it is over.
async fn look<F: Future<Output = Result<Option<String>, String>>>(
    directory: &dyn Directory,
    reach: impl Fn(Peer) -> F,
    own_key: &str,
    before: Problems,
) -> Problems {
    let (_, others) = directory.nodes().await;
    let asked = stream::iter(others).map(|peer| {
        let reached = reach(peer.clone());
        async move { (peer, reached.await) }
    });
    let answers: Vec<_> = asked.buffer_unordered(ASKED_AT_ONCE).collect().await;
    let mut problems = Problems::new();
    for (peer, answer) in answers {
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
                None => warn!(%node, "this node reaches another one, which has its signing key"),
            }
        }
        problems.extend(problem.map(|problem| (peer, problem)));
    }
    problems
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use chefshat_admission::limits::Key;
    use chefshat_room::ids::TournamentId;

    use super::*;
    use crate::cluster::{FoundBy, Location};

    /// The other nodes, and those that nothing new is for.
    #[derive(Default)]
    struct Others {
        nodes: Vec<Peer>,
        avoided: Mutex<Vec<Peer>>,
    }

    #[tonic::async_trait]
    impl Directory for Others {
        async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
            (Arc::from("own"), self.nodes.clone())
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
        let others = Others {
            nodes: ["a", "b", "c", "earlier"].map(peer).to_vec(),
            ..Others::default()
        };
        let answer = async |peer: Peer| match &*peer.node {
            "b" => Err("no answer".to_owned()),
            "c" => Ok(Some("theirs".to_owned())),
            "earlier" => Ok(None),
            _ => Ok(Some("ours".to_owned())),
        };
        let problems = look(&others, answer, "ours", Problems::new()).await;
        let expected = [
            (peer("b"), Problem::Unreached),
            (peer("c"), Problem::OtherKey),
        ];
        assert_eq!(problems, BTreeMap::from(expected));
        assert_eq!(*others.avoided.lock().expect("no panic"), [peer("b")]);
        let fits = async |_| Ok(Some("ours".to_owned()));
        assert!(look(&others, fits, "ours", problems).await.is_empty());
    }
}
