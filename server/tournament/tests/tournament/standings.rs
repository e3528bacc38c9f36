//! The order of the standings and the values in them.

use std::collections::BTreeSet;

use chefshat_tournament::{Ended, Format, SeatStatistics, Tournament};

use super::support::{begun, end, follow, line_of, order, played, settings, won_by};

/// Places by participant and points by participant, for each game of one table of four.
type Script = [([usize; 4], [u64; 4])];

/// Plays the games of a script.
fn script(games: &Script) -> Tournament {
    drawn_by(7, games)
}

/// The same with another draw seed.
fn drawn_by(seed: u8, games: &Script) -> Tournament {
    let mut settings = settings(Format::RoundRobin);
    settings.draw_seed = [seed; 32];
    settings.rounds = Some(games.len() as u32);
    let mut tournament = begun(settings, 4);
    for (game, (places, points)) in games.iter().enumerate() {
        follow(&mut tournament, 0);
        let seats = tournament.games()[game].seats.clone();
        let seats = seats.into_iter().map(|who| SeatStatistics {
            place: places[who],
            points: points[who],
            ..SeatStatistics::default()
        });
        let seats = seats.collect();
        end(&mut tournament, game, Ended::Played { shifts: 3, seats });
    }
    follow(&mut tournament, 0);
    tournament
}

#[test]
fn scores_come_first_then_points_then_meetings() {
    // 5, 3, 1, 0 for the places.
    let by_score = script(&[([4, 1, 2, 3], [99, 0, 0, 0])]);
    assert_eq!(order(&by_score), [1, 2, 3, 0]);
    // All have 8 = 5 + 3 or 1 = 1 + 0.
    let by_points = script(&[([1, 2, 3, 4], [5, 6, 3, 3]), ([2, 1, 4, 3], [5, 5, 3, 4])]);
    assert_eq!(order(&by_points), [1, 0, 3, 2]);
}

#[test]
fn head_to_head_results_break_ties_of_scores_and_points() {
    // One has 3 + 3 + 3; the other 5 + 1 + 1 + 1 + 1, and is ahead in three of the five games.
    let games = [
        [2, 1, 3, 4],
        [2, 3, 1, 4],
        [2, 3, 4, 1],
        [4, 3, 1, 2],
        [4, 3, 2, 1],
    ];
    for (one, other) in [(0, 1), (1, 0)] {
        let games = games.map(|places| {
            let mut by_participant = places;
            by_participant[one] = places[0];
            by_participant[other] = places[1];
            (by_participant, [4; 4])
        });
        let tournament = script(&games);
        let standings = tournament.standings();
        let lines: Vec<(usize, u64)> = standings
            .iter()
            .map(|line| (line.participant, line.score))
            .collect();
        assert_eq!(lines, [(2, 14), (3, 13), (other, 9), (one, 9)]);
    }
}

#[test]
fn a_standing_adds_up_the_games() {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(2);
    let mut tournament = begun(settings, 5);
    let mut first = None;
    for game in 0..2 {
        follow(&mut tournament, 0);
        let seats = (0..4).map(|seat| SeatStatistics {
            place: seat + 1,
            points: 20 - seat as u64,
            substituted: seat == 0,
            hinted: false,
            decisions: 30,
            wrong_actions: 2,
            timeouts: 1,
            decision_time_us: 3000,
            timed_decisions: 20,
            performance_score: 1.5 + game as f64,
        });
        let seats = seats.collect();
        first.get_or_insert(tournament.games()[0].seats[0]);
        end(&mut tournament, game, Ended::Played { shifts: 3, seats });
    }
    follow(&mut tournament, 0);
    let standings = tournament.standings();
    let games: u32 = standings.iter().map(|line| line.games).sum();
    let byes: u32 = standings.iter().map(|line| line.byes).sum();
    assert_eq!((games, byes), (8, 2));
    let line = line_of(&tournament, first.unwrap());
    let played = u64::from(line.games);
    assert!(line.substituted >= 1);
    assert_eq!((line.wrong_actions, line.timeouts), (2 * played, played));
    assert!((line.mean_decision_time_us - 150.0).abs() < 1e-9);
    assert_eq!(line.last_round, 0, "not a knockout");
    assert!((1.5..=2.5).contains(&line.performance_score));
    assert_eq!(line.places.iter().sum::<u32>(), line.games);
    assert!(line.mean_score() > 0.0);
    let idle = begun(tournament.settings().clone(), 5).standings();
    assert!(idle.iter().all(|line| line.mean_score() == 0.0));
    assert!(idle.iter().all(|line| line.mean_decision_time_us == 0.0));
}

#[test]
fn playing_fewer_games_is_no_disadvantage() {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(2);
    let mut tournament = begun(settings, 5);
    follow(&mut tournament, 0);
    let winner = tournament.games()[0].seats[0];
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    follow(&mut tournament, 0);
    assert_eq!(order(&tournament)[0], winner);
    // The winner of the only other game, with a mean of 5 from one game, is level with it.
    let seats = tournament.games()[1].seats.clone();
    let fresh = (0..5).find(|who| !tournament.games()[0].seats.contains(who));
    let fresh = fresh.unwrap();
    assert!(
        seats.contains(&fresh),
        "the bye of the first round plays now"
    );
    end(&mut tournament, 1, won_by(fresh, &seats));
    let line = line_of(&tournament, fresh);
    assert_eq!((line.games, line.score), (1, 5));
    assert!(line.place <= 2);
}

#[test]
fn the_seed_breaks_remaining_ties() {
    // The second game reverses the places of the first.
    let games = [([1, 2, 3, 4], [4; 4]), ([4, 3, 2, 1], [4; 4])];
    let ahead = |seed: u8| {
        let ranked = order(&drawn_by(seed, &games));
        assert_eq!(ranked, order(&drawn_by(seed, &games)));
        ranked[0]
    };
    let ahead: BTreeSet<usize> = (0..16).map(ahead).collect();
    assert_eq!(ahead, BTreeSet::from([0, 3]));
}

#[test]
fn before_a_game_has_counted_nobody_has_a_place() {
    for format in Format::ALL {
        let mut tournament = begun(settings(format), 8);
        follow(&mut tournament, 0);
        let standings = tournament.standings();
        let lines: Vec<(u32, usize)> = (standings.iter())
            .map(|line| (line.place, line.participant))
            .collect();
        let joined: Vec<(u32, usize)> = (0..8).map(|number| (0, number)).collect();
        assert_eq!(lines, joined, "{format:?}");
        assert!(tournament.order_confidence().is_empty());
        assert!(!tournament.has_counted());

        let mut closed = tournament.clone();
        closed.fold(&closed.close().unwrap());
        assert_eq!(closed.standings(), standings);

        end(&mut tournament, 0, played(&[1, 2, 3, 4]));
        assert!(tournament.has_counted());
        let places: Vec<u32> = (tournament.standings().iter())
            .map(|line| line.place)
            .collect();
        assert_eq!(places, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(tournament.order_confidence().len(), 7);
    }
}
