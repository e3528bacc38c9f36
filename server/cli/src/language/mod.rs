//! A table in words, for language models: what `chefshat mcp` answers and `chefshat agent llm` asks.
//! docs/mcp.md describes the text form line by line.

pub mod cards;
pub mod events;
pub mod live;
#[cfg(test)]
mod tests;
pub mod text;

use chefshat_engine::RuleSet;

use crate::output::{rules_in_short, variations};

/// Key of the annotation with the reason for a decision.
pub const REASON: &str = "reason";
/// Maximum bytes of a reason. Annotations of a decision have at most 4 KiB.
const MAX_REASON_BYTES: usize = 3_500;

/// The rules that a model needs at the table, in short. docs/rules.md has all of them.
pub const RULES: &str = "\
The rules in short: get rid of your cards first. A lower number is rarer and beats a higher one: there is one 1, there are two 2s, and so on. A play is cards of one number; a joker (J) counts as one \
more of them, and a joker alone is the weakest play. You must play a lower number than the board shows, and at least as many cards, or pass; a pass \
counts until the pizza is done. When everybody else has passed, the board is cleared and whoever played last leads with anything. 11* is the Golden \
card, which opens the Shift. Places give points, with which the game ends. Between Shifts, the last two give their rarest cards to the first two, who \
give back any. Before that, a player who was dealt two jokers may declare something. If it is who came last, this is a Food Fight: all roles are reversed. If it is \
anybody else, Dinner is Served, and nothing is exchanged.";

/// The rules of one game beside [`RULES`], in a sentence.
pub fn this_game(rules: Option<&RuleSet>) -> String {
    let Some(rules) = rules else {
        return String::new();
    };
    let mut words = rules_in_short(rules);
    for variation in variations(rules) {
        words.push_str("; ");
        words.push_str(&variation);
    }
    format!("This game: {words}.")
}

/// A reason as its annotation has it; `None` if it says nothing.
pub fn reason(words: &str) -> Option<String> {
    let words = words.trim();
    let fits = &words[..words.floor_char_boundary(MAX_REASON_BYTES)];
    (!fits.is_empty()).then(|| fits.to_owned())
}
