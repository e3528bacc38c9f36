//! The named presets (`docs/rules.md` §7.4). A preset is a starting point: any field can be changed
//! before validation.

use crate::{Opening, PassScope, RuleSetSpec, Stop};

impl RuleSetSpec {
    /// The names of the presets, the default first.
    pub const PRESETS: [&'static str; 3] = ["paper", "rulebook", "original2020"];

    /// The preset of this name, or `None` if there is none.
    pub fn preset(name: &str) -> Option<RuleSetSpec> {
        let default = RuleSetSpec::default();
        match name {
            "paper" => Some(default),
            "rulebook" => Some(RuleSetSpec {
                points: vec![3, 2, 1, 0],
                ..default
            }),
            "original2020" => Some(RuleSetSpec {
                opening: Opening::AnyTopFace,
                opening_pass: true,
                pass_scope: PassScope::Turn,
                ..default
            }),
            _ => None,
        }
    }
}

impl Default for RuleSetSpec {
    /// The preset `paper`: four players, faces 1 to 11, two jokers, to 15 points.
    fn default() -> RuleSetSpec {
        RuleSetSpec {
            players: 4,
            faces: 11,
            jokers: 2,
            stop: Stop::Points(15),
            points: Vec::new(),
            exchange: true,
            special_actions: true,
            opening: Opening::Golden,
            opening_pass: false,
            pass_scope: PassScope::Pizza,
            max_idle_pizzas: 3,
            max_turns: 10_000,
        }
    }
}
