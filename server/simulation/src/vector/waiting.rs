//! Decisions that wait for networks, of some of the games: a network takes those of all of them
//! together. `slot` adds them, `blocks` has them taken.

use chefshat_agents::{Network, NetworkBatch};
use chefshat_engine::{ActionId, Mask, Observation};

/// Decisions that wait, by the number of their network in the setup.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    by_network: Vec<Group>,
    /// Decisions that have been taken: the places of their games, and their actions.
    taken: Vec<(usize, ActionId)>,
}

/// Decisions that wait for one network.
#[derive(Debug, Default)]
struct Group {
    batch: NetworkBatch,
    /// The place of each decision's game among the games.
    places: Vec<usize>,
}

impl Waiting {
    /// Has a network choose, or adds the decision of the game at a place.
    pub(super) fn decide_or_wait(
        &mut self,
        number: usize,
        network: &Network,
        place: usize,
        observation: &Observation,
        legal: &Mask,
    ) -> Option<ActionId> {
        if self.by_network.len() <= number {
            self.by_network.resize_with(number + 1, Group::default);
        }
        let group = &mut self.by_network[number];
        let action = network.decide_or_wait(observation, legal, &mut group.batch);
        if action.is_none() {
            group.places.push(place);
        }
        action
    }

    /// Takes all decisions that wait. Calls `next` with each game's place and action, which may add
    /// further ones, until none waits.
    pub(super) fn take_all<'a>(
        &mut self,
        network: impl Fn(usize) -> &'a Network,
        mut next: impl FnMut(&mut Waiting, usize, ActionId),
    ) {
        while self.by_network.iter().any(|group| !group.batch.is_empty()) {
            let mut taken = std::mem::take(&mut self.taken);
            for (number, Group { batch, places }) in self.by_network.iter_mut().enumerate() {
                network(number).decide_all(batch, |decision, action| {
                    taken.push((places[decision], action));
                });
                places.clear();
            }
            for (place, action) in taken.drain(..) {
                next(self, place, action);
            }
            self.taken = taken;
        }
    }
}
