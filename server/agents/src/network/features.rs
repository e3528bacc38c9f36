//! The input `table` of a network: everything a seat may know, as numbers. The Python package
//! computes the same (`chefshat.learn.features`); a shared fixture keeps the two equal. The engine
//! computes the input `classic`.

use chefshat_engine::{ActionSpace, Cards, DecisionKind, Mask, Observation, Seat};

use super::sparse::SparseRows;

/// Upper bound of points.
const MAX_POINTS: u8 = 15;
/// Upper bound of the pizza's number.
const MAX_PIZZAS: u8 = 30;
/// Values of a role: none and five roles.
const ROLES: usize = 6;
/// Kinds of decisions.
const KINDS: usize = 3;
/// Number of jokers scaled to 1.
const JOKERS: f32 = 2.0;

/// Length of [`table_features`].
pub(super) fn table_len(players: usize, space: ActionSpace) -> usize {
    let faces = usize::from(space.faces());
    let cards = 5 * (faces + 1);
    let board = faces + 2 + 2;
    let seats = players * (4 + ROLES);
    cards + 1 + board + seats + KINDS + 1 + usize::from(space.size())
}

/// Everything a seat may know at a decision, as numbers from 0 to about 1; 334 numbers in the
/// default game. F is the number of faces, N of players, H of cards dealt to a hand, A of actions.
/// Values by seat start with the own seat and continue to its left:
///
/// | numbers | meaning |
/// |---|---|
/// | F + 1 | the own hand: cards of face f divided by f, jokers by 2 |
/// | 1 | whether the own hand holds the Golden card |
/// | F + 2 | one-hot: face on the board, 0 (empty) to F + 1 (a joker alone) |
/// | 1 | cards on the board / F |
/// | 1 | jokers among them / 2 |
/// | N | cards in each hand / H |
/// | N | whether each seat has passed |
/// | N | place of each seat that has finished / N, else 0 |
/// | 6 N | one-hot for each seat: role, 0 (none), Chef, Sous-Chef, Cook, Waiter, Dishwasher |
/// | N | points of each seat, at most 15, / 15 |
/// | F + 1 | cards played so far in the Shift, divided as the hand |
/// | F + 1 | cards neither played nor in the own hand (of a deck with two jokers), divided as the hand |
/// | F + 1 | cards given in the Shift's exchange / 2 |
/// | F + 1 | cards received in it / 2 |
/// | 3 | one-hot: kind of the decision (turn, exchange, special action) |
/// | 1 | number of the pizza, at most 30, / 30 |
/// | A | whether each action is legal |
///
/// A spectator's observation, which has no seat, is seen from seat 0.
pub fn table_features(observation: &Observation, legal: &Mask) -> Vec<f32> {
    let (mut rows, mut features) = (SparseRows::default(), Vec::new());
    let length = write_table(observation, legal, &mut rows);
    rows.write(length, &mut features);
    features
}

/// Writes [`table_features`] as a row. Returns their number.
pub(super) fn write_table(observation: &Observation, legal: &Mask, out: &mut SparseRows) -> usize {
    let faces = observation.faces;
    let players = observation.cards_left.len();
    let space = ActionSpace::new(faces).expect("an observation has 4 to 15 faces");
    let own = observation.seat.unwrap_or_default().index();
    let seats = || (0..players).map(|left| Seat::new((own + left) % players));

    put_shares(out, observation.hand, faces);
    out.put(flag(observation.hand.has_golden()));
    let face = usize::from(observation.board.face);
    out.put_ones([face], usize::from(faces) + 2);
    out.put(f32::from(observation.board.size) / f32::from(faces));
    out.put(f32::from(observation.board.jokers) / JOKERS);

    let hand_size = f32::from(observation.hand_size);
    seats().for_each(|seat| out.put(f32::from(observation.cards_left[seat]) / hand_size));
    seats().for_each(|seat| out.put(flag(observation.passed[seat])));
    let places = players as f32;
    seats().for_each(|seat| out.put(f32::from(observation.places[seat]) / places));
    for seat in seats() {
        let role = observation.roles[seat].map_or(0, |role| role as usize);
        out.put_ones([role], ROLES);
    }
    for seat in seats() {
        let points = u8::try_from(observation.points[seat]).unwrap_or(MAX_POINTS);
        out.put(f32::from(points.min(MAX_POINTS)) / f32::from(MAX_POINTS));
    }

    put_shares(out, observation.played, faces);
    let known = observation
        .hand
        .counts(faces)
        .zip(observation.played.counts(faces));
    for (size, (hand, played)) in sizes(faces).zip(known) {
        out.put(f32::from(size.saturating_sub(hand).saturating_sub(played)) / f32::from(size));
    }
    for cards in [observation.gave, observation.received] {
        (cards.counts(faces)).for_each(|count| out.put(f32::from(count) / 2.0));
    }

    let kind = observation.kind.map(|kind| match kind {
        DecisionKind::Turn => 0,
        DecisionKind::Exchange => 1,
        DecisionKind::SpecialAction => 2,
    });
    out.put_ones(kind, KINDS);
    let pizza = u8::try_from(observation.pizza).unwrap_or(MAX_PIZZAS);
    out.put(f32::from(pizza.min(MAX_PIZZAS)) / f32::from(MAX_PIZZAS));
    let legal = legal.iter().map(|action| usize::from(action.index()));
    out.put_ones(legal, usize::from(space.size()));

    let length = out.end_row();
    debug_assert_eq!(length, table_len(players, space));
    length
}

/// Number of cards of each face in a deck, jokers last.
fn sizes(faces: u8) -> impl Iterator<Item = u8> {
    (1..=faces).chain([chefshat_engine::MAX_JOKERS])
}

/// Writes each count as a share of the deck's count.
fn put_shares(out: &mut SparseRows, cards: Cards, faces: u8) {
    for (count, size) in cards.counts(faces).zip(sizes(faces)) {
        out.put(f32::from(count) / f32::from(size));
    }
}

fn flag(set: bool) -> f32 {
    f32::from(u8::from(set))
}
