//! Results as text and as JSON.

use std::io::Write as _;
use std::process::ExitCode;

use chefshat_benchmark::{BENCHMARK, MeanWithInterval, PairedDifference, TaskResult};
use chefshat_cli::error::{CommandError, say};
use chefshat_cli::numbers::{counted, grouped, signed};
use chefshat_cli::output::{heading, line, percent, table};
use serde_json::{Value, json};

/// The agent that a table compares with.
pub(super) const VERSUS: &str = "greedy";

/// Prints the result of a task. The exit code says whether it is valid.
pub(super) fn print(result: &TaskResult, as_json: bool) -> Result<ExitCode, CommandError> {
    match as_json {
        true => say(serde_json::to_string(result)?)?,
        false => write!(anstream::stdout().lock(), "{}", text(result))?,
    }
    Ok(match result.is_valid() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

fn text(result: &TaskResult) -> String {
    let mut text = String::new();
    let deals = counted(result.deals as u64, "deal");
    let (task, name) = (&result.task, &result.agent.name);
    heading(&mut text, &format!("{BENCHMARK} {task}: {name}, {deals}"));
    let [low, high] = result.games_won.interval95.map(percent);
    let rows = [
        ("Points a Shift", of_figure(&result.points_per_shift)),
        (
            "Games won",
            [percent(result.games_won.mean), format!("{low} … {high}")],
        ),
        ("Place", of_figure(&result.place)),
    ];
    let rows = rows.map(|(what, [mean, interval])| vec![what.to_owned(), mean, interval]);
    table(
        &mut text,
        &["", "Mean", "95 % interval"],
        &[0],
        rows.into_iter(),
    );
    text.push('\n');
    let decisions = counted(result.decisions, "decision");
    line(
        &mut text,
        &format!(
            "{decisions}, {}, {}, {}",
            counted(result.choices, "choice"),
            counted(result.fallback_decisions, "fallback decision"),
            counted(result.invalid_attempts, "invalid attempt")
        ),
    );
    if let Some((tokens, cost)) = tokens_and_cost(result) {
        let cost = cost.as_deref().unwrap_or("unknown");
        line(
            &mut text,
            &format!("a game takes {tokens} tokens; its cost is {cost}"),
        );
    }
    if let Some([median, most]) = result.decision_ms {
        line(
            &mut text,
            &format!("time for a decision: median {median:.1} ms, 99th percentile {most:.1} ms"),
        );
    }
    if let Some(commitment) = &result.deals_commitment {
        line(&mut text, &format!("hidden deals: {commitment}"));
    }
    line(&mut text, &format!("records: {}", result.records_sha256));
    line(
        &mut text,
        &format!("played by: {}", result.played_by.join(", ")),
    );
    line(
        &mut text,
        &format!("signed by: {}", result.signed_by.join(", ")),
    );
    for problem in &result.problems {
        line(&mut text, &format!("not valid: {problem}"));
    }
    text
}

fn of_figure(figure: &MeanWithInterval) -> [String; 2] {
    let [low, high] = figure.interval95;
    let number = |number: f64| format!("{number:.3}").replace('-', "−");
    [
        number(figure.mean),
        format!("{} … {}", number(low), number(high)),
    ]
}

/// Mean tokens of a language model's game, and its mean cost if that is known; `None` for other agents.
fn tokens_and_cost(result: &TaskResult) -> Option<(String, Option<String>)> {
    let games = result.deals.max(1);
    let usage = result.language_model?;
    let cost = usage.cost.map(|cost| format!("{:.4}", cost / games as f64));
    Some((grouped(usage.tokens / games as u64), cost))
}

/// Prints the results by task, each beside its difference from the agent in `versus`.
pub(super) fn print_table(
    results: &[TaskResult],
    versus: &[TaskResult],
    as_json: bool,
) -> Result<(), CommandError> {
    match as_json {
        true => say(table_json(results, versus))?,
        false => write!(anstream::stdout().lock(), "{}", table_text(results, versus))?,
    }
    Ok(())
}

/// The results of a task with the same deals, the best first, and the one with which they are compared.
fn by_task<'r>(
    results: &'r [TaskResult],
    versus: &'r [TaskResult],
) -> impl Iterator<Item = (&'r TaskResult, Vec<&'r TaskResult>)> {
    versus.iter().map(move |versus| {
        let mut rows: Vec<_> = results
            .iter()
            .filter(|it| it.is_comparable(versus))
            .collect();
        let points = |it: &TaskResult| it.points_per_shift.mean;
        rows.sort_by(|a, b| points(b).total_cmp(&points(a)));
        (versus, rows)
    })
}

/// The difference of a row from the agent that it is compared with; `None` for that one itself.
fn difference(row: &TaskResult, versus: &TaskResult) -> Option<PairedDifference> {
    let is_other = row.records_sha256 != versus.records_sha256;
    is_other.then(|| row.paired_difference(versus)).flatten()
}

/// The tables as text.
pub(super) fn table_text(results: &[TaskResult], versus: &[TaskResult]) -> String {
    let mut text = String::new();
    for (versus, rows) in by_task(results, versus) {
        let deals = versus.deals_commitment.as_ref();
        let deals = deals.map_or_else(String::new, |deals| format!(", hidden deals {deals}"));
        heading(&mut text, &format!("{BENCHMARK} {}{deals}", versus.task));
        let against = format!("against {}\nin its place", versus.agent.name);
        let mut header = vec![
            "",
            "Deals",
            "Points\na Shift",
            "95 % interval",
            "Games\nwon",
            &against,
            "95 % interval",
        ];
        let has_models = rows.iter().any(|row| row.language_model.is_some());
        if has_models {
            header.extend(["Tokens\na game", "Cost\na game"]);
        }
        let invalid: Vec<&TaskResult> = rows.iter().copied().filter(|it| !it.is_valid()).collect();
        let rows = rows.into_iter().map(|row| {
            let [mean, interval] = of_figure(&row.points_per_shift);
            let mut name = row.agent.name.clone();
            if !row.is_valid() {
                name.push_str(" *");
            }
            let won = percent(row.games_won.mean);
            let mut cells = vec![name, grouped(row.deals as u64), mean, interval, won];
            match difference(row, versus) {
                None => cells.extend(["".to_owned(), "".to_owned()]),
                Some(difference) => {
                    let figure = difference.points_per_shift;
                    let [low, high] = figure.interval95.map(signed);
                    cells.extend([signed(figure.mean), format!("{low} … {high}")]);
                }
            }
            if has_models {
                let (tokens, cost) = tokens_and_cost(row).unwrap_or_default();
                cells.extend([tokens, cost.unwrap_or_default()]);
            }
            cells
        });
        table(&mut text, &header, &[0], rows);
        for result in invalid {
            let (name, problems) = (&result.agent.name, result.problems.join("; "));
            line(&mut text, &format!("* {name} is not valid: {problems}"));
        }
        text.push('\n');
    }
    text
}

/// The tables as JSON.
pub(super) fn table_json(results: &[TaskResult], versus: &[TaskResult]) -> Value {
    let tasks = by_task(results, versus).map(|(versus, rows)| {
        let rows = rows.into_iter().map(|row| {
            let difference = difference(row, versus);
            json!({
                "agent": row.agent,
                "problems": row.problems,
                "deals": row.deals,
                "points_per_shift": row.points_per_shift,
                "games_won": row.games_won,
                "place": row.place,
                "difference": difference.map(|it| it.points_per_shift),
                "common_deals": difference.map(|it| it.deals),
                "language_model": row.language_model,
                "records_sha256": row.records_sha256,
            })
        });
        json!({
            "task": versus.task,
            "deals_commitment": versus.deals_commitment,
            "versus": versus.agent.name,
            "rows": rows.collect::<Vec<_>>(),
        })
    });
    json!({"benchmark": BENCHMARK, "tasks": tasks.collect::<Vec<_>>()})
}

#[cfg(test)]
mod tests {
    use chefshat_benchmark::{AgentInfo, Task};
    use chefshat_record::language_model::ModelUsage;

    use super::*;

    #[test]
    fn a_table_has_what_games_of_language_models_cost() {
        let task = Task::named("language_model").expect("it is one of them");
        let result = |name: &str, language_model| {
            let agent = AgentInfo {
                name: name.to_owned(),
                ..AgentInfo::default()
            };
            TaskResult {
                language_model,
                deals: 10,
                records_sha256: name.to_owned(),
                ..TaskResult::of(task, agent, &[])
            }
        };
        let usage = |tokens, cost| Some(ModelUsage { tokens, cost });
        let results = [
            result("greedy", None),
            result("priced", usage(123_450, Some(0.5))),
            result("unpriced", usage(67_890, None)),
        ];
        let table = table_text(&results, &results[..1]);
        let row = |name: &str| {
            let row = table.lines().find(|line| line.trim().starts_with(name));
            let row = row.unwrap_or_else(|| panic!("{name}: {table}"));
            row.split_whitespace()
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert!(table.contains("Tokens"), "{table}");
        assert_eq!(
            row("priced")[row("priced").len() - 2..],
            ["12,345", "0.0500"]
        );
        assert_eq!(row("unpriced").last().map(String::as_str), Some("6,789"));
        assert!(text(&results[1]).contains("a game takes 12,345 tokens; its cost is 0.0500"));
        assert!(text(&results[2]).contains("its cost is unknown"));
        assert!(!text(&results[0]).contains("tokens"));
        let only_greedy = table_text(&results[..1], &results[..1]);
        assert!(!only_greedy.contains("Tokens"), "{only_greedy}");
        let json = table_json(&results, &results[..1]);
        let of_model = |row: usize| json["tasks"][0]["rows"][row]["language_model"].clone();
        assert_eq!(of_model(0), Value::Null);
        assert_eq!(of_model(1), json!({"tokens": 123_450, "cost": 0.5}));
    }
}
