//! How many fewer games tell two agents apart when both are dealt the same cards? docs/ratings.md
//! shows the result; the Python package draws its figure from the JSON form.

use chefshat_agents::AgentKind;
use chefshat_engine::{RuleSet, RuleSetSpec, Stop};
use chefshat_simulation::{Candidate, Contender, Measured, SameSeat};
use clap::Parser;
use serde_json::{Value, json};

/// Measure how many fewer games tell two agents apart when both are dealt the same cards.
///
/// Each of the two sits in the same seats among three greedy agents, like participants of a
/// tournament who never meet. A game is worth 5, 3, 1, 0 points by place. The standard error of the
/// difference is measured twice: on the same deals, and on independent deals. `trained, slips` is
/// `trained` with a random legal action at one decision of twenty: a different agent, but a similar
/// one.
///
/// The same seed gives the same output on any number of threads (set RAYON_NUM_THREADS to limit
/// them).
#[derive(Debug, Parser)]
#[command(
    after_help = "Example:\n  cargo run --release -p chefshat-simulation --example duplicates -- --json > duplicates.json"
)]
struct Arguments {
    /// Games of each agent.
    #[arg(long, default_value_t = 3200, value_parser = clap::value_parser!(u64).range(FIRST_CHECK..=1_000_000))]
    games: u64,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Games before the first measurement; the number doubles from one to the next.
const FIRST_CHECK: u64 = 50;

/// Two agents, and the length of their games.
struct Case {
    names: [&'static str; 2],
    length: &'static str,
    same_seat: SameSeat,
}

/// A case and its measurements.
type Row = (Case, Vec<Measured>);

fn main() {
    let arguments = Arguments::parse();
    let rows = rows(&arguments);
    if arguments.json {
        println!("{}", report(&arguments, &rows));
    } else {
        print!("{}", table(&rows));
    }
}

fn rows(arguments: &Arguments) -> Vec<Row> {
    let doubled = std::iter::successors(Some(FIRST_CHECK), |games| games.checked_mul(2));
    let mut checks: Vec<u64> = doubled
        .take_while(|games| *games < arguments.games)
        .collect();
    checks.push(arguments.games);
    cases(arguments.seed)
        .into_iter()
        .map(|case| {
            let measured = case.same_seat.measure(&checks, &|_| {});
            (case, measured)
        })
        .collect()
}

fn cases(seed: u64) -> Vec<Case> {
    let agent = |kind, percent: u8| Candidate {
        plays: Contender::Kind(kind),
        epsilon: f64::from(percent) / 100.0,
    };
    let (trained, greedy) = (AgentKind::Trained, AgentKind::Greedy);
    let pairs = [
        (
            ["trained", "trained, slips"],
            [agent(trained, 0), agent(trained, 5)],
        ),
        (["trained", "greedy"], [agent(trained, 0), agent(greedy, 0)]),
        (
            ["greedy", "random"],
            [agent(greedy, 0), agent(AgentKind::Random, 0)],
        ),
    ];
    let lengths = [
        ("1 Shift", Stop::Shifts(1)),
        ("15 points", Stop::Points(15)),
    ];
    let of_length = |(length, stop): (&'static str, Stop)| {
        pairs.clone().map(|(names, candidates)| Case {
            names,
            length,
            same_seat: SameSeat {
                rules: rules(stop),
                candidates,
                others: Contender::Kind(greedy),
                seed,
            },
        })
    };
    lengths.into_iter().flat_map(of_length).collect()
}

fn rules(stop: Stop) -> RuleSet {
    let spec = RuleSetSpec {
        stop,
        ..RuleSetSpec::default()
    };
    spec.validate()
        .expect("the default rules are valid for every length")
}

fn table(rows: &[Row]) -> String {
    let mut text = format!(
        "{:<9}{:<16}{:<11}{:>10}{:>20}{:>19}{:>19}\n",
        "first",
        "second",
        "game",
        "difference",
        "error, independent",
        "error, same deals",
        "worth, times games"
    );
    for (case, measured) in rows {
        let Some(last) = measured.last() else {
            continue;
        };
        let gain = last.gain().map_or("∞".into(), |gain| format!("{gain:.1}"));
        let [first, second] = case.names;
        text.push_str(&format!(
            "{first:<9}{second:<16}{:<11}{:>10.3}{:>20.4}{:>19.4}{gain:>19}\n",
            case.length, last.difference, last.independent_error, last.duplicate_error,
        ));
    }
    text.push_str(
        "\nDifferences are points of a game by place (5, 3, 1, 0); errors are standard errors.\n",
    );
    text
}

fn report(arguments: &Arguments, rows: &[Row]) -> Value {
    let rows = rows.iter().flat_map(|(case, measured)| {
        measured.iter().map(|measured| {
            json!({
                "first": case.names[0],
                "second": case.names[1],
                "game": case.length,
                "games": measured.games,
                "difference": measured.difference,
                "independent_error": measured.independent_error,
                "duplicate_error": measured.duplicate_error,
                "gain": measured.gain(),
            })
        })
    });
    json!({
        "experiment": "duplicates",
        "seed": arguments.seed,
        "rows": rows.collect::<Vec<Value>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seed: u64, threads: usize) -> Vec<Row> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let arguments = Arguments {
            games: 120,
            seed,
            json: false,
        };
        pool.expect("a pool").install(|| rows(&arguments))
    }

    #[test]
    fn same_deals_reduce_the_error() {
        let measured = run(0, 2);
        let games = measured.iter().flat_map(|(_, all)| all);
        let games: Vec<u64> = games.map(|measured| measured.games).collect();
        assert_eq!(games, [50, 100, 120].repeat(6));
        for similar in &measured[0].1 {
            assert!(similar.duplicate_error < 0.8 * similar.independent_error);
        }
        assert_eq!(table(&run(0, 1)), table(&measured));
        assert_ne!(table(&run(1, 2)), table(&measured));
    }
}
