//! A node that has joined takes rooms once another node has reached it: one that others cannot reach
//! would own rooms that only its own clients can play in.

use std::sync::Arc;
use std::time::Duration;

use tokio::time::{Instant, sleep};
use tracing::{info, warn};

use crate::cluster::{Directory, NodeLease, Peer};
use crate::peers::Peers;

/// Pause after the first attempt to be reached; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(8);
/// Other nodes that are asked at a time.
const ASKED_AT_ONCE: usize = 3;
/// The others may not have heard of this node for so long: they read the list of nodes once a second.
const UNKNOWN_FOR: Duration = Duration::from_secs(2);
/// After that a node takes rooms although no node reaches it, if none of the others has been reached
/// either: nodes that start together must not wait for each other for ever. Longer than it takes until
/// one that has been reached says so with its heartbeat and the others have read it.
const AMONG_NEW: Duration = Duration::from_secs(6);

/// Each time this node has joined: lets it take rooms once another node has reached it, or if there
/// is none.
pub(super) async fn be_reached(
    lease: Arc<NodeLease>,
    directory: Arc<dyn Directory>,
    peers: Option<Arc<Peers>>,
) {
    loop {
        lease.joined_anew().await;
        let Some(peers) = &peers else {
            lease.set_reached();
            continue;
        };
        until_reached(&*directory, |asked, own| {
            let peers = Arc::clone(peers);
            async move { peers.reached_by(&asked, &own).await }
        })
        .await;
        lease.set_reached();
    }
}

/// Why no other node reaches this one, by node.
type Problems = Vec<(Peer, String)>;

/// Waits until a node that has been reached itself reaches this one, or there is none. `reached_by`
/// asks nodes to reach the one of this name.
async fn until_reached<F>(directory: &dyn Directory, reached_by: impl Fn(Vec<Peer>, Arc<str>) -> F)
where
    F: Future<Output = Result<(), Problems>>,
{
    let began = Instant::now();
    let (mut pause, mut first, mut has_warned) = (FIRST_PAUSE, 0, false);
    loop {
        let (own, others) = directory.nodes().await;
        if !own.is_empty() {
            if others.is_empty() {
                info!("no other node lives: this one takes rooms");
                return;
            }
            let unreached = directory.unreached().await;
            let is_new = |peer: &Peer| unreached.contains(&peer.node);
            let (new, reached): (Vec<Peer>, Vec<Peer>) = others.into_iter().partition(is_new);
            // Those that nobody has reached may reach each other and nobody else.
            let is_any_reached = !reached.is_empty();
            let mut asked = if is_any_reached { reached } else { new };
            first %= asked.len();
            asked.rotate_left(first);
            asked.truncate(ASKED_AT_ONCE);
            first += ASKED_AT_ONCE;
            let Err(problems) = reached_by(asked, own).await else {
                // Logged like the problem that it ends.
                match has_warned {
                    true => warn!("another node reaches this one, which takes rooms"),
                    false => info!("another node reaches this one, which takes rooms"),
                }
                return;
            };
            if began.elapsed() > UNKNOWN_FOR {
                has_warned = true;
                for (peer, problem) in problems {
                    warn!(node = %peer.node, %problem, "no other node reaches this one, which takes no rooms");
                }
            }
            if !is_any_reached && began.elapsed() > AMONG_NEW {
                warn!(
                    "none of the other nodes has been reached either: this one takes rooms all the same"
                );
                return;
            }
        }
        sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    use chefshat_admission::limits::Key;
    use chefshat_room::ids::TournamentId;
    use futures::future::ready;

    use super::*;
    use crate::cluster::{FoundBy, Location};

    /// The other nodes, and which of them have not been reached.
    struct Others {
        nodes: Mutex<Vec<&'static str>>,
        unreached: Vec<&'static str>,
    }

    #[tonic::async_trait]
    impl Directory for Others {
        async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
            let nodes = self.nodes.lock().expect("no panic");
            let peers = nodes.iter().map(|node| Peer {
                node: Arc::from(*node),
                endpoint: Arc::from("192.0.2.1:1"),
            });
            (Arc::from("own"), peers.collect())
        }

        async fn unreached(&self) -> BTreeSet<Arc<str>> {
            self.unreached.iter().map(|node| Arc::from(*node)).collect()
        }

        async fn is_over(&self, _: TournamentId) -> bool {
            unreachable!("nobody asks")
        }

        async fn locate(&self, _: &FoundBy, _: Key) -> Location {
            unreachable!("nobody asks")
        }

        fn forget(&self, _: &FoundBy) {}
    }

    fn others(nodes: &[&'static str], unreached: &[&'static str]) -> Others {
        Others {
            nodes: Mutex::new(nodes.to_vec()),
            unreached: unreached.to_vec(),
        }
    }

    /// Waits until one of `reaching` is asked; returns how long that took and who was asked.
    async fn wait(directory: &Others, reaching: &[&str]) -> (Duration, BTreeSet<Arc<str>>) {
        let (began, asked) = (Instant::now(), Mutex::new(BTreeSet::new()));
        until_reached(directory, |peers, own| {
            assert_eq!(&*own, "own");
            assert!(peers.len() <= ASKED_AT_ONCE);
            let reached = peers.iter().any(|peer| reaching.contains(&&*peer.node));
            let names = peers.iter().map(|peer| Arc::clone(&peer.node));
            asked.lock().expect("no panic").extend(names);
            let refused = peers.into_iter().map(|peer| (peer, "no".to_owned()));
            ready(match reached {
                true => Ok(()),
                false => Err(refused.collect()),
            })
        })
        .await;
        (began.elapsed(), asked.into_inner().expect("no panic"))
    }

    #[tokio::test(start_paused = true)]
    async fn a_node_waits_for_one_that_has_been_reached_itself() {
        let (waited, asked) = wait(&others(&[], &[]), &[]).await;
        assert!(waited.is_zero() && asked.is_empty(), "alone");
        let names = ["a", "b", "c", "d", "e"];
        let (_, asked) = wait(&others(&names, &["e"]), &["d"]).await;
        assert!(!asked.contains("e"), "nobody has reached it");
        let (waited, asked) = wait(&others(&names, &names), &["e"]).await;
        assert!(waited < AMONG_NEW && asked.contains("e"));
        let (waited, _) = wait(&others(&names, &names), &[]).await;
        assert!(waited > AMONG_NEW, "they start together");
    }

    #[tokio::test(start_paused = true)]
    async fn while_a_node_lives_that_has_been_reached_a_node_waits() {
        let directory = others(&["a", "b"], &["b"]);
        let waiting = async { wait(&directory, &["b"]).await.0 };
        let lost = async {
            sleep(Duration::from_mins(10)).await;
            *directory.nodes.lock().expect("no panic") = vec!["b"];
        };
        let (waited, ()) = tokio::join!(waiting, lost);
        assert!(waited >= Duration::from_mins(10));
        assert!(waited <= Duration::from_mins(10) + LONGEST_PAUSE);
    }
}
