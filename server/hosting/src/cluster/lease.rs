//! What the rooms, tournaments and studies of a node share with its task: until when they may publish,
//! whether the node takes new ones, and which of them are new or have stopped by themselves.

use std::collections::BTreeSet;
use std::future::Future;

use chefshat_cluster::NodeId;
use chefshat_room::ids::UnitId;
use tokio::sync::{Notify, watch};
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;

use chefshat_base::lock::Lock;
use chefshat_store::StoreError;

/// The lease of a node, as its rooms, tournaments and studies see it.
///
/// It is checked before anything is published, on the clock and not by a message from the task: a
/// process that was stopped for a while must not publish before that task runs again.
#[derive(Debug)]
pub struct NodeLease {
    until: watch::Sender<Instant>,
    node: Lock<Option<NodeId>>,
    /// Whether another node has reached this one since it joined, or there was none. Until then it
    /// creates nothing and takes nothing over.
    reached: watch::Sender<bool>,
    news: Lock<BTreeSet<(UnitId, UnitEvent)>>,
    has_news: Notify,
}

/// What the task of a node learns about a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum UnitEvent {
    /// It was created here.
    Created {
        /// Whether it is a room that no other node can resume.
        ephemeral: bool,
    },
    /// Something of it has stopped by itself: it was fenced, or it failed.
    Stopped,
}

impl NodeLease {
    /// No lease yet.
    pub fn new() -> Self {
        Self {
            until: watch::Sender::new(Instant::now()),
            node: Lock::default(),
            reached: watch::Sender::default(),
            news: Lock::default(),
            has_news: Notify::new(),
        }
    }

    /// Whether the node may publish now.
    pub fn holds(&self) -> bool {
        Instant::now() < *self.until.borrow()
    }

    /// Whether another node has reached this one since it joined, or there was none.
    pub(crate) fn is_reached(&self) -> bool {
        *self.reached.borrow()
    }

    /// Notes that another node has reached this one, or that there is none.
    pub fn set_reached(&self) {
        self.reached.send_replace(true);
    }

    /// Waits until the node has joined, for the first time or again, and has not been reached since.
    pub async fn joined_anew(&self) {
        let mut reached = self.reached.subscribe();
        let anew = reached.wait_for(|reached| !reached && self.node().is_some());
        anew.await.expect("the sender is borrowed");
    }

    /// Whether the node has been reached since it joined, and each change of that.
    pub(crate) fn reached(&self) -> watch::Receiver<bool> {
        self.reached.subscribe()
    }

    /// The node, once it has joined.
    pub(crate) fn node(&self) -> Option<NodeId> {
        *self.node.lock()
    }

    /// Sets the node, which has just joined.
    pub(crate) fn joined(&self, node: NodeId) {
        *self.node.lock() = Some(node);
        self.reached.send_replace(false);
    }

    /// Waits until the node may not publish.
    pub async fn lapsed(&self) {
        while self.holds() {
            let until = *self.until.borrow();
            sleep_until(until).await;
        }
    }

    /// Waits until the node may publish.
    pub async fn held(&self) {
        let mut until = self.until.subscribe();
        let held = until.wait_for(|until| Instant::now() < *until).await;
        held.expect("the sender is borrowed");
    }

    /// The result of a write for a tournament or study, once the node may publish it. Its task must
    /// stop, which cancels `end`, if another node may have it.
    ///
    /// # Errors
    /// The write failed, or the task stops.
    pub async fn published<T>(
        &self,
        unit: UnitId,
        end: &CancellationToken,
        written: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        let written = async {
            let written = written.await?;
            self.held().await;
            Ok(written)
        };
        tokio::select! {
            biased;
            written = written => written,
            () = end.cancelled() => Err(StoreError::Fenced(unit)),
        }
    }

    /// Sets until when the node may publish.
    pub fn set(&self, until: Instant) {
        self.until.send_if_modified(|known| {
            let is_new = *known != until;
            *known = until;
            is_new
        });
    }

    /// Tells the task of the node about a unit.
    pub fn report(&self, unit: UnitId, news: UnitEvent) {
        self.news.lock().insert((unit, news));
        self.has_news.notify_one();
    }

    /// Waits until there is news, and returns it.
    pub(crate) async fn news(&self) -> BTreeSet<(UnitId, UnitEvent)> {
        loop {
            let news = std::mem::take(&mut *self.news.lock());
            if !news.is_empty() {
                return news;
            }
            self.has_news.notified().await;
        }
    }
}

impl Default for NodeLease {
    fn default() -> Self {
        Self::new()
    }
}
