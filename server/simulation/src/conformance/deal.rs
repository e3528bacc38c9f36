//! Checks a vector of one deal.

use chefshat_engine::{Card, Deal, Seat, Seed};
use serde::Deserialize;
use serde_json::{Value, json};

use super::compare::{LineError, agree, unreadable};
use crate::RulesForm;

/// A deal by another engine.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DealVector {
    rules: RulesForm,
    #[serde(with = "hex")]
    seed: [u8; 32],
    shift: u32,
    /// Cards in dealing order: faces, `"G"` for the Golden card, F+1 for a joker.
    hands: Vec<Vec<Value>>,
    leader: usize,
}

/// Repeats the deal and compares it card by card.
pub(super) fn check(vector: &DealVector) -> Result<(), LineError> {
    let rules = vector.rules.rule_set().map_err(unreadable)?;
    let deal = Deal::new(&rules, Seed(vector.seed), vector.shift);
    agree("number of hands", None, vector.hands.len(), rules.players())?;
    for (index, expected) in vector.hands.iter().enumerate() {
        let cards = deal.cards(Seat::new(index));
        let got: Vec<Value> = cards.map(|card| card_json(card, rules.faces())).collect();
        agree(&format!("hands[{index}]"), None, expected, got)?;
    }
    agree("leader", None, vector.leader, deal.leader().index())?;
    Ok(())
}

fn card_json(card: Card, faces: u8) -> Value {
    match card {
        Card::Plain(face) => json!(face.get()),
        Card::Golden => json!("G"),
        Card::Joker => json!(faces + 1),
    }
}
