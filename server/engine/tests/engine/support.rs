//! What several subjects need: rule sets from the vectors' JSON, hands from a line of text, playing a game at random.

use chefshat_engine::{
    Action, BySeat, Card, Cards, Event, Face, Game, Opening, PassScope, RuleSet, RuleSetSpec, Seat, SeatOrder, Seed,
    Stop,
};
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
