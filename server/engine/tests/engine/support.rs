//! Shared helpers: rule sets from the vectors' JSON, hands from a line of text, random games.

use chefshat_engine::{
    ActionId, BySeat, Cards, Event, Game, Opening, PassScope, RuleSet, RuleSetSpec, Seat,
    SeatOrder, Seed, Stop,
};
use proptest::prelude::*;
use serde::Deserialize;

/// A rule set as the vectors write it.
#[derive(Deserialize)]
pub(crate) struct VectorRules {
    players: u8,
    faces: u8,
    jokers: u8,
    target_points: Option<u32>,
    target_shifts: Option<u32>,
    points: Vec<u32>,
    exchange: bool,
    special_actions: bool,
    opening: String,
    opening_pass: bool,
    pass_scope: String,
    max_idle_pizzas: u32,
    max_turns: u32,
}

impl VectorRules {
    pub(crate) fn rule_set(&self) -> RuleSet {
        let spec = RuleSetSpec {
            players: self.players,
            faces: self.faces,
            jokers: self.jokers,
            stop: match (self.target_points, self.target_shifts) {
                (Some(points), None) => Stop::Points(points),
                (None, Some(shifts)) => Stop::Shifts(shifts),
                other => panic!("not one stop rule: {other:?}"),
            },
            points: self.points.clone(),
            exchange: self.exchange,
            special_actions: self.special_actions,
            opening: match self.opening.as_str() {
                "golden" => Opening::Golden,
                "any_top_face" => Opening::AnyTopFace,
                other => panic!("unknown opening {other}"),
            },
            opening_pass: self.opening_pass,
            pass_scope: match self.pass_scope.as_str() {
                "pizza" => PassScope::Pizza,
                "turn" => PassScope::Turn,
                other => panic!("unknown pass scope {other}"),
            },
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
        };
        spec.validate().unwrap()
    }
}

pub(crate) fn seed_from_hex(text: &str) -> Seed {
    assert_eq!(text.len(), 64);
    let mut bytes = [0; 32];
    for (index, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(&text[2 * index..2 * index + 2], 16).unwrap();
    }
    Seed(bytes)
}

/// Cards from a line such as `1 2 2 G J`.
pub(crate) fn cards(faces: u8, line: &str) -> Cards {
    let mut counts = vec![0; usize::from(faces) + 1];
    let mut golden = false;
    for word in line.split_whitespace() {
        let index = match word {
            "J" => usize::from(faces),
            "G" => {
                golden = true;
                usize::from(faces) - 1
            }
            number => number.parse::<usize>().unwrap() - 1,
        };
        counts[index] += 1;
    }
    Cards::from_counts(faces, &counts, golden).unwrap()
}

/// Hands from lines, one for each seat.
pub(crate) fn hands(faces: u8, lines: &[&str]) -> BySeat<Cards> {
    BySeat::from_fn(lines.len(), |seat| cards(faces, lines[seat.index()]))
}

/// An order of seats from their numbers.
pub(crate) fn order(seats: &[usize]) -> SeatOrder {
    SeatOrder::from_slice(&seats.iter().copied().map(Seat::new).collect::<Vec<_>>()).unwrap()
}

/// Applies the action with this text and returns its events.
pub(crate) fn act(game: &mut Game, text: &str) -> Vec<Event> {
    let action = game
        .rules()
        .actions()
        .parse(text)
        .unwrap_or_else(|| panic!("no action {text}"));
    let mut events = Vec::new();
    game.apply(action, |event| events.push(event))
        .unwrap_or_else(|error| panic!("{error}"));
    events
}

/// The texts of the legal actions, ascending.
pub(crate) fn legal_texts(game: &Game) -> Vec<String> {
    let space = game.rules().actions();
    game.legal_actions()
        .iter()
        .map(|action| space.text(action).unwrap())
        .collect()
}

/// A small seeded generator, so that failures are reproducible (SplitMix64).
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((word >> 32) * n as u64) >> 32) as usize
    }

    /// A legal action of the open decision, uniformly.
    pub(crate) fn legal_action(&mut self, game: &Game) -> ActionId {
        let mask = game.legal_actions();
        mask.nth(self.below(mask.len()))
            .expect("an open decision has a legal action")
    }
}

/// Any valid rule set with short games.
pub(crate) fn any_rules() -> impl Strategy<Value = RuleSet> {
    let stop = prop_oneof![
        (1u32..12).prop_map(Stop::Points),
        (1u32..5).prop_map(Stop::Shifts)
    ];
    let max_turns = prop_oneof![1u32..120, Just(10_000)];
    (
        (
            2u8..=6,
            4u8..=15,
            0u8..=2,
            stop,
            prop::collection::vec(0u32..6, 6),
        ),
        (any::<[bool; 5]>(), 1u32..4, max_turns),
    )
        .prop_filter_map(
            "a hand needs three cards",
            |((players, faces, jokers, stop, mut points), rest)| {
                let (
                    [
                        exchange,
                        special_actions,
                        any_top_face,
                        opening_pass,
                        turn_scope,
                    ],
                    max_idle_pizzas,
                    max_turns,
                ) = rest;
                points.truncate(usize::from(players));
                points.sort_unstable_by(|a, b| b.cmp(a));
                points[0] = points[0].max(1);
                let spec = RuleSetSpec {
                    players,
                    faces,
                    jokers,
                    stop,
                    points,
                    exchange,
                    special_actions,
                    opening: if any_top_face {
                        Opening::AnyTopFace
                    } else {
                        Opening::Golden
                    },
                    opening_pass,
                    pass_scope: if turn_scope {
                        PassScope::Turn
                    } else {
                        PassScope::Pizza
                    },
                    max_idle_pizzas,
                    max_turns,
                };
                spec.validate().ok()
            },
        )
}
