//! The power of simulated studies against what is known of the t-test, and of what it must not find.

use chefshat_simulation::power::{Answers, Design, Measure, Power, power};

const STUDIES: u64 = 4_000;

/// Units that meet one of two conditions each, or both.
fn design(units: usize, members: usize, within: bool) -> Design {
    let conditions = |unit| match within {
        true => vec![unit % 2, 1 - unit % 2],
        false => vec![unit % 2],
    };
    Design {
        units: (0..units).map(conditions).collect(),
        members,
        has_level: vec![true, false],
    }
}

/// Opinions on a scale so fine and wide that answers express them, with an effect of half a standard
/// deviation.
fn fine() -> Answers {
    Answers {
        min: 0.0,
        max: 1e6,
        step: 1.0,
        count: 1,
        mean: 5e5,
        sd: 1e4,
        item_correlation: 0.5,
        correlation: 0.5,
        group_correlation: 0.0,
        effect: 5e3,
    }
}

fn found(design: &Design, answers: Answers) -> Power {
    power(
        design,
        &Measure::Answers(answers),
        0.05,
        STUDIES,
        7,
        &|_| (),
    )
}

/// Whether a share of the simulated studies agrees with one that is known: within four standard errors.
fn agrees(found: u64, known: f64) -> bool {
    let error = (known * (1.0 - known) / STUDIES as f64).sqrt();
    (found as f64 / STUDIES as f64 - known).abs() < 4.0 * error
}

/// The known powers are those of the noncentral t distribution, as G*Power 3.1 (Faul et al., 2007)
/// computes them.
#[test]
fn the_power_is_that_of_the_t_test() {
    // d = 0.5 and 64 in each of two groups.
    let between = found(&design(128, 1, false), fine());
    assert!(agrees(between.found, 0.801), "{between:?}");
    assert!((between.standardized() - 0.5).abs() < 0.02, "{between:?}");
    // Differences of two answers with a correlation of 0.5 have the deviation of one: dz = 0.5 and 34.
    let within = found(&design(34, 1, true), fine());
    assert!(agrees(within.found, 0.808), "{within:?}");
    // Means of two strangers: d = 0.5 times the root of 2, and 32 in each of two groups.
    let strangers = found(&design(64, 2, false), fine());
    assert!(agrees(strangers.found, 0.795), "{strangers:?}");
    // Two who always agree are one.
    let alike = Answers {
        item_correlation: 1.0,
        correlation: 1.0,
        group_correlation: 1.0,
        ..fine()
    };
    let alike = found(&design(128, 2, false), alike);
    assert!(agrees(alike.found, 0.801), "{alike:?}");
    // Five items that measure the same are one, also where conditions are compared within participants.
    let scale = Answers {
        count: 5,
        item_correlation: 1.0,
        ..fine()
    };
    let scale = found(&design(34, 1, true), scale);
    assert!(agrees(scale.found, 0.808), "{scale:?}");
    // Five that have nothing else in common than one participant: dz = 0.5 times the root of 5, and 9.
    let items = Answers { count: 5, ..fine() };
    let items = found(&design(9, 1, true), items);
    assert!(agrees(items.found, 0.835), "{items:?}");
    for power in [between, within, strangers, alike, scale, items] {
        assert!(agrees(power.false_positives, 0.05), "{power:?}");
        assert!(power.interval95().contains(power.share()));
    }
}

#[test]
fn answers_stay_on_their_scale() {
    let points = Answers {
        min: 1.0,
        max: 5.0,
        step: 1.0,
        mean: 4.5,
        sd: 1.0,
        effect: 2.0,
        ..fine()
    };
    let bounded = found(&design(40, 1, false), points.clone());
    // With the level nearly everybody answers 5, and without it the mean is below 4.5.
    let difference = bounded.difference.mean();
    assert!((0.5..1.2).contains(&difference), "{difference}");
    // Where all answer the same, nothing is found.
    let same = Answers {
        mean: 100.0,
        ..points
    };
    let same = found(&design(40, 1, false), same);
    assert_eq!((same.found, same.false_positives), (0, 0));
    assert_eq!(same.difference.mean(), 0.0);
}

#[test]
fn games_are_drawn_from_those_that_were_played() {
    let games = |values: [[f64; 4]; 2]| Measure::Games {
        values: values.map(Vec::from).into(),
        count: 2,
    };
    let of = |measure| power(&design(20, 1, false), &measure, 0.05, STUDIES, 7, &|_| ());
    let apart = of(games([[3.0, 4.0, 5.0, 4.0], [0.0, 1.0, 2.0, 1.0]]));
    assert_eq!(apart.found, STUDIES);
    assert!((apart.difference.mean() - 3.0).abs() < 0.05, "{apart:?}");
    assert!(agrees(apart.false_positives, 0.05), "{apart:?}");
    let alike = of(games([[0.0, 1.0, 2.0, 3.0], [3.0, 2.0, 1.0, 0.0]]));
    assert!(agrees(alike.found, 0.05), "{alike:?}");
}

#[test]
fn the_same_seed_gives_the_same_power_on_any_number_of_threads() {
    let of = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let measure = Measure::Answers(fine());
        let design = design(20, 1, false);
        let simulate = || power(&design, &measure, 0.05, 300, seed, &|_| ());
        pool.expect("threads").install(simulate)
    };
    assert_eq!(of(1, 3), of(3, 3));
    assert_ne!(of(1, 3), of(1, 4));
}
