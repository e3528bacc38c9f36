//! Whole games on a simulated network (turmoil): a server, four agents and a spectator, all on one
//! thread under one simulated clock. Connections are delayed, held and cut, and the server crashes
//! while they play. The seed of a run decides everything: the same seed gives the same trace.
//!
//! `CHEFSHAT_SIMULATIONS=100000` runs more seeds, `CHEFSHAT_SIMULATION=7` one seed alone.

mod disk;
mod net;
mod run;

use run::{Run, simulate};

/// Seeds in `cargo test`.
const RUNS: u64 = 20;

/// A number from the environment.
fn number(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|_| panic!("{name} is not a number")),
    )
}

#[test]
fn games_end_and_lose_nothing_on_a_bad_network() {
    let seeds = match number("CHEFSHAT_SIMULATION") {
        Some(seed) => seed..seed + 1,
        None => 0..number("CHEFSHAT_SIMULATIONS").unwrap_or(RUNS),
    };
    let mut all = Run::default();
    for seed in seeds.clone() {
        let run = std::panic::catch_unwind(|| simulate(seed));
        let run = run.unwrap_or_else(|_| panic!("CHEFSHAT_SIMULATION={seed} fails"));
        all.acknowledged += run.acknowledged;
        all.crashes += run.crashes;
        all.partitions += run.partitions;
        all.simulated += run.simulated;
    }
    println!(
        "{} seeds: {} acknowledged decisions, {} crashes, {} partitions, {:.1} hours of simulated time",
        seeds.count(),
        all.acknowledged,
        all.crashes,
        all.partitions,
        all.simulated.as_secs_f64() / 3_600.0,
    );
    if number("CHEFSHAT_SIMULATION").is_none() {
        assert!(all.crashes > 0 && all.partitions > 0 && all.acknowledged > 0);
    }
}

#[test]
fn the_same_seed_gives_the_same_trace() {
    let seeds = number("CHEFSHAT_SIMULATIONS").unwrap_or(RUNS) / 10;
    for seed in 0..seeds.max(2) {
        let [one, other] = [simulate(seed), simulate(seed)];
        let mut lines = one.trace.lines().zip(other.trace.lines());
        let different = lines.find(|(one, other)| one != other);
        assert_eq!(different, None, "seed {seed}");
        assert_eq!(one.trace.len(), other.trace.len(), "seed {seed}");
    }
    assert!(simulate(0).trace != simulate(1).trace);
}
