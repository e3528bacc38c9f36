//! The simplest agent: a random legal action.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::{ActionId, Agent, count_in, nth_in, v1};

/// Actions of a turn by default, until the start of the game states the number.
const STANDARD_TURN_ACTIONS: u32 = 200;
/// All actions by default, until the start of the game states the number.
const STANDARD_ACTIONS: u32 = 214;

/// Plays uniformly at random among the legal actions; without a mask, among all actions of the
/// decision's kind, legal or not. Its choices depend only on its seed and the requests.
#[derive(Debug, Clone)]
pub struct RandomAgent {
    rng: ChaCha8Rng,
    turn_actions: u32,
    actions: u32,
}

impl RandomAgent {
    /// Creates an agent with this seed.
    pub fn new(seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            turn_actions: STANDARD_TURN_ACTIONS,
            actions: STANDARD_ACTIONS,
        }
    }

    /// A random action of a mask; `None` if it has none.
    pub fn choose(&mut self, mask: &[u8]) -> Option<ActionId> {
        let n = self.below(u32::try_from(count_in(mask)).unwrap_or(u32::MAX));
        nth_in(mask, n as usize)
    }

    fn begin(&mut self, start: &v1::GameStarted) {
        if let Some(space) = &start.action_space {
            self.turn_actions = space.turn_actions;
            self.actions = space.size;
        }
    }

    /// A number below `n`, by multiplication: the bias is negligible at these sizes, and the result
    /// is the same in every version.
    fn below(&mut self, n: u32) -> u32 {
        let product = u64::from(self.rng.next_u32()) * u64::from(n);
        u32::try_from(product >> 32).expect("the upper half of a product of two u32 is a u32")
    }
}

impl Agent for RandomAgent {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        self.choose(&request.action_mask).unwrap_or_else(|| {
            if request.kind() == v1::DecisionKind::Turn {
                ActionId(self.below(self.turn_actions))
            } else {
                let others = self.actions.saturating_sub(self.turn_actions);
                ActionId(self.turn_actions.saturating_add(self.below(others)))
            }
        })
    }

    fn on_event(&mut self, event: &v1::GameEvent) {
        if let Some(v1::game_event::Kind::GameStarted(start)) = &event.kind {
            self.begin(start);
        }
    }

    fn on_snapshot(&mut self, snapshot: &v1::Snapshot) {
        if let Some(start) = &snapshot.game_started {
            self.begin(start);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(mask: &[u8], kind: v1::DecisionKind) -> v1::DecisionRequest {
        v1::DecisionRequest {
            action_mask: mask.to_vec(),
            kind: kind.into(),
            ..Default::default()
        }
    }

    #[test]
    fn reaches_every_legal_action_and_no_other() {
        let request = request(&[0b0010_0101, 0b1000_0000], v1::DecisionKind::Turn);
        let mut agent = RandomAgent::new(1);
        let mut seen: Vec<u32> = (0..1000).map(|_| agent.decide(&request).0).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen, [0, 2, 5, 15]);
    }

    #[test]
    fn same_seed_same_choices() {
        let request = request(&[0xff; 27], v1::DecisionKind::Turn);
        let play = |seed| -> Vec<ActionId> {
            let mut agent = RandomAgent::new(seed);
            (0..50).map(|_| agent.decide(&request)).collect()
        };
        assert_eq!(play(7), play(7));
        assert_ne!(play(7), play(8));
    }

    #[test]
    fn a_snapshot_tells_the_number_of_actions() {
        let mut agent = RandomAgent::new(3);
        agent.on_snapshot(&v1::Snapshot {
            game_started: Some(v1::GameStarted {
                action_space: Some(v1::ActionSpace {
                    turn_actions: 7,
                    size: 9,
                    ..v1::ActionSpace::default()
                }),
                ..v1::GameStarted::default()
            }),
            ..v1::Snapshot::default()
        });
        for _ in 0..100 {
            assert!(agent.decide(&request(&[], v1::DecisionKind::Turn)).0 < 7);
        }
    }

    #[test]
    fn without_a_mask_stays_in_its_kind_of_decision() {
        let mut agent = RandomAgent::new(3);
        for _ in 0..1000 {
            let turn = agent.decide(&request(&[], v1::DecisionKind::Turn));
            assert!(turn.0 < 200);
            let give = agent.decide(&request(&[], v1::DecisionKind::Exchange));
            assert!((200..214).contains(&give.0));
        }
    }
}
