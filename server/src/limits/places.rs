//! A limited number of places, shared by all callers: nobody has more than its share, and those
//! that wait get the next free place in turns, one caller after another.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard};

use tokio::sync::oneshot;

use super::{Key, Shares};

/// Places for connections, streams, rooms, calls, or turns of work.
#[derive(Debug)]
pub struct Places {
    total: usize,
    shares: Shares,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    taken: usize,
    by_key: HashMap<Key, usize>,
    /// Callers that wait, in the order of their next turn, with those who wait for each.
    waiting: VecDeque<(Key, VecDeque<oneshot::Sender<Held>>)>,
}

impl Places {
    /// Creates places.
    pub fn new(total: usize, shares: Shares) -> Arc<Self> {
        Arc::new(Self {
            total,
            shares,
            state: Mutex::default(),
        })
    }

    /// Number of places, taken or free.
    pub fn total(&self) -> usize {
        self.total
    }

    /// The most places that one caller may have.
    pub fn share_of(&self, key: Key) -> usize {
        self.shares.of(key, self.total)
    }

    /// Number of taken places.
    pub fn taken(&self) -> usize {
        self.lock().taken
    }

    /// Takes a place if one is free, the caller's share is not used up, and nobody at the caller's
    /// address waits.
    pub fn try_take(self: &Arc<Self>, key: Key) -> Option<Held> {
        let mut state = self.lock();
        let waits = state.waiting.iter().any(|(waiting, _)| *waiting == key);
        (!waits && self.has_place(&state, key)).then(|| self.hold(&mut state, key))
    }

    /// Waits for a place.
    pub async fn take(self: &Arc<Self>, key: Key) -> Held {
        if let Some(held) = self.try_take(key) {
            return held;
        }
        let (sender, granted) = oneshot::channel();
        {
            let mut state = self.lock();
            match state
                .waiting
                .iter_mut()
                .find(|(waiting, _)| *waiting == key)
            {
                Some((_, senders)) => senders.push_back(sender),
                None => state.waiting.push_back((key, [sender].into())),
            }
        }
        // A place may have been freed between the two locks.
        self.grant();
        granted.await.expect("those that wait stay in the queue")
    }

    fn has_place(&self, state: &State, key: Key) -> bool {
        let own = state.by_key.get(&key).copied().unwrap_or_default();
        state.taken < self.total && own < self.share_of(key)
    }

    fn hold(self: &Arc<Self>, state: &mut State, key: Key) -> Held {
        state.taken += 1;
        *state.by_key.entry(key).or_default() += 1;
        Held {
            places: Arc::clone(self),
            key,
        }
    }

    /// Gives free places to those that wait.
    fn grant(self: &Arc<Self>) {
        let mut granted = Vec::new();
        let mut state = self.lock();
        let mut passed = 0;
        while passed < state.waiting.len() && state.taken < self.total {
            let (key, mut senders) = state.waiting.pop_front().expect("someone waits");
            // Those that have given up are not asked again.
            senders.retain(|sender| !sender.is_closed());
            if self.has_place(&state, key)
                && let Some(sender) = senders.pop_front()
            {
                granted.push((sender, self.hold(&mut state, key)));
                passed = 0;
            } else {
                passed += 1;
            }
            if senders.is_empty() {
                passed = passed.saturating_sub(1);
            } else {
                state.waiting.push_back((key, senders));
            }
        }
        drop(state);
        for (sender, held) in granted {
            // If it has just given up, the place is freed again here.
            let _ = sender.send(held);
        }
    }

    fn free(self: &Arc<Self>, key: Key) {
        let mut state = self.lock();
        state.taken -= 1;
        if let Some(own) = state.by_key.get_mut(&key) {
            *own -= 1;
            if *own == 0 {
                state.by_key.remove(&key);
            }
        }
        let anyone_waits = !state.waiting.is_empty();
        drop(state);
        if anyone_waits {
            self.grant();
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        (self.state.lock()).expect("no code that holds this lock can panic")
    }
}

/// A place, free again when dropped.
#[derive(Debug)]
pub struct Held {
    places: Arc<Places>,
    key: Key,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.places.free(self.key);
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt as _;

    use super::*;

    const SHARES: Shares = Shares {
        local: 50,
        remote: 50,
    };

    fn key(last: u8) -> Key {
        Key::Address([192, 0, 2, last].into())
    }

    #[test]
    fn nobody_has_more_than_its_share_and_a_dropped_place_is_free() {
        let places = Places::new(4, SHARES);
        let first = places.try_take(key(1)).expect("free");
        let _second = places.try_take(key(1)).expect("free");
        assert!(places.try_take(key(1)).is_none(), "its share is used up");
        let _third = places.try_take(key(2)).expect("free");
        drop(first);
        assert!(places.try_take(key(1)).is_some());
        assert_eq!(places.taken(), 2);
    }

    #[tokio::test]
    async fn those_that_wait_get_places_in_turns() {
        let places = Places::new(1, SHARES);
        let held = places.try_take(key(1)).expect("free");
        let mut waiting: Vec<_> = [(1, 'a'), (1, 'b'), (2, 'c'), (2, 'd')]
            .into_iter()
            .map(|(caller, name)| (name, Box::pin(places.take(key(caller)))))
            .collect();
        for (_, take) in &mut waiting {
            assert!(take.now_or_never().is_none());
        }
        // One that gives up is passed over.
        waiting.retain(|(name, _)| *name != 'b');
        let mut order = Vec::new();
        let mut held = Some(held);
        while !waiting.is_empty() {
            held.take();
            let next = waiting
                .iter_mut()
                .position(|(_, take)| match take.now_or_never() {
                    Some(granted) => {
                        held = Some(granted);
                        true
                    }
                    None => false,
                });
            order.push(waiting.remove(next.expect("a free place is granted")).0);
        }
        assert_eq!(order, ['a', 'c', 'd']);
        drop(held);
        assert_eq!(places.taken(), 0);
    }
}
