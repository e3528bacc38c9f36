//! In which order participants stand, and what their lines say.

use chefshat_arena::tournament::{Ended, Format, SeatPlayed, Tournament};

use super::support::{begun, end, follow, played, settings};

/// Plays the games of one table of four by a script: places by participant, points by participant.
fn script(games: &[([usize; 4], [u64; 4])]) -> Tournament {
    let mut settings = settings(Format::RoundRobin);
    settings.rounds = Some(games.len() as u32);
    let mut tournament = begun(settings, 4);
    for (game, (places, points)) in games.iter().enumerate() {
        follow(&mut tournament, 0);
        let seats = tournament.games()[game].seats.clone();
        let seats = seats.into_iter().map(|who| SeatPlayed {
            place: places[who],
            points: points[who],
            ..SeatPlayed::default()
        });
        let seats = seats.collect();
        end(&mut tournament, game, Ended::Played { shifts: 3, seats });
    }
    follow(&mut tournament, 0);
    tournament
}

fn order(tournament: &Tournament) -> Vec<usize> {
    let standings = tournament.standings();
    standings.iter().map(|line| line.participant).collect()
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
fn of_those_level_in_scores_and_points_whoever_was_ahead_more_often_stands_higher() {
    // One has 3 + 3 + 3, the other 5 + 1 + 1 + 1 + 1 and is ahead in three of the five games.
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
fn a_line_says_what_was_done() {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(2);
    let mut tournament = begun(settings, 5);
    let mut first = None;
    for game in 0..2 {
        follow(&mut tournament, 0);
        let seats = (0..4).map(|seat| SeatPlayed {
            place: seat + 1,
            points: 20 - seat as u64,
            substituted: seat == 0,
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
    let line = standings
        .iter()
        .find(|line| Some(line.participant) == first)
        .unwrap();
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
fn who_has_played_less_is_not_behind_for_it() {
    let mut settings = settings(Format::Swiss);
    settings.rounds = Some(2);
    let mut tournament = begun(settings, 5);
    follow(&mut tournament, 0);
    let winner = tournament.games()[0].seats[0];
    end(&mut tournament, 0, played(&[1, 2, 3, 4]));
    follow(&mut tournament, 0);
    assert_eq!(order(&tournament)[0], winner);
    // Whoever wins the only other game with a mean of 5 from one game stands level with it.
    let seats = tournament.games()[1].seats.clone();
    let fresh = (0..5).find(|who| !tournament.games()[0].seats.contains(who));
    let fresh = fresh.unwrap();
    assert!(
        seats.contains(&fresh),
        "the bye of the first round plays now"
    );
    let places: Vec<usize> = seats
        .iter()
        .map(|&who| match who {
            _ if who == fresh => 1,
            _ => {
                2 + seats
                    .iter()
                    .filter(|&&other| other < who && other != fresh)
                    .count()
            }
        })
        .collect();
    end(&mut tournament, 1, played(&places));
    let standings = tournament.standings();
    let line = standings.iter().find(|line| line.participant == fresh);
    let line = line.unwrap();
    assert_eq!((line.games, line.score), (1, 5));
    assert!(line.place <= 2);
}

#[test]
fn what_is_level_is_drawn_by_the_seed() {
    let orders: Vec<Vec<usize>> = (0..4)
        .map(|seed| {
            let mut settings = settings(Format::Swiss);
            settings.draw_seed = [seed; 32];
            let tournament = begun(settings, 16);
            assert_eq!(order(&tournament), order(&tournament));
            order(&tournament)
        })
        .collect();
    for (index, one) in orders.iter().enumerate() {
        assert!(!orders[..index].contains(one));
    }
}
