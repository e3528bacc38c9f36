//! A node looks all the time whether it reaches the others: a cut between two nodes shows before a
//! client needs the way between them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::metrics::Metrics;
use futures::{StreamExt as _, stream};
use tokio::time::sleep;
use tracing::{info, warn};

use crate::cluster::{Directory, Peer};
use crate::peers::Peers;

/// Time between two looks. Shorter than nothing new is for a node that was not reached.
const INTERVAL: Duration = Duration::from_secs(5);
/// Other nodes that are asked at a time.
const ASKED_AT_ONCE: usize = 64;

/// Reaches all other nodes again and again, and reports which it does not reach.
pub(super) async fn probe(directory: Arc<dyn Directory>, peers: Arc<Peers>, metrics: Arc<Metrics>) {
    let reach = |peer: Peer| {
        let peers = Arc::clone(&peers);
        async move { peers.reach(&peer).await }
    };
    let mut unreached = Unreached::new();
    loop {
        sleep(INTERVAL).await;
        unreached = look(&*directory, reach, unreached).await;
        metrics.unreachable_peers(unreached.len());
    }
}

/// The nodes that were not reached, and why.
type Unreached = BTreeMap<Peer, String>;

/// Reaches all other nodes once. Logs what differs from the last look, whose result is `before`.
async fn look<F: Future<Output = Result<(), String>>>(
    directory: &dyn Directory,
    reach: impl Fn(Peer) -> F,
    before: Unreached,
) -> Unreached {
    let (_, others) = directory.nodes().await;
    let asked = stream::iter(others).map(|peer| {
        let reached = reach(peer.clone());
        async move { (peer, reached.await) }
    });
    let answers: Vec<_> = asked.buffer_unordered(ASKED_AT_ONCE).collect().await;
    let mut unreached = Unreached::new();
    for (peer, answer) in answers {
        match answer {
            Ok(()) if before.contains_key(&peer) => {
                info!(node = %peer.node, "this node reaches another one again");
            }
            Ok(()) => {}
            Err(problem) => {
                directory.avoid(&peer);
                if !before.contains_key(&peer) {
                    warn!(node = %peer.node, %problem, "this node does not reach another one");
                }
                unreached.insert(peer, problem);
            }
        }
    }
    unreached
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
    async fn nodes_that_are_not_reached_are_counted_and_avoided() {
        let peer = |node: &str| Peer {
            node: node.into(),
            endpoint: "192.0.2.1:1".into(),
        };
        let others = Others {
            nodes: ["a", "b", "c"].map(peer).to_vec(),
            ..Others::default()
        };
        let not_b = async |peer: Peer| match &*peer.node {
            "b" => Err("no answer".to_owned()),
            _ => Ok(()),
        };
        let unreached = look(&others, not_b, Unreached::new()).await;
        assert_eq!(unreached.keys().collect::<Vec<_>>(), [&peer("b")]);
        assert_eq!(*others.avoided.lock().expect("no panic"), [peer("b")]);
        let reached = look(&others, async |_| Ok(()), unreached).await;
        assert!(reached.is_empty());
    }
}
