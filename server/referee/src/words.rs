//! What the referee says to the people at the table.

use chefshat_engine::{Action, Cards, RuleSet, Seat};

use crate::counts::{Counts, JOKER, counts_of, counts_of_action};

const NUMBERS: [&str; 13] = [
    "no", "a", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven",
    "twelve",
];

/// The display names of the seats.
#[derive(Debug, Clone)]
pub(crate) struct Names(pub(crate) Vec<String>);

impl Names {
    pub(crate) fn of(&self, seat: Seat) -> &str {
        self.0.get(seat.index()).map_or("?", String::as_str)
    }

    /// "Ada", "Ada and Bo", "Ada, Bo and Cy".
    pub(crate) fn list(&self, seats: &[Seat]) -> String {
        let names: Vec<&str> = seats.iter().map(|seat| self.of(*seat)).collect();
        join(&names)
    }

    /// The text with names instead of "seat 2".
    pub(crate) fn replace_seats(&self, text: &str) -> String {
        (0..self.0.len()).rev().fold(text.to_owned(), |text, seat| {
            text.replace(&format!("seat {seat}"), self.of(Seat::new(seat)))
        })
    }
}

fn join<T: AsRef<str>>(parts: &[T]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.as_ref().to_owned(),
        [first @ .., last] => {
            let first: Vec<&str> = first.iter().map(AsRef::as_ref).collect();
            format!("{} and {}", first.join(", "), last.as_ref())
        }
    }
}

/// "two 9s", "an 8", "a joker".
fn some(count: u8, what: &str) -> String {
    let number = match (count, what) {
        (1, "8" | "11") => "an".to_owned(),
        (count, _) => NUMBERS
            .get(usize::from(count))
            .map_or_else(|| count.to_string(), |word| (*word).to_owned()),
    };
    let plural = if count == 1 { "" } else { "s" };
    format!("{number} {what}{plural}")
}

/// "two 9s and a joker".
pub(crate) fn counts_text(counts: &Counts) -> String {
    let faces = (0..JOKER)
        .filter(|kind| counts[*kind] > 0)
        .map(|kind| some(counts[kind], &(kind + 1).to_string()));
    let jokers = (counts[JOKER] > 0).then(|| some(counts[JOKER], "joker"));
    let parts: Vec<String> = faces.chain(jokers).collect();
    match parts.as_slice() {
        [] => "no cards".to_owned(),
        parts => join(parts),
    }
}

/// "two 9s and a joker".
pub(crate) fn cards_text(rules: &RuleSet, cards: Cards) -> String {
    counts_text(&counts_of(cards, rules.faces()))
}

/// What a turn puts on the board: "two 9s and a joker", or "a pass".
pub(crate) fn turn_text(action: Action) -> String {
    match action {
        Action::Pass => "a pass".to_owned(),
        action => counts_text(&counts_of_action(action)),
    }
}

/// What a turn puts on the board as it is typed in every language: "9 9 J".
pub(crate) fn typed_turn(action: Action) -> String {
    let counts = counts_of_action(action);
    let cards = (0..=JOKER).flat_map(|kind| {
        let card = match kind {
            JOKER => "J".to_owned(),
            face => (face + 1).to_string(),
        };
        std::iter::repeat_n(card, counts[kind].into())
    });
    cards.collect::<Vec<_>>().join(" ")
}

/// "5s", "jokers".
pub(crate) fn kind_text(kind: usize) -> String {
    match kind {
        JOKER => "jokers".to_owned(),
        face => format!("{}s", face + 1),
    }
}
