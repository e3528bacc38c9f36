//! Metrics of a Shift computed by hand, and their sums over games.

use chefshat_engine::{Event, Game, MetricsRecorder, RewardScheme, RuleSetSpec, Seat, Seed, Stop};

use crate::rewards::{TURNS, two_players};
use crate::support::{Chance, act, order};

#[test]
fn a_shift_by_hand() {
    let (rules, mut game) = two_players(10);
    let mut recorder = MetricsRecorder::new(rules, Some(RewardScheme::Paper));
    recorder.wrong(Seat::new(1));
    recorder.wrong(Seat::new(1));
    let mut shifts = Vec::new();
    for text in TURNS {
        shifts.extend(
            act(&mut game, text)
                .iter()
                .filter_map(|event| recorder.on_event(event)),
        );
    }
    let [shift] = shifts[..] else {
        panic!("{shifts:?}")
    };
    assert_eq!(
        (shift.shift, shift.pizzas, shift.laps, shift.turns),
        (1, 3, 3, 6)
    );
    assert_eq!(
        (
            shift.starter,
            shift.starter_won,
            shift.special,
            shift.adjudicated
        ),
        (Seat::new(0), false, None, false)
    );
    assert_eq!(shift.order, order(&[1, 0]));

    let [last, first] = shift.seats.as_slice() else {
        panic!()
    };
    assert_eq!(
        (
            first.place,
            first.points,
            first.valid,
            first.wrong,
            first.passes,
            first.plays
        ),
        (1, 5, 3, 2, 0, 3)
    );
    assert_eq!(
        (
            last.place,
            last.points,
            last.valid,
            last.wrong,
            last.passes,
            last.plays
        ),
        (2, 0, 3, 0, 2, 1)
    );
    assert!((first.performance - 50.0 / 3.0).abs() < 1e-9 && last.performance == 0.0);
    // Two wrong actions at -1, then -0.28, 0 and 0.44; the last seat -0.28 three times and 0.21 at
    // the end.
    assert!((first.reward_sum - (-2.0 - 0.28 + 0.44)).abs() < 1e-6 && first.reward_count == 5);
    assert!((last.reward_sum - (-0.84 + 0.21)).abs() < 1e-6 && last.reward_count == 3);
    assert!((last.mean_reward().unwrap() + 0.21).abs() < 1e-6);
}

#[test]
fn without_a_scheme_there_are_no_rewards() {
    let (rules, mut game) = two_players(3);
    let mut recorder = MetricsRecorder::new(rules, None);
    recorder.wrong(Seat::new(0));
    let events: Vec<Event> = TURNS
        .iter()
        .take(3)
        .flat_map(|text| act(&mut game, text))
        .collect();
    let shift = events
        .iter()
        .find_map(|event| recorder.on_event(event))
        .unwrap();
    assert!(shift.adjudicated);
    for seat in shift.seats.values() {
        assert_eq!(
            (seat.reward_sum, seat.reward_count, seat.mean_reward()),
            (0.0, 0, None)
        );
    }
    assert_eq!(shift.seats[Seat::new(0)].wrong, 1);
}

#[test]
fn counts_agree_with_the_shift_and_restart_with_the_next() {
    let rules = RuleSetSpec {
        stop: Stop::Shifts(6),
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap();
    let mut recorder = MetricsRecorder::new(rules, Some(RewardScheme::Points));
    let mut shifts = Vec::new();
    let mut chance = Chance(5);
    let mut game = Game::new(rules, Seed([5; 32]), |_| {});
    while !game.is_over() {
        let action = chance.legal_action(&game);
        game.apply(action, |event| shifts.extend(recorder.on_event(&event)))
            .unwrap();
    }
    assert_eq!(shifts.len(), 6);
    let mut performance = [0.0; 4];
    for (index, shift) in shifts.iter().enumerate() {
        assert_eq!(
            shift.seats.values().map(|seat| seat.valid).sum::<u32>(),
            shift.turns
        );
        assert_eq!(
            shift.starter_won,
            shift.order.as_slice()[0] == shift.starter
        );
        for (seat, metrics) in shift.seats.iter() {
            assert_eq!(metrics.valid, metrics.plays + metrics.passes);
            assert_eq!(metrics.reward_sum, f64::from(metrics.points));
            performance[seat.index()] += 10.0 * f64::from(metrics.points) / f64::from(shift.pizzas);
            assert!(
                (metrics.performance - performance[seat.index()] / (index + 1) as f64).abs() < 1e-9
            );
        }
    }
    let totals: Vec<u64> = (0..4)
        .map(|s| {
            shifts
                .iter()
                .map(|shift| u64::from(shift.seats[Seat::new(s)].points))
                .sum()
        })
        .collect();
    assert_eq!(game.scores().as_slice(), totals);
}
