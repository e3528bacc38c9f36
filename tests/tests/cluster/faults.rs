//! The faults of a round, and how each heals.

use chefshat_postgres::Server as Postgres;
use chefshat_tests::{BusyRooms, Held, patiently};
use rand::rngs::SmallRng;
use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};

use crate::cluster::Cluster;

/// Most decisions acknowledged before a fault, and during one that ends by itself.
const MOST_DECISIONS: u64 = 40;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    /// A node is killed, and started again once others have its rooms.
    Kill,
    /// A node is killed, and started again at once.
    KillAndRestart,
    /// A node is frozen until others have its rooms, and continues as if it had not been.
    Freeze,
    /// The database ends all connections of a node.
    Terminate,
    /// The database is restarted; running statements end with an error.
    RestartDatabase,
    /// The database crashes.
    CrashDatabase,
    /// A node and the database are separated until others have its rooms.
    LoseDatabase,
    /// A node and the database are separated for a moment.
    MissDatabase,
    /// A node does not learn what has been committed: the answers of the database are lost.
    LoseAnswers,
    /// Two nodes are separated for a moment, and rarely, since it takes long, until every room has
    /// found a way around.
    Separate,
    /// The connections between two nodes break.
    Disconnect,
    /// A node is stopped as for an upgrade, and started again.
    Drain,
}

const ALL: [Fault; 12] = [
    Fault::Kill,
    Fault::KillAndRestart,
    Fault::Freeze,
    Fault::Terminate,
    Fault::RestartDatabase,
    Fault::CrashDatabase,
    Fault::LoseDatabase,
    Fault::MissDatabase,
    Fault::LoseAnswers,
    Fault::Separate,
    Fault::Disconnect,
    Fault::Drain,
];

/// Chooses faults: each kind equally often, in any order.
pub(crate) struct Faults {
    random: SmallRng,
    left: Vec<Fault>,
}

impl Faults {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            random: SmallRng::seed_from_u64(seed),
            left: Vec::new(),
        }
    }

    /// Lets some decisions pass, then something goes wrong and heals. Every room has gone on when
    /// this returns. Returns what it was.
    pub(crate) async fn strike(&mut self, cluster: &mut Cluster, rooms: &BusyRooms) -> Fault {
        if self.left.is_empty() {
            self.left = ALL.to_vec();
            self.left.shuffle(&mut self.random);
        }
        let fault = self.left.pop().expect("not empty");
        let mut nodes: Vec<usize> = (0..cluster.nodes.len()).collect();
        nodes.shuffle(&mut self.random);
        let (node, other) = (nodes[0], nodes[1]);
        self.some_decisions(rooms).await;
        eprintln!("{fault:?}, node {node}");
        match fault {
            Fault::Kill => {
                cluster.kill(node).await;
                cluster.taken_over(node).await;
                cluster.restart(node).await;
            }
            Fault::KillAndRestart => {
                cluster.kill(node).await;
                cluster.restart(node).await;
            }
            Fault::Freeze => {
                cluster.nodes[node].process().freeze().await;
                cluster.taken_over(node).await;
                cluster.nodes[node].process().thaw().await;
            }
            Fault::Terminate => cluster.terminate_connections(node),
            Fault::RestartDatabase => cluster.restart_database(Postgres::shut_down),
            Fault::CrashDatabase => cluster.restart_database(Postgres::stop),
            Fault::LoseDatabase => {
                let way = cluster.nodes[node].database.way().clone();
                way.hold(Held::Everything);
                cluster.taken_over(node).await;
                way.hold(Held::Nothing);
            }
            Fault::MissDatabase => {
                let way = cluster.nodes[node].database.way().clone();
                way.hold(Held::Everything);
                self.some_decisions(rooms).await;
                way.hold(Held::Nothing);
            }
            Fault::LoseAnswers => {
                let way = cluster.nodes[node].database.way().clone();
                way.hold(Held::Answers);
                self.some_decisions(rooms).await;
                way.cut();
                way.hold(Held::Nothing);
            }
            Fault::Separate => {
                cluster.separate(node, other);
                match self.random.random_ratio(1, 8) {
                    true => rooms.all_go_on().await,
                    false => self.some_decisions(rooms).await,
                }
                cluster.join(node, other);
            }
            Fault::Disconnect => cluster.join(node, other),
            Fault::Drain => {
                cluster.stop(node).await;
                cluster.restart(node).await;
            }
        }
        rooms.all_go_on().await;
        fault
    }

    /// Waits for some decisions.
    async fn some_decisions(&mut self, rooms: &BusyRooms) {
        let more = self.random.random_range(1..=MOST_DECISIONS);
        let ledger = &rooms.ledger;
        patiently("decisions", ledger.reaches(ledger.count() + more)).await;
    }
}
