//! Is the stated confidence in the order of a tournament's standings right? Plays tournaments of
//! made-up participants with known skills and counts how often neighbours of equal skill, and of
//! different skill, are called certain. docs/ratings.md shows the result.

use std::iter::repeat_n;

use chefshat_tournament::{
    Change, Ended, Format, SURE, SeatStatistics, Tournament,
    ratings::BETA,
    statistics::Moments,
    testing::{begun, settings},
};
use clap::Parser;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use serde_json::{Value, json};

/// Play tournaments of known skills and count how often the order of neighbours is called certain.
///
/// Games have four players and give 5, 3, 1, 0 by place, or two players and 1, 0. Places follow random performances around
/// the skills; a lead of 5.9 wins 73 % of two-player games. Of neighbours of equal skill at most
/// one pair in twenty should reach 95 %. The same seed gives the same output.
#[derive(Debug, Parser)]
#[command(
    after_help = "Example:\n  cargo run --release -p chefshat-simulation --example orders -- --tournaments 500"
)]
struct Arguments {
    /// Tournaments of each kind.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u64).range(10..=1_000_000))]
    tournaments: u64,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A kind of tournament: its format, and participants in groups of equal skill.
#[derive(Debug, Clone, Copy)]
struct Kind {
    name: &'static str,
    format: Format,
    /// Participants of each group.
    size: usize,
    /// Number of groups; each is better than the one before by [`LEAD`].
    groups: usize,
}

const KINDS: [Kind; 6] = [
    kind("2 equal, games of two", Format::RoundRobin, 2, 1),
    kind("4 equal, one table", Format::RoundRobin, 4, 1),
    kind("8 equal, Swiss", Format::Swiss, 8, 1),
    kind("24 equal, Swiss", Format::Swiss, 24, 1),
    kind("4 different, one table", Format::RoundRobin, 1, 4),
    kind("24 in three groups, Swiss", Format::Swiss, 8, 3),
];
const ROUNDS: [u32; 6] = [2, 4, 5, 8, 12, 20];
/// A lead that wins 90 % of two-player games.
const LEAD: f64 = 13.0;
/// The confidences that are counted.
const LEVELS: [f64; 4] = [0.6, 0.8, 0.88, SURE];

const fn kind(name: &'static str, format: Format, size: usize, groups: usize) -> Kind {
    Kind {
        name,
        format,
        size,
        groups,
    }
}

/// The neighbours in the standings of tournaments of one kind, after a number of rounds.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    /// For each pair of equal skill and each of [`LEVELS`] 1 if its confidence reaches it, else 0.
    equal: [Moments; LEVELS.len()],
    /// The highest confidence of such a pair.
    highest: f64,
    /// The same as `equal` for pairs of different skill in the right order.
    right: [Moments; LEVELS.len()],
    /// The same for those in the wrong order.
    wrong: [Moments; LEVELS.len()],
}

struct Row {
    kind: Kind,
    rounds: u32,
    found: Found,
}

fn main() {
    let arguments = Arguments::parse();
    let rows = rows(&KINDS, arguments.tournaments, arguments.seed);
    if arguments.json {
        println!("{}", report(&arguments, &rows));
    } else {
        print!("{}", table(&rows));
    }
}

fn rows(kinds: &[Kind], tournaments: u64, seed: u64) -> Vec<Row> {
    let rows = kinds.iter().flat_map(|&kind| {
        let mut found = [Found::default(); ROUNDS.len()];
        for number in 0..tournaments {
            let mut chance = ChaCha8Rng::seed_from_u64(seed);
            chance.set_stream(number);
            play(kind, &mut chance, &mut found);
        }
        let rows = ROUNDS.into_iter().zip(found);
        rows.map(move |(rounds, found)| Row {
            kind,
            rounds,
            found,
        })
    });
    rows.collect()
}

/// Plays one tournament and adds the confidence of its neighbours after each of [`ROUNDS`].
fn play(kind: Kind, chance: &mut ChaCha8Rng, found: &mut [Found; ROUNDS.len()]) {
    let skill = |who: usize| (who / kind.size) as f64 * LEAD;
    let mut settings = settings(kind.format);
    settings.rounds = ROUNDS.last().copied();
    if kind.size * kind.groups < settings.players {
        settings.players = 2;
        settings.points = vec![1, 0];
    }
    chance.fill_bytes(&mut settings.draw_seed);
    let mut tournament = begun(settings, repeat_n(None, kind.size * kind.groups));
    for round in 1..=ROUNDS[ROUNDS.len() - 1] {
        while let Some(change) = tournament.next(0) {
            tournament.fold(&change);
        }
        let playing: Vec<usize> = tournament.playing().collect();
        for game in playing {
            let ended = result(&tournament, game, skill, chance);
            tournament.fold(&ended);
        }
        let measured = ROUNDS.iter().position(|&rounds| rounds == round);
        let Some(found) = measured.map(|at| &mut found[at]) else {
            continue;
        };
        for pair in tournament.order_confidence() {
            let confidence = pair.order.confidence;
            let (upper, lower) = (skill(pair.upper), skill(pair.lower));
            let moments = match upper.total_cmp(&lower) {
                std::cmp::Ordering::Greater => &mut found.right,
                std::cmp::Ordering::Less => &mut found.wrong,
                std::cmp::Ordering::Equal => {
                    found.highest = found.highest.max(confidence);
                    &mut found.equal
                }
            };
            for (moments, level) in moments.iter_mut().zip(LEVELS) {
                moments.add(f64::from(u8::from(confidence >= level)));
            }
        }
    }
}

/// Places by random performances around the skills (Plackett and Luce, with Gumbel noise).
fn result(
    tournament: &Tournament,
    game: usize,
    skill: impl Fn(usize) -> f64,
    chance: &mut ChaCha8Rng,
) -> Change {
    let performances: Vec<f64> = (tournament.games()[game].seats.iter())
        .map(|&who| {
            // 53 random bits above 0 and below 1.
            let uniform = ((chance.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
            skill(who) - std::f64::consts::SQRT_2 * BETA * (-uniform.ln()).ln()
        })
        .collect();
    let seats = performances.iter().map(|own| SeatStatistics {
        place: 1 + performances.iter().filter(|other| *other > own).count(),
        ..SeatStatistics::default()
    });
    let ended = Ended::Played {
        shifts: 1,
        seats: seats.collect(),
    };
    (tournament.ended(game, ended)).expect("the game is being played and has a place for each seat")
}

fn table(rows: &[Row]) -> String {
    let mut text = format!("{:26}  rounds  equal:", "");
    for level in LEVELS {
        text.push_str(&format!("  {:>4.0} %", 100.0 * level));
    }
    text.push_str("  highest  different: 95 %  right\n");
    for row in rows {
        let found = &row.found;
        text.push_str(&format!("{:26}  {:>6}        ", row.kind.name, row.rounds));
        for reached in &found.equal {
            text.push_str(&share(reached));
        }
        text.push_str(&format!("  {:>5.1} %", 100.0 * found.highest));
        let (right, wrong) = (sure(&found.right), sure(&found.wrong));
        let mut both = right;
        both.merge(&wrong);
        text.push_str(&format!("{:>17}{}\n", share(&both), {
            let (right, wrong) = (times(&right), times(&wrong));
            match right + wrong > 0.0 {
                true => format!("  {:>5.1} %", 100.0 * right / (right + wrong)),
                false => "        –".to_owned(),
            }
        }));
    }
    text
}

fn share(of: &Moments) -> String {
    match of.count() {
        0 => "       –".to_owned(),
        _ => format!("  {:>4.1} %", 100.0 * of.mean()),
    }
}

fn sure(of: &[Moments; LEVELS.len()]) -> Moments {
    of[LEVELS.len() - 1]
}

fn times(of: &Moments) -> f64 {
    of.mean() * of.count() as f64
}

fn report(arguments: &Arguments, rows: &[Row]) -> Value {
    let shares = |of: &[Moments; LEVELS.len()]| {
        let reached: Vec<f64> = of.iter().map(Moments::mean).collect();
        json!({ "pairs": of[0].count(), "reached": reached })
    };
    let rows = rows.iter().map(|row| {
        json!({
            "kind": row.kind.name,
            "rounds": row.rounds,
            "equal": shares(&row.found.equal),
            "highest": row.found.highest,
            "right": shares(&row.found.right),
            "wrong": shares(&row.found.wrong),
        })
    });
    json!({
        "tournaments": arguments.tournaments,
        "seed": arguments.seed,
        "levels": LEVELS,
        "lead": LEAD,
        "rows": rows.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_are_called_certain_no_more_often_than_stated() {
        // Two, one table and a small Swiss tournament of equals, and one table of different ones.
        let tournaments = 200;
        let rows = rows(&[KINDS[1], KINDS[0], KINDS[2], KINDS[4]], tournaments, 3);
        for row in rows.iter().filter(|row| row.kind.groups == 1) {
            for (reached, level) in row.found.equal.iter().zip(LEVELS) {
                // The pairs of a tournament are not independent: counts tournaments.
                let noise = (level * (1.0 - level) / tournaments as f64).sqrt();
                assert!(
                    reached.mean() <= 1.0 - level + 3.0 * noise,
                    "{} after {} rounds: {} reach {level}",
                    row.kind.name,
                    row.rounds,
                    reached.mean()
                );
            }
            if row.rounds <= 4 {
                assert!(row.found.highest < 0.88, "{}", row.found.highest);
            }
        }
        // It does not simply call nothing certain.
        let last = rows.last().expect("there are rows");
        assert!(sure(&last.found.right).mean() > 0.8);
        assert!(rows[ROUNDS.len() - 1].found.equal[0].mean() > 0.05);
    }
}
