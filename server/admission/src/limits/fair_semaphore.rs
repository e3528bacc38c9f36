//! A limited number of permits, shared by all callers: nobody has more than its share, and those
//! that wait get the next free permit in turns, one caller after another.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::oneshot;

use super::{Key, Shares};
use chefshat_base::lock::Lock;

/// Longest time that a call waits until its caller may make another one.
pub const MAX_WAIT: Duration = Duration::from_secs(5);

/// Permits for connections, streams, rooms, calls, or turns of work.
#[derive(Debug)]
pub struct FairSemaphore {
    total: usize,
    shares: Shares,
    state: Lock<State>,
}

#[derive(Debug, Default)]
struct State {
    taken: usize,
    /// Callers that have permits or wait for one.
    callers: HashMap<Key, Caller>,
    /// Permits of the networks of one site of IPv6 together, if they have any.
    sites: HashMap<Key, usize>,
    /// Callers that wait, in the order of their next turn.
    turns: VecDeque<Key>,
    /// Number of the next one that waits.
    next: u64,
    /// Whether the next turn needs more permits than are free. Then nobody else takes any before.
    reserved: bool,
}

#[derive(Debug, Default)]
struct Caller {
    taken: usize,
    /// Those that wait, by number, and for how many permits. A flood makes this long: nothing may
    /// search it.
    waiting: BTreeMap<u64, (usize, oneshot::Sender<Permit>)>,
}

impl State {
    /// Removes a caller that has nothing and waits for nothing.
    fn forget_idle(&mut self, key: Key) {
        let is_idle = |caller: &Caller| caller.taken == 0 && caller.waiting.is_empty();
        if self.callers.get(&key).is_some_and(is_idle) {
            self.callers.remove(&key);
        }
    }
}

impl FairSemaphore {
    /// Creates permits.
    pub fn new(total: usize, shares: Shares) -> Arc<Self> {
        Arc::new(Self {
            total,
            shares,
            state: Lock::default(),
        })
    }

    /// Number of permits, taken or free.
    pub fn total(&self) -> usize {
        self.total
    }

    /// The most permits that one caller may have.
    pub fn share_of(&self, key: Key) -> usize {
        self.shares.of(key, self.total)
    }

    /// Number of taken permits.
    pub fn taken(&self) -> usize {
        self.state.lock().taken
    }

    /// Takes a permit if one is free, the caller's share is not used up, and the caller does not
    /// wait for another one.
    pub fn try_take(self: &Arc<Self>, key: Key) -> Option<Permit> {
        self.try_take_many(key, 1)
    }

    /// Takes a permit for what exists already, also if none is free: nobody else gets one until there
    /// are fewer.
    pub fn take_anyway(self: &Arc<Self>, key: Key) -> Permit {
        self.take_many_anyway(key, 1)
    }

    /// Takes this number of permits in the same way.
    pub fn take_many_anyway(self: &Arc<Self>, key: Key, count: usize) -> Permit {
        self.hold(&mut self.state.lock(), key, count)
    }

    /// Takes this number of permits, or none.
    pub fn try_take_many(self: &Arc<Self>, key: Key, count: usize) -> Option<Permit> {
        self.take_now(&mut self.state.lock(), key, count)
    }

    /// Waits for a permit.
    pub async fn take(self: &Arc<Self>, key: Key) -> Permit {
        self.take_many(key, 1).await
    }

    /// Waits for this number of permits, or for as many as the caller may have at all.
    pub async fn take_many(self: &Arc<Self>, key: Key, count: usize) -> Permit {
        let count = count.min(self.share_of(key));
        let (granted, _waiting) = {
            let mut state = self.state.lock();
            if let Some(held) = self.take_now(&mut state, key, count) {
                return held;
            }
            let (sender, granted) = oneshot::channel();
            let number = state.next;
            state.next += 1;
            let caller = state.callers.entry(key).or_default();
            let is_first = caller.waiting.is_empty();
            caller.waiting.insert(number, (count, sender));
            if is_first {
                state.turns.push_back(key);
            }
            let places = self;
            let waiting = Waiting {
                places,
                key,
                number,
            };
            (granted, waiting)
        };
        granted.await.expect("those that wait stay in the queue")
    }

    fn take_now(self: &Arc<Self>, state: &mut State, key: Key, count: usize) -> Option<Permit> {
        let waits = (state.callers.get(&key)).is_some_and(|caller| !caller.waiting.is_empty());
        let free = !waits && !state.reserved && state.taken + count <= self.total;
        (free && self.has_share(state, key, count)).then(|| self.hold(state, key, count))
    }

    fn has_share(&self, state: &State, key: Key, count: usize) -> bool {
        let own = state.callers.get(&key).map_or(0, |caller| caller.taken);
        let has_site = || {
            let Some(site) = key.site_of_networks() else {
                return true;
            };
            let of_site = state.sites.get(&site).copied().unwrap_or(0);
            of_site + count <= self.shares.of_addresses().of(site, self.total)
        };
        own + count <= self.share_of(key) && has_site()
    }

    fn hold(self: &Arc<Self>, state: &mut State, key: Key, count: usize) -> Permit {
        state.taken += count;
        state.callers.entry(key).or_default().taken += count;
        if let Some(site) = key.site_of_networks() {
            *state.sites.entry(site).or_default() += count;
        }
        Permit {
            places: Arc::clone(self),
            key,
            count,
        }
    }

    /// Gives a free permit to the next one that waits.
    fn grant(self: &Arc<Self>, state: &mut State) -> Option<(oneshot::Sender<Permit>, Permit)> {
        state.reserved = false;
        let first = |key| state.callers.get(key)?.waiting.values().next();
        let mut turns = (state.turns.iter().enumerate())
            .filter_map(|(turn, key)| Some((turn, *key, first(key)?.0)));
        // Those whose share is used up are passed over.
        let (turn, key, count) =
            turns.find(|(_, key, count)| self.has_share(state, *key, *count))?;
        if state.taken + count > self.total {
            state.reserved = true;
            return None;
        }
        state.turns.remove(turn);
        let caller = state.callers.get_mut(&key)?;
        let (_, (_, sender)) = caller.waiting.pop_first()?;
        if !caller.waiting.is_empty() {
            state.turns.push_back(key);
        }
        Some((sender, self.hold(state, key, count)))
    }

    /// Grants permits to those that wait as long as there are enough.
    fn grant_all(self: &Arc<Self>, state: &mut State) -> Vec<(oneshot::Sender<Permit>, Permit)> {
        std::iter::from_fn(|| self.grant(state)).collect()
    }

    fn free(self: &Arc<Self>, key: Key, count: usize) {
        let mut state = self.state.lock();
        state.taken -= count;
        if let Some(caller) = state.callers.get_mut(&key) {
            caller.taken -= count;
        }
        if let Some(site) = key.site_of_networks()
            && let Entry::Occupied(mut taken) = state.sites.entry(site)
        {
            *taken.get_mut() -= count;
            if *taken.get() == 0 {
                taken.remove();
            }
        }
        let granted = self.grant_all(&mut state);
        state.forget_idle(key);
        drop(state);
        send(granted);
    }
}

fn send(granted: Vec<(oneshot::Sender<Permit>, Permit)>) {
    for (sender, held) in granted {
        // If it has just given up, the permits are freed again here.
        let _ = sender.send(held);
    }
}

/// Permits, free again when dropped.
#[derive(Debug)]
pub struct Permit {
    places: Arc<FairSemaphore>,
    key: Key,
    count: usize,
}

impl Permit {
    /// Gives back all but `count` permits.
    pub fn keep(&mut self, count: usize) {
        let freed = self.count.saturating_sub(count);
        if freed > 0 {
            self.count -= freed;
            self.places.free(self.key, freed);
        }
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.places.free(self.key, self.count);
    }
}

/// One that waits. When dropped, it waits no longer.
struct Waiting<'a> {
    places: &'a Arc<FairSemaphore>,
    key: Key,
    number: u64,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let mut state = self.places.state.lock();
        let Some(caller) = state.callers.get_mut(&self.key) else {
            return;
        };
        let gave_up = caller.waiting.remove(&self.number).is_some();
        if gave_up && caller.waiting.is_empty() {
            state.turns.retain(|key| *key != self.key);
        }
        // Others may have waited behind it.
        let granted = match gave_up {
            true => self.places.grant_all(&mut state),
            false => Vec::new(),
        };
        state.forget_idle(self.key);
        drop(state);
        send(granted);
    }
}

/// Waits at most [`MAX_WAIT`].
pub(super) async fn within<T>(waiting: impl Future<Output = T>) -> Option<T> {
    tokio::time::timeout(MAX_WAIT, waiting).await.ok()
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
        let places = FairSemaphore::new(4, SHARES);
        let first = places.try_take(key(1)).expect("free");
        let _second = places.try_take(key(1)).expect("free");
        assert!(places.try_take(key(1)).is_none(), "its share is used up");
        let _third = places.try_take(key(2)).expect("free");
        drop(first);
        assert!(places.try_take(key(1)).is_some());
        assert_eq!(places.taken(), 2);
    }

    #[test]
    fn the_networks_of_a_site_leave_half_to_others() {
        let shares = Shares {
            local: 50,
            remote: 10,
        };
        let places = FairSemaphore::new(100, shares);
        let network = |site: u16, number: u16| {
            let address = [0x2001, 0xdb8, site, number, 0, 0, 0, 1];
            Key::of_address(Some(std::net::IpAddr::from(address)))
        };
        let mut taken: Vec<_> = (0..20)
            .filter_map(|number| places.try_take_many(network(1, number), 10))
            .collect();
        assert_eq!(places.taken(), 50);
        assert!(places.try_take(network(1, 30)).is_none());
        let _other = places.try_take(network(2, 0)).expect("another site");
        taken.pop();
        assert!(places.try_take(network(1, 30)).is_some());
        drop(taken);
        assert_eq!(places.state.lock().sites.len(), 1);
    }

    #[test]
    fn several_places_are_taken_together_or_not_at_all() {
        let places = FairSemaphore::new(8, SHARES);
        let first = places.try_take_many(key(1), 3).expect("free");
        assert!(
            places.try_take_many(key(1), 2).is_none(),
            "beyond its share"
        );
        let _rest = places.try_take_many(key(1), 1).expect("free");
        let _other = places.try_take_many(key(2), 4).expect("free");
        assert!(places.try_take(key(3)).is_none(), "none is free");
        drop(first);
        assert_eq!(places.taken(), 5);
        assert!(places.try_take_many(key(3), 3).is_some());
    }

    #[tokio::test]
    async fn those_that_give_up_leave_nothing() {
        let places = FairSemaphore::new(2, SHARES);
        let held = places.try_take_many(key(1), 1).expect("free");
        let mut waiting: Vec<_> = (0..3).map(|_| Box::pin(places.take(key(1)))).collect();
        for take in &mut waiting {
            assert!(take.now_or_never().is_none(), "its share is used up");
        }
        assert!(places.try_take(key(1)).is_none());
        drop(waiting);
        assert!(places.state.lock().turns.is_empty());
        drop(held);
        assert!(places.state.lock().callers.is_empty());
        assert!(places.take(key(1)).now_or_never().is_some());
    }

    #[tokio::test]
    async fn many_places_are_waited_for_and_nobody_overtakes() {
        let places = FairSemaphore::new(8, SHARES);
        let mut first = places.try_take_many(key(1), 4).expect("free");
        let second = places.try_take_many(key(2), 2).expect("free");
        let mut third = Box::pin(places.take_many(key(3), 4));
        assert!((&mut third).now_or_never().is_none(), "two are free");
        drop(places.try_take(key(4)).expect("nothing was given back yet"));
        assert!(
            places.try_take(key(4)).is_none(),
            "the free ones are reserved"
        );
        // Beyond its share, a caller gets what it may have at all.
        let mut fourth = Box::pin(places.take_many(key(4), 100));
        assert!((&mut fourth).now_or_never().is_none());
        drop(second);
        let third = third.now_or_never().expect("four are free");
        drop(third);
        drop((&mut fourth).now_or_never().expect("four are free"));
        // One that gives up no longer reserves what is free.
        let second = places.try_take_many(key(2), 2).expect("free");
        let mut third = Box::pin(places.take_many(key(3), 4));
        assert!((&mut third).now_or_never().is_none());
        first.keep(3);
        assert!(places.try_take(key(4)).is_none());
        drop(third);
        drop(places.try_take(key(4)).expect("free"));
        drop((first, second));
        assert_eq!(places.taken(), 0);
        assert!(places.state.lock().callers.is_empty());
    }

    #[tokio::test]
    async fn one_that_gives_up_lets_smaller_requests_of_its_caller_pass() {
        let places = FairSemaphore::new(20, SHARES);
        let _held = places.try_take_many(key(1), 5).expect("free");
        let mut large = Box::pin(places.take_many(key(1), 8));
        assert!((&mut large).now_or_never().is_none(), "beyond its share");
        let mut small = Box::pin(places.take_many(key(1), 2));
        assert!((&mut small).now_or_never().is_none(), "it waits behind");
        drop(large);
        assert!((&mut small).now_or_never().is_some());
    }

    #[tokio::test]
    async fn those_that_wait_get_places_in_turns() {
        let places = FairSemaphore::new(1, SHARES);
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
