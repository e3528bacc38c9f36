//! Imitates a recorded player. Reading decisions from a record happens elsewhere.

use std::collections::HashMap;

use chefshat_engine::{
    ActionId, ActionSpace, Cards, Face, Mask, Observation, RecordedDecision, Seat,
};

/// A player of a recorded game, as an agent that imitates it.
///
/// - Where the seat sees exactly what it saw at a recorded decision (same observation, same legal
///   actions), it repeats that decision. Shift, pizza, cards played, cards given and hand tell all
///   decisions of a game apart. So in its own game it repeats itself from any point on, also after
///   the game has deviated and returned to a known situation.
/// - Otherwise it repeats the most similar recorded decision of the same kind whose action is legal
///   now, the earliest of equals, among the first [`MAX_MODELS`] decisions. Actions are translated
///   by meaning, because their indices depend on the deck.
/// - If there is none, it takes the default decision.
///
/// The difference of two decisions, from 0 (equal) to 14, is the weighted sum of the following,
/// each from 0 to 1 in millionths, rounded down. F and H are the faces and the cards dealt to a
/// hand in each decision's game; seats are counted to the left of the player's own.
///
/// | weight | difference |
/// |---|---|
/// | 4 | of the hands: Σ over kinds of cards of \|a − b\| / Σ of (a + b), with a and b the number of cards of that kind |
/// | 3 | of the faces on the board, each divided by F + 2, a joker alone counting as F + 1 and an empty board as F + 2 |
/// | 2 | of the numbers of cards on the board, each divided by F |
/// | 2 | of the cards left to each other seat, each divided by H: the mean over these seats |
/// | 1 | of who may not play any more: the share of the other seats that have passed or finished in one of the two alone |
/// | 1 | of the own role: 0 if it is the same, else 1 |
/// | 1 | of the cards played so far in the Shift, as for the hands |
///
/// Where one game has more seats than the other, missing seats count as holding no cards and having
/// passed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPlayer {
    decisions: Vec<RecordedDecision>,
    /// Indices into `decisions` by the most distinctive values.
    by_glance: HashMap<Glance, Vec<usize>>,
}

/// Values that tell nearly all decisions of a game apart: Shift, pizza, hand, cards played.
type Glance = (u32, u32, Cards, Cards);

fn glance(seen: &Observation) -> Glance {
    (seen.shift, seen.pizza, seen.hand, seen.played)
}

/// Maximum number of decisions searched for the most similar one: the first of the recorded game.
pub const MAX_MODELS: usize = 2_048;

const HAND: u64 = 4;
const BOARD_FACE: u64 = 3;
const BOARD_SIZE: u64 = 2;
const CARDS_LEFT: u64 = 2;
const PASSED: u64 = 1;
const ROLE: u64 = 1;
const PLAYED: u64 = 1;
/// A difference of 1. Integers make ties the same on every machine.
const WHOLE: u64 = 1_000_000;

impl RecordedPlayer {
    /// The player of these decisions, in order. Skips decisions without an open decision in the
    /// observation, or with an illegal action.
    pub fn new(decisions: impl IntoIterator<Item = RecordedDecision>) -> Self {
        let sound = |decision: &RecordedDecision| {
            decision.observation.kind.is_some()
                && decision.observation.seat.is_some()
                && decision.legal.contains(decision.action)
        };
        let decisions: Vec<RecordedDecision> = decisions.into_iter().filter(sound).collect();
        let mut by_glance: HashMap<Glance, Vec<usize>> = HashMap::new();
        for (position, decision) in decisions.iter().enumerate() {
            let alike = by_glance.entry(glance(&decision.observation));
            alike.or_default().push(position);
        }
        Self {
            decisions,
            by_glance,
        }
    }

    /// The decisions, in order.
    pub fn decisions(&self) -> &[RecordedDecision] {
        &self.decisions
    }

    /// Chooses one of the legal actions.
    ///
    /// # Panics
    /// If `legal` is empty, or no decision is open for the observation's seat.
    pub fn decide(&self, observation: &Observation, legal: &Mask) -> ActionId {
        self.repeated(observation, legal)
            .or_else(|| self.most_similar(observation, legal))
            .or_else(|| observation.default_action(legal))
            .expect("a decision has a legal action")
    }

    /// The decision recorded for exactly this situation.
    fn repeated(&self, observation: &Observation, legal: &Mask) -> Option<ActionId> {
        self.by_glance
            .get(&glance(observation))?
            .iter()
            .map(|position| &self.decisions[*position])
            .find(|then| then.observation == *observation && then.legal == *legal)
            .map(|then| then.action)
    }

    /// The decision recorded for the most similar situation.
    fn most_similar(&self, observation: &Observation, legal: &Mask) -> Option<ActionId> {
        let now = space(observation);
        let mut best: Option<(u64, ActionId)> = None;
        let own = self.decisions.iter().filter(|then| then.own);
        for then in own.take(MAX_MODELS) {
            if then.observation.kind != observation.kind {
                continue;
            }
            let meaning = space(&then.observation).decode(then.action);
            let Some(action) = meaning
                .and_then(|meaning| now.encode(meaning))
                .filter(|action| legal.contains(*action))
            else {
                continue;
            };
            let difference = difference(&then.observation, observation);
            if best.is_none_or(|(least, _)| difference < least) {
                best = Some((difference, action));
            }
        }
        best.map(|(_, action)| action)
    }
}

/// The difference of two decisions in millionths: the sum of the table at [`RecordedPlayer`].
fn difference(a: &Observation, b: &Observation) -> u64 {
    HAND * cards_apart(a.hand, b.hand)
        + BOARD_FACE * apart(board_face(a), board_face(b))
        + BOARD_SIZE * apart((a.board.size, a.faces), (b.board.size, b.faces))
        + others_apart(a, b)
        + ROLE * WHOLE * u64::from(own_role(a) != own_role(b))
        + PLAYED * cards_apart(a.played, b.played)
}

/// The difference of two fractions of at most 1, in millionths.
fn apart(a: (u8, u8), b: (u8, u8)) -> u64 {
    let [(a, of_a), (b, of_b)] = [a, b].map(|(part, of)| (u64::from(part), u64::from(of)));
    (a * of_b).abs_diff(b * of_a) * WHOLE / (of_a * of_b)
}

/// The share of cards by which two hands differ, in millionths.
fn cards_apart(a: Cards, b: Cards) -> u64 {
    let all = a.len() + b.len();
    if all == 0 {
        return 0;
    }
    let faces = (1..=chefshat_engine::MAX_FACES).filter_map(Face::new);
    let differ: u8 = faces
        .map(|face| a.count(face).abs_diff(b.count(face)))
        .sum();
    let jokers = a.jokers().abs_diff(b.jokers());
    u64::from(differ + jokers) * WHOLE / u64::from(all)
}

fn board_face(observation: &Observation) -> (u8, u8) {
    let empty = observation.faces + 2;
    match observation.board.face {
        0 => (empty, empty),
        face => (face, empty),
    }
}

fn own_role(observation: &Observation) -> Option<chefshat_engine::Role> {
    observation.seat.and_then(|seat| observation.roles[seat])
}

/// The weighted difference of the other seats, in millionths: their cards, and whether they have
/// passed or finished.
fn others_apart(a: &Observation, b: &Observation) -> u64 {
    let seats = a.cards_left.len().max(b.cards_left.len());
    let (mut left, mut passed) = (0, 0);
    for distance in 1..seats {
        let ((left_a, passed_a), (left_b, passed_b)) = (other(a, distance), other(b, distance));
        left += apart((left_a, a.hand_size), (left_b, b.hand_size));
        passed += WHOLE * u64::from(passed_a != passed_b);
    }
    let others = seats as u64 - 1;
    CARDS_LEFT * (left / others) + PASSED * (passed / others)
}

/// The cards of the seat at this distance to the left, and whether it has passed or finished.
fn other(observation: &Observation, distance: usize) -> (u8, bool) {
    let seats = observation.cards_left.len();
    let Some(own) = observation.seat.filter(|_| distance < seats) else {
        return (0, true);
    };
    let seat = Seat::new((own.index() + distance) % seats);
    let left = observation.cards_left[seat];
    (left, observation.passed[seat] || left == 0)
}

fn space(observation: &Observation) -> ActionSpace {
    ActionSpace::new(observation.faces).expect("an observation has 4 to 15 faces")
}

#[cfg(test)]
mod tests {
    use chefshat_engine::{Game, RuleSetSpec, Seed, Viewer};

    use crate::recorded::*;

    fn observation() -> Observation {
        let rules = RuleSetSpec::default()
            .validate()
            .expect("valid default rules");
        let game = Game::new(rules, Seed([3; 32]), |_| {});
        let seat = game.decision().expect("a decision is open").seat;
        game.observe(Viewer::Seat(seat))
    }

    #[test]
    fn differences_are_weighted() {
        let base = observation();
        let own = base.seat.expect("a seat's observation");
        let left = |distance: usize| Seat::new((own.index() + distance) % 4);
        let face = |n| Face::new(n).expect("a face");
        let changed = |change: &dyn Fn(&mut Observation)| {
            let mut other = base;
            change(&mut other);
            assert_eq!(difference(&base, &other), difference(&other, &base));
            difference(&base, &other)
        };
        let held = (1..=11)
            .map(face)
            .find(|face| base.hand.count(*face) > 0)
            .expect("a card");
        let fewer = base.hand.without_face(held, 1).expect("it is held");
        let table = [
            (changed(&|_| {}), 0),
            // Nothing in common.
            (changed(&|seen| seen.hand = Cards::EMPTY), HAND * WHOLE),
            // One card of 17 and 16.
            (changed(&|seen| seen.hand = fewer), HAND * (WHOLE / 33)),
            (
                changed(&|seen| seen.board.face = 11),
                BOARD_FACE * (2 * WHOLE / 13),
            ),
            (
                changed(&|seen| seen.board.size = 3),
                BOARD_SIZE * (3 * WHOLE / 11),
            ),
            (
                changed(&|seen| seen.cards_left[left(2)] = 0),
                (CARDS_LEFT + PASSED) * (WHOLE / 3),
            ),
            (
                changed(&|seen| seen.passed[left(3)] = true),
                PASSED * (WHOLE / 3),
            ),
            (
                changed(&|seen| seen.roles[own] = Some(chefshat_engine::Role::Chef)),
                ROLE * WHOLE,
            ),
            (changed(&|seen| seen.played = fewer), PLAYED * WHOLE),
        ];
        for (line, (found, expected)) in table.into_iter().enumerate() {
            assert_eq!(found, expected, "line {line}");
        }
        // Points, Shift and pizza do not count.
        assert_eq!(changed(&|seen| (seen.shift, seen.pizza) = (7, 7)), 0);
    }

    #[test]
    fn seats_are_counted_from_the_own_seat() {
        let base = observation();
        let own = base.seat.expect("a seat's observation");
        let turned = Observation {
            seat: Some(Seat::new((own.index() + 1) % 4)),
            cards_left: chefshat_engine::BySeat::from_fn(4, |seat| {
                base.cards_left[Seat::new((seat.index() + 3) % 4)]
            }),
            ..base
        };
        assert_eq!(difference(&base, &turned), 0);
    }
}
