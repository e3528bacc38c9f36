//! The result of `chefshat compare` as text and as JSON. Both depend only on what is compared, not on time or the number of threads.

use chefshat_simulation::{Comparison, Contender, Duplicate, Figure, RulesForm};
use serde_json::{Value, json};

use super::super::numbers::counted;
use super::super::output::{self, heading, line, table};
use super::{Compare, Entrant, SeatsFlag};

/// Maximum length of an agent's name in a table.
const MAX_LABEL: usize = 14;

/// A finished comparison.
pub(super) struct Played<'c> {
    pub(super) compare: &'c Compare,
    pub(super) entrants: &'c [Entrant; 2],
    pub(super) duplicate: &'c Duplicate,
    pub(super) comparison: &'c Comparison,
}

impl Played<'_> {
    /// The result as one JSON object.
    pub(super) fn json(&self) -> Value {
        let comparison = self.comparison;
        let [a, b] = self.entrants.each_ref().map(entrant_json);
        json!({
            "a": a,
            "b": b,
            "seats": match self.compare.seats {
                SeatsFlag::Half => "half",
                SeatsFlag::One => "one",
            },
            "seed": self.compare.seed,
            "rules": RulesForm::from(self.duplicate.rules()),
            "deals": comparison.deals,
            "seatings": self.duplicate.seatings().len(),
            "shifts_per_game": self.compare.shifts,
            "games": comparison.games,
            "shifts": comparison.shifts,
            "points_per_shift": figure_json(&comparison.points),
            "mean_place": figure_json(&comparison.places),
            "shifts_won": figure_json(&comparison.wins),
        })
    }

    /// The result as lines of at most 100 columns.
    pub(super) fn text(&self) -> String {
        let comparison = self.comparison;
        let mut text = String::new();
        let [a, b] = self
            .entrants
            .each_ref()
            .map(|entrant| shortened(&entrant.label));
        let seed = self.compare.seed;
        heading(
            &mut text,
            &format!(
                "{a} against {b}: {}, seed {seed}",
                counted(comparison.deals, "deal")
            ),
        );
        let seats = match self.compare.seats {
            SeatsFlag::Half => "half of the seats each",
            SeatsFlag::One => "one seat against the others",
        };
        line(
            &mut text,
            &format!(
                "each in {} ({seats}): {}, {}",
                counted(self.duplicate.seatings().len() as u64, "seating"),
                counted(comparison.games, "game"),
                counted(comparison.shifts, "Shift"),
            ),
        );
        line(&mut text, &output::rules_in_short(self.duplicate.rules()));
        let variations = output::variations(self.duplicate.rules());
        for words in output::variation_lines(&variations) {
            line(&mut text, &words);
        }
        text.push('\n');
        heading(
            &mut text,
            "Per seat and Shift (95 % interval of the difference)",
        );
        let [a, b] = self.columns();
        let header = [
            "",
            &a,
            &b,
            "Difference",
            "95 % interval",
            "Standard\nerror",
            "independent\ndeals",
        ];
        let rows = [
            ("Points", &comparison.points, 1.0),
            ("Place", &comparison.places, 1.0),
            ("Shifts won, %", &comparison.wins, 100.0),
        ];
        let rows = rows.map(|(what, figure, scale)| {
            let interval = figure.interval95();
            vec![
                what.to_owned(),
                format!("{:.3}", scale * figure.a()),
                format!("{:.3}", scale * figure.b()),
                signed(scale * figure.difference()),
                format!(
                    "{} … {}",
                    signed(scale * interval.low),
                    signed(scale * interval.high)
                ),
                format!("{:.4}", scale * figure.standard_error()),
                format!("{:.4}", scale * figure.independent_standard_error()),
            ]
        });
        table(&mut text, &header, &[0], rows.into_iter());
        text.push('\n');
        line(&mut text, &self.gain());
        text
    }

    /// How many independent deals would have been needed, in words.
    fn gain(&self) -> String {
        let shifts = self.comparison.shifts;
        match self.comparison.points.gain() {
            None => "All deals had the same result: chance had no influence.".to_owned(),
            Some(gain) => format!(
                "This is as precise as {} of independent deals ({gain:.1} times as many).",
                counted((gain * shifts as f64).round() as u64, "Shift")
            ),
        }
    }

    /// Column headings of the two agents: their names, or A and B if these are equal.
    fn columns(&self) -> [String; 2] {
        let [a, b] = self
            .entrants
            .each_ref()
            .map(|entrant| shortened(&entrant.label));
        if a == b {
            ["A".to_owned(), "B".to_owned()]
        } else {
            [a, b]
        }
    }
}

fn shortened(label: &str) -> String {
    if label.chars().count() <= MAX_LABEL {
        return label.to_owned();
    }
    let beginning: String = label.chars().take(MAX_LABEL - 1).collect();
    format!("{beginning}…")
}

fn signed(number: f64) -> String {
    // Avoids a signed zero.
    let number = if number == 0.0 { 0.0 } else { number };
    format!("{number:+.3}").replace('-', "−")
}

fn entrant_json(entrant: &Entrant) -> Value {
    match &entrant.contender {
        Contender::Kind(kind) => json!({"agent": kind.name()}),
        Contender::Network(network) => {
            let info = network.info();
            json!({
                "file": entrant.given,
                "name": info.name,
                "input": info.input.name(),
                "output": info.output.name(),
                "masked": info.masked,
                "trained_by": info.trained_by,
            })
        }
    }
}

fn figure_json(figure: &Figure) -> Value {
    let interval = figure.interval95();
    json!({
        "a": figure.a(),
        "b": figure.b(),
        "difference": figure.difference(),
        "difference_95": [interval.low, interval.high],
        "standard_error": figure.standard_error(),
        "independent_standard_error": figure.independent_standard_error(),
        "gain": figure.gain(),
    })
}
