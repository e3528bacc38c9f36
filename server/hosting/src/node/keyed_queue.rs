//! The order of what is done with one unit: one thing after another, while different units do not
//! wait for each other.

use std::collections::BTreeMap;
use std::convert::Infallible;

use chefshat_room::ids::UnitId;
use tokio::sync::oneshot;
use tokio::sync::oneshot::error::TryRecvError;

/// The end of the latest work with each unit.
#[derive(Default)]
pub(super) struct KeyedQueue(BTreeMap<UnitId, oneshot::Receiver<Infallible>>);

/// A place in the order of a unit. Dropping it lets the next one come.
pub(super) struct Queued {
    before: Option<oneshot::Receiver<Infallible>>,
    _ends: oneshot::Sender<Infallible>,
}

impl KeyedQueue {
    /// The place after all that were taken for the unit.
    pub(super) fn take(&mut self, unit: UnitId) -> Queued {
        let (ends, ended) = oneshot::channel();
        Queued {
            before: self.0.insert(unit, ended),
            _ends: ends,
        }
    }

    /// Whether nothing is being done with a unit.
    pub(super) fn is_idle(&mut self, unit: UnitId) -> bool {
        let Some(latest) = self.0.get_mut(&unit) else {
            return true;
        };
        if latest.try_recv() == Err(TryRecvError::Empty) {
            return false;
        }
        // A receiver that has seen the end cannot be awaited again: the next place must not get it.
        self.0.remove(&unit);
        true
    }

    /// Forgets the units with which nothing is done any more.
    pub(super) fn forget_ended(&mut self) {
        self.0
            .retain(|_, ended| ended.try_recv() == Err(TryRecvError::Empty));
    }
}

impl Queued {
    /// Waits until all before it have ended.
    pub(super) async fn comes(&mut self) {
        if let Some(before) = self.before.take() {
            // Ends when its sender is dropped.
            let _ = before.await;
        }
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt as _;

    use super::*;

    #[test]
    fn one_comes_after_another_and_units_without_work_are_forgotten() {
        let (unit, other) = (UnitId::from_bytes([1; 16]), UnitId::from_bytes([2; 16]));
        let mut queue = KeyedQueue::default();
        let (first, mut second) = (queue.take(unit), queue.take(unit));
        drop(queue.take(other));
        assert_eq!(second.comes().now_or_never(), None);
        queue.forget_ended();
        assert!(queue.0.keys().eq([&unit]));
        assert!(!queue.is_idle(unit) && queue.is_idle(other));

        drop(first);
        assert_eq!(second.comes().now_or_never(), Some(()));
        queue.forget_ended();
        assert!(queue.0.keys().eq([&unit]), "the second remains");
        drop(second);
        assert!(queue.is_idle(unit));
        let mut third = queue.take(unit);
        assert_eq!(third.comes().now_or_never(), Some(()));
        drop(third);
        queue.forget_ended();
        assert!(queue.0.is_empty());
    }
}
