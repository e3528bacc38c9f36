//! The result of `chefshat simulate` as a text for people and as JSON for programs. Both depend on the batch alone: no times, no
//! number of threads.

use std::fmt::Write as _;

use anstyle::Style;
use chefshat_arena::{Batch, BatchTable, RulesForm};
use chefshat_engine::{Opening, PassScope, RewardScheme, RuleSetSpec, Stop};
use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};
use serde_json::{Value, json};

use super::super::numbers::{counted, grouped};

/// A line below the header and nothing else, so that tables stay narrow.
const STYLE: TableStyle = TableStyle::new().header_separator(LineStyle::none().fill('─'));
/// The column that holds words; the others hold numbers.
const WORD_COLUMN: &str = "Agent";

/// The result as one JSON object: what was played, sums and means over all, the same for each seat.
pub(super) fn json(batch: &Batch, table: &BatchTable) -> Value {
    let seats: Vec<Value> = table
        .seats
        .iter()
        .map(|(seat, sums)| {
            json!({
                "seat": seat.index(),
                "agent": batch.agents()[seat].name(),
                "games_won": sums.games_won,
                "shifts_won": sums.shifts_won,
                "mean_place": table.mean_place(seat),
                "points": sums.points,
                "points_per_shift": table.points_per_shift(seat),
                "valid_actions": sums.valid,
                "wrong_actions": sums.wrong,
                "plays": sums.plays,
                "passes": sums.passes,
                "mean_reward": table.mean_reward(seat),
                "performance_score": table.performance(seat),
            })
        })
        .collect();
    json!({
        "games": batch.games(),
        "seed": batch.seed(),
        "reward": batch.scheme().map(RewardScheme::name),
        "max_invalid_attempts": batch.max_invalid_attempts(),
        "rules": RulesForm::from(batch.rules()),
        "shifts": table.shifts,
        "decisions": table.decisions,
        "shifts_per_game": table.per_game(table.shifts),
        "pizzas_per_shift": table.per_shift(table.pizzas),
        "laps_per_shift": table.per_shift(table.laps),
        "turns_per_shift": table.per_shift(table.turns),
        "starter_won": table.starter_won,
        "adjudicated": table.adjudicated,
        "food_fights": table.food_fights,
        "dinners_served": table.dinners_served,
        "seats": seats,
    })
}

/// The result as lines of at most 100 columns, headings emphasised by escape codes (which the stream strips where they are unwanted).
pub(super) fn text(batch: &Batch, table: &BatchTable) -> String {
    let mut text = String::new();
    heading(
        &mut text,
        &format!("{} games, seed {}", grouped(batch.games()), batch.seed()),
    );
    for line in rules_lines(batch) {
        line_of(&mut text, &line);
    }
    text.push('\n');
    heading(&mut text, "Overall");
    for (what, value) in overall(table) {
        line_of(&mut text, &format!("{what:<17}{value}"));
    }
    text.push('\n');
    heading(&mut text, "Results");
    text.push_str(&results(batch, table));
    text.push('\n');
    heading(
        &mut text,
        "Actions at turns (valid: plays and passes; wrong: invalid attempts)",
    );
    text.push_str(&actions(batch, table));
    text
}

/// The rule set: its size and end, then what differs from the standard.
fn rules_lines(batch: &Batch) -> Vec<String> {
    let spec = batch.rules().spec();
    let standard = RuleSetSpec::default();
    let stop = match spec.stop {
        Stop::Points(points) => format!("to {points} points"),
        Stop::Shifts(shifts) => format!("of {}", counted(u64::from(shifts), "Shift")),
    };
    let points: Vec<String> = spec.points.iter().map(u32::to_string).collect();
    let mut lines = vec![format!(
        "{} players, {} faces, {}, {stop}; {} points by place",
        spec.players,
        spec.faces,
        counted(u64::from(spec.jokers), "joker"),
        points.join(", ")
    )];
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
        variations.push(format!(
            "at most {} idle",
            counted(u64::from(spec.max_idle_pizzas), "pizza")
        ));
    }
    if spec.max_turns != standard.max_turns {
        variations.push(format!(
            "at most {} a Shift",
            counted(u64::from(spec.max_turns), "turn")
        ));
    }
    if let Some(attempts) = batch.max_invalid_attempts() {
        variations.push(format!(
            "default decision after {}",
            counted(u64::from(attempts.get()), "invalid attempt")
        ));
    }
    // Three to a line keep within 100 columns.
    lines.extend(variations.chunks(3).map(|some| some.join(", ")));
    lines
}

fn overall(table: &BatchTable) -> Vec<(&'static str, String)> {
    let specials = table.food_fights + table.dinners_served;
    vec![
        (
            "Shifts",
            format!(
                "{} ({:.2} a game)",
                grouped(table.shifts),
                table.per_game(table.shifts)
            ),
        ),
        (
            "A Shift has",
            format!(
                "{:.2} pizzas, {:.2} laps, {:.2} turns",
                table.per_shift(table.pizzas),
                table.per_shift(table.laps),
                table.per_shift(table.turns)
            ),
        ),
        (
            "Starter won",
            format!(
                "{} of the Shifts",
                percent(table.per_shift(table.starter_won))
            ),
        ),
        (
            "Special actions",
            format!(
                "{} ({} of the Shifts): {} Food Fight, {} Dinner is Served",
                grouped(specials),
                percent(table.per_shift(specials)),
                grouped(table.food_fights),
                grouped(table.dinners_served)
            ),
        ),
        ("Adjudicated", counted(table.adjudicated, "Shift")),
    ]
}

fn results(batch: &Batch, table: &BatchTable) -> String {
    let header = [
        "Seat",
        WORD_COLUMN,
        "Games\nwon",
        "%",
        "Shifts\nwon",
        "%",
        "Mean\nplace",
        "Points\na Shift",
        "Performance\nscore",
    ];
    let rows = table.seats.iter().map(|(seat, sums)| {
        vec![
            seat.to_string(),
            batch.agents()[seat].name().to_owned(),
            grouped(sums.games_won),
            format!("{:.1}", 100.0 * table.per_game(sums.games_won)),
            grouped(sums.shifts_won),
            format!("{:.1}", 100.0 * table.per_shift(sums.shifts_won)),
            format!("{:.2}", table.mean_place(seat)),
            format!("{:.2}", table.points_per_shift(seat)),
            format!("{:.3}", table.performance(seat)),
        ]
    });
    table_of(&header, rows)
}

fn actions(batch: &Batch, table: &BatchTable) -> String {
    let mut header = vec![
        "Seat",
        WORD_COLUMN,
        "Valid",
        "Wrong",
        "Plays\na Shift",
        "Passes\na Shift",
        "Wrong\na Shift",
    ];
    let mean_reward = batch
        .scheme()
        .map(|scheme| format!("Mean reward\n{}", scheme.name()));
    header.extend(mean_reward.as_deref());
    let rows = table.seats.iter().map(|(seat, sums)| {
        let mut row = vec![
            seat.to_string(),
            batch.agents()[seat].name().to_owned(),
            grouped(sums.valid),
            grouped(sums.wrong),
            format!("{:.2}", table.per_shift(sums.plays)),
            format!("{:.2}", table.per_shift(sums.passes)),
            format!("{:.2}", table.per_shift(sums.wrong)),
        ];
        row.extend(batch.scheme().map(|_| match table.mean_reward(seat) {
            Some(reward) => format!("{reward:.4}"),
            None => "none".to_owned(),
        }));
        row
    });
    table_of(&header, rows)
}

fn table_of(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(STYLE).set_header(header);
    rows.for_each(|row| {
        table.add_row(row);
    });
    for (column, name) in table.column_iter_mut().zip(header) {
        if *name != WORD_COLUMN {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mut text = String::new();
    for line in table.lines() {
        // Every cell is preceded by a space.
        line_of(
            &mut text,
            line.trim_end().strip_prefix(' ').unwrap_or(&line),
        );
    }
    text
}

fn heading(text: &mut String, words: &str) {
    let bold = Style::new().bold();
    writeln!(text, "{bold}{words}{bold:#}").expect("a String takes everything");
}

fn line_of(text: &mut String, words: &str) {
    writeln!(text, "  {words}").expect("a String takes everything");
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
