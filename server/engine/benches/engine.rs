//! Decisions per second on one core, drawn uniformly among the legal actions: with the mask alone,
//! and with the observation of the deciding seat or its classic vector too. Elements are decisions;
//! dealing is included.

use std::hint::black_box;

use chefshat_engine::{Game, Mask, RuleSetSpec, Seed, Viewer};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// Games played in one iteration.
const GAMES: u64 = 100;
/// Decisions in those games. Every iteration counts them, so that no benchmark measures nothing.
const DECISIONS: u64 = 49_186;

/// A generator that is cheap beside the engine (SplitMix64).
struct Chance(u64);

impl Chance {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((word >> 32) * n as u64) >> 32) as usize
    }
}

/// Plays all games and calls `look` at each decision. Returns the number of decisions.
fn play(mut look: impl FnMut(&Game, &Mask)) -> u64 {
    let rules = RuleSetSpec::default()
        .validate()
        .expect("the standard rule set is valid");
    let mut chance = Chance(7);
    let mut decisions = 0;
    for number in 0..GAMES {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&number.to_le_bytes());
        let mut game = Game::new(rules, Seed(seed), |_| {});
        loop {
            let mask = game.legal_actions();
            if mask.is_empty() {
                break;
            }
            look(&game, &mask);
            let action = mask
                .nth(chance.below(mask.len()))
                .expect("the index is below the length");
            game.apply(action, |_| {})
                .expect("an action of the mask is legal");
            decisions += 1;
        }
        assert!(game.is_over());
    }
    assert_eq!(decisions, DECISIONS);
    decisions
}

fn random_play(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("random_play");
    group.throughput(Throughput::Elements(DECISIONS));
    group.bench_function("masks", |bencher| {
        bencher.iter(|| {
            play(|_, mask| {
                black_box(mask);
            })
        });
    });
    group.bench_function("observations", |bencher| {
        bencher.iter(|| {
            play(|game, _| {
                let decision = game.decision().expect("a decision is open");
                black_box(game.observe(Viewer::Seat(decision.seat)));
            })
        });
    });
    group.bench_function("classic_vectors", |bencher| {
        let mut vector = [0.0; 228];
        bencher.iter(|| {
            play(|game, mask| {
                let decision = game.decision().expect("a decision is open");
                game.observe(Viewer::Seat(decision.seat))
                    .write_classic_vector(mask, &mut vector);
                black_box(&vector);
            })
        });
    });
    group.finish();
}

criterion_group!(benches, random_play);
criterion_main!(benches);
