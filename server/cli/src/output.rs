//! Output for people: headings, lines and tables of at most 100 columns, and rule sets in words.
//! The commands decide the content; `numbers` has numbers in words.

use std::fmt::Write as _;

use anstyle::Style;
use chefshat_engine::{Opening, PassScope, RuleSet, RuleSetSpec, Stop};
use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

use super::numbers::counted;

/// Only a line below the header, so that tables stay narrow.
const STYLE: TableStyle = TableStyle::new().header_separator(LineStyle::none().fill('─'));

/// Adds a heading in bold; the stream strips the escape codes if needed.
pub fn heading(text: &mut String, words: &str) {
    let bold = Style::new().bold();
    writeln!(text, "{bold}{words}{bold:#}").expect("a String takes everything");
}

/// Adds an indented line.
pub fn line(text: &mut String, words: &str) {
    writeln!(text, "  {words}").expect("a String takes everything");
}

/// Adds an indented table. The columns in `words` are aligned left; the others hold numbers and are
/// aligned right.
pub fn table(
    text: &mut String,
    header: &[&str],
    words: &[usize],
    rows: impl Iterator<Item = Vec<String>>,
) {
    let mut table = Table::new();
    table.load_style(STYLE).set_header(header);
    rows.for_each(|row| {
        table.add_row(row);
    });
    for (index, column) in table.column_iter_mut().enumerate() {
        if !words.contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for row in table.lines() {
        // Each cell starts with a space.
        line(text, row.trim_end().strip_prefix(' ').unwrap_or(&row));
    }
}

/// Formats a share from 0 to 1: `28.0 %`.
pub fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// When a game ends: `to 15 points`, `4 Shifts`.
pub fn stop_in_words(stop: Stop) -> String {
    match stop {
        Stop::Points(points) => format!("to {points} points"),
        Stop::Shifts(shifts) => counted(u64::from(shifts), "Shift"),
    }
}

/// A rule set: its size, end and points.
pub fn rules_in_short(rules: &RuleSet) -> String {
    let spec = rules.spec();
    let stop = match spec.stop {
        stop @ Stop::Points(_) => stop_in_words(stop),
        stop @ Stop::Shifts(_) => format!("of {}", stop_in_words(stop)),
    };
    let points: Vec<String> = spec.points.iter().map(u32::to_string).collect();
    format!(
        "{} players, {} faces, {}, {stop}; {} points by place",
        spec.players,
        spec.faces,
        counted(u64::from(spec.jokers), "joker"),
        points.join(", ")
    )
}

/// How a rule set differs from the default beyond size, end and points.
pub fn variations(rules: &RuleSet) -> Vec<String> {
    let spec = rules.spec();
    let standard = RuleSetSpec::default();
    let mut variations = Vec::new();
    if !spec.exchange {
        variations.push("no exchange".to_owned());
    }
    if !spec.special_actions {
        variations.push("no special actions".to_owned());
    }
    if spec.opening == Opening::AnyTopFace {
        variations.push("opening any_top_face".to_owned());
    }
    if spec.opening_pass {
        variations.push("opening pass allowed".to_owned());
    }
    if spec.pass_scope == PassScope::Turn {
        variations.push("a pass binds for one turn".to_owned());
    }
    if spec.max_idle_pizzas != standard.max_idle_pizzas {
        let pizzas = counted(u64::from(spec.max_idle_pizzas), "pizza");
        variations.push(format!("at most {pizzas} idle"));
    }
    if spec.max_turns != standard.max_turns {
        let turns = counted(u64::from(spec.max_turns), "turn");
        variations.push(format!("at most {turns} a Shift"));
    }
    variations
}

/// Variations as lines: three per line fit in 100 columns.
pub fn variation_lines(variations: &[String]) -> impl Iterator<Item = String> {
    variations.chunks(3).map(|some| some.join(", "))
}
