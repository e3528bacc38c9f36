//! The result of `chefshat simulate` as text and as JSON. Both depend only on the batch, not on
//! time or the number of threads.

use chefshat_engine::RewardScheme;
use chefshat_simulation::{Batch, BatchTable, RulesForm};
use serde_json::{Value, json};

use chefshat_cli::numbers::{counted, grouped};
use chefshat_cli::output::{self, heading, line, percent};

/// The column of agents; the others have numbers.
const AGENT_COLUMN: usize = 1;

/// The result as JSON: parameters, sums and means over all, and the same for each seat.
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

/// The result as lines of at most 100 columns, with headings in bold.
pub(super) fn text(batch: &Batch, table: &BatchTable) -> String {
    let mut text = String::new();
    heading(
        &mut text,
        &format!("{} games, seed {}", grouped(batch.games()), batch.seed()),
    );
    for words in rules_lines(batch) {
        line(&mut text, &words);
    }
    text.push('\n');
    heading(&mut text, "Overall");
    for (what, value) in overall(table) {
        line(&mut text, &format!("{what:<17}{value}"));
    }
    text.push('\n');
    heading(&mut text, "Results");
    results(&mut text, batch, table);
    text.push('\n');
    heading(
        &mut text,
        "Actions at turns (valid: plays and passes; wrong: invalid attempts)",
    );
    actions(&mut text, batch, table);
    text
}

/// The rule set: its size and end, then its variations.
fn rules_lines(batch: &Batch) -> Vec<String> {
    let mut variations = output::variations(batch.rules());
    if let Some(attempts) = batch.max_invalid_attempts() {
        variations.push(format!(
            "default decision after {}",
            counted(u64::from(attempts.get()), "invalid attempt")
        ));
    }
    let mut lines = vec![output::rules_in_short(batch.rules())];
    lines.extend(output::variation_lines(&variations));
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

fn results(text: &mut String, batch: &Batch, table: &BatchTable) {
    let header = [
        "Seat",
        "Agent",
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
            (seat.index() + 1).to_string(),
            batch.agents()[seat].name(),
            grouped(sums.games_won),
            format!("{:.1}", 100.0 * table.per_game(sums.games_won)),
            grouped(sums.shifts_won),
            format!("{:.1}", 100.0 * table.per_shift(sums.shifts_won)),
            format!("{:.2}", table.mean_place(seat)),
            format!("{:.2}", table.points_per_shift(seat)),
            format!("{:.3}", table.performance(seat)),
        ]
    });
    output::table(text, &header, &[AGENT_COLUMN], rows);
}

fn actions(text: &mut String, batch: &Batch, table: &BatchTable) {
    let mut header = vec![
        "Seat",
        "Agent",
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
            (seat.index() + 1).to_string(),
            batch.agents()[seat].name(),
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
    output::table(text, &header, &[AGENT_COLUMN], rows);
}
