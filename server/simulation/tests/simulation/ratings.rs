//! Ratings have the right order and honest uncertainties.

use chefshat_simulation::calibration::{Calibration, Fields, Update, calibration};
use chefshat_tournament::ratings::{
    GameProblem, Rated, Rating, Ratings, after_game, pair_weight, win_chance,
};
use skillratings::MultiTeamOutcome;
use skillratings::weng_lin::{WengLinConfig, WengLinRating, weng_lin_multi_team};

/// Fields from close to far apart, small to large.
fn many() -> Vec<Fields> {
    let sizes = [(8, 40), (16, 20), (40, 8)];
    let fields = sizes.iter().flat_map(|&(participants, fields)| {
        [1.0, 4.0, 8.0].map(|spread| Fields {
            fields,
            participants,
            spread,
            players: 4,
            seed: 5,
        })
    });
    fields.collect()
}

const ROUNDS: [u32; 4] = [20, 50, 100, 300];

/// The library's own update for several teams.
fn library(players: &[(Rating, u32)]) -> Vec<Rating> {
    let teams: Vec<[WengLinRating; 1]> = players
        .iter()
        .map(|(rating, _)| [WengLinRating::from((rating.mean, rating.deviation))])
        .collect();
    let ranked: Vec<(&[WengLinRating], MultiTeamOutcome)> = teams
        .iter()
        .zip(players)
        .map(|(team, (_, place))| (team.as_slice(), MultiTeamOutcome::new(*place as usize)))
        .collect();
    weng_lin_multi_team(&ranked, &WengLinConfig::new())
        .iter()
        .map(|team| Rating {
            mean: team[0].rating,
            deviation: team[0].uncertainty,
        })
        .collect()
}

/// Shares covered, for all kinds of fields and numbers of games.
fn shares(update: Update<'_>) -> Vec<f64> {
    let measured = many()
        .into_iter()
        .flat_map(|fields| calibration(&fields, &ROUNDS, update));
    measured
        .map(|Calibration { covered, .. }| {
            assert!(covered.count() >= 320, "too few to say anything");
            covered.mean()
        })
        .collect()
}

#[test]
fn the_stated_uncertainty_covers_the_truth_as_often_as_it_claims() {
    let shares = shares(&after_game);
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!((0.95..0.98).contains(&mean), "{mean}");
    assert!(shares.iter().all(|share| *share > 0.92), "{shares:?}");
}

#[test]
fn the_same_test_finds_the_library_overconfident() {
    // Shows that the test above can fail.
    let shares = shares(&library);
    let worst = shares.iter().copied().fold(1.0, f64::min);
    assert!(worst < 0.9, "{shares:?}");
}

#[test]
fn more_games_make_ratings_better_and_surer() {
    let fields = Fields {
        fields: 20,
        participants: 16,
        spread: 4.0,
        players: 4,
        seed: 6,
    };
    let measured = calibration(&fields, &[20, 100, 500], &after_game);
    for two in measured.windows(2) {
        assert!(two[1].error.mean() < 0.7 * two[0].error.mean());
        assert!(two[1].deviation.mean() < 0.7 * two[0].deviation.mean());
        assert!(two[1].in_order.mean() > two[0].in_order.mean());
    }
    assert!(measured[2].in_order.mean() > 0.95, "{measured:?}");
}

#[test]
fn uncertainty_is_honest_for_other_numbers_of_players() {
    for players in [2, 3, 5, 6] {
        let fields = Fields {
            fields: 30,
            participants: 30,
            spread: 4.0,
            players,
            seed: 7,
        };
        for measured in calibration(&fields, &[30, 150], &after_game) {
            let share = measured.covered.mean();
            assert!(share > 0.92, "{players} players: {share}");
        }
    }
}

#[test]
fn a_field_of_known_strengths_comes_out_in_their_order() {
    // Eight participants, each better than the next by a skill difference that wins two games of
    // three.
    let step = 5.0;
    assert!((0.68..0.72).contains(&win_chance(step, 0.0)));
    let mut ratings = Ratings::default();
    let mut chance = 9u64;
    let mut draw = || {
        chance = chance
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((chance >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    for _ in 0..600 {
        let mut all: Vec<(f64, usize)> = (0..8).map(|number| (draw(), number)).collect();
        all.sort_by(|left, right| left.0.total_cmp(&right.0));
        let mut table: Vec<(f64, usize)> = all[..4]
            .iter()
            .map(|(_, number)| (*number as f64 * step / 5.893 + (-draw().ln()).ln(), *number))
            .collect();
        table.sort_by(|left, right| left.0.total_cmp(&right.0));
        let game: Vec<(usize, u32)> = table.iter().map(|(_, who)| *who).zip(1..).collect();
        ratings.fold(&game).unwrap();
    }
    let order: Vec<usize> = ratings
        .leaderboard(|_| true, 0)
        .iter()
        .map(|(who, _)| **who)
        .collect();
    assert_eq!(order, [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(ratings.games(), 600);
}

#[test]
fn a_leaderboard_is_filtered_and_sorted() {
    let mut ratings = Ratings::default();
    for _ in 0..3 {
        ratings.fold(&[("a", 1), ("b", 2), ("c", 3)]).unwrap();
    }
    ratings.fold(&[("a", 2), ("d", 1)]).unwrap();
    let shown = |least: u32| -> Vec<&str> {
        let lines = ratings.leaderboard(|who| *who != "b", least);
        lines.iter().map(|(who, _)| **who).collect()
    };
    // One win leaves too much uncertainty for the first place.
    assert!(ratings.rating(&"d").mean > ratings.rating(&"c").mean);
    assert_eq!(shown(0), ["a", "d", "c"]);
    assert_eq!(shown(2), ["a", "c"]);
    let Rated { games, places, .. } = ratings.get(&"a").unwrap();
    assert_eq!((*games, places.as_slice()), (4, [3, 1].as_slice()));
    assert_eq!(ratings.get(&"e"), None);
    assert_eq!(ratings.rating(&"e"), Rating::default());
}

#[test]
fn invalid_games_change_no_rating() {
    let mut ratings = Ratings::default();
    ratings.fold(&[(0, 1), (1, 2)]).unwrap();
    let before = ratings.clone();
    let seven: Vec<(i32, u32)> = (0..7).zip(1..).collect();
    for (game, problem) in [
        (&[][..], GameProblem::Players(0)),
        (&[(0, 1)], GameProblem::Players(1)),
        (&seven, GameProblem::Players(7)),
        (&[(0, 1), (0, 2)], GameProblem::SameParticipant),
        (&[(0, 0), (1, 1)], GameProblem::Place(0)),
        (&[(0, 1), (1, 3)], GameProblem::Place(3)),
    ] {
        assert_eq!(ratings.fold(game), Err(problem));
    }
    assert_eq!(ratings, before);
}

#[test]
fn pairs_of_larger_games_count_less() {
    assert_eq!([2, 3, 4, 6].map(pair_weight), [0.75, 0.6, 0.5, 0.375]);
}
