//! Games: which condition, seed and seat each has.

use std::collections::BTreeSet;

use chefshat_study::testing::{settings, within};
use chefshat_study::{DueGame, MAX_ATTEMPTS, Outcome, Stage, Task};

use super::support::Lab;

fn counted(games: Vec<DueGame>) -> Vec<DueGame> {
    games.into_iter().filter(|game| !game.practice).collect()
}

#[test]
fn all_participants_meet_the_same_deals_in_the_same_seats() {
    for conditions in 1..=5 {
        let mut lab = Lab::new(within(conditions), 12);
        let mut orders = BTreeSet::new();
        for number in 1..=12 {
            let games = counted(lab.complete(number));
            let deals: Vec<_> = games.iter().map(|game| (game.seed, game.seat)).collect();
            let expected = (0..2 * conditions).map(|k| (Some((k % 3, [(k % 3) as u8; 32])), k % 4));
            assert_eq!(deals, expected.collect::<Vec<_>>());
            let order: Vec<_> = games.iter().map(|game| game.condition).collect();
            assert!(order.chunks(2).all(|pair| pair[0] == pair[1]));
            orders.insert(order);
        }
        assert_eq!(orders.len(), lab.study.settings().sequences().len().min(12));
    }
}

#[test]
fn a_condition_counts_its_own_seeds_for_itself() {
    let mut settings = within(2);
    settings.conditions[1].seeds = vec![[9; 32], [8; 32], [7; 32]];
    settings.conditions[1].participant_seat = Some(3);
    let mut lab = Lab::new(settings, 2);
    for number in 1..=2 {
        for game in counted(lab.complete(number)) {
            let (index, seed) = game.seed.unwrap();
            if game.condition == 1 {
                assert_eq!((seed, game.seat), ([9 - index as u8; 32], 3));
                assert!(index < 2);
            } else {
                assert_eq!(seed, [index as u8; 32]);
            }
        }
    }
}

#[test]
fn practice_reveals_no_condition_outside_blocks() {
    let mut settings = settings();
    settings.stages = vec![
        Stage::once(Task::Practice { in_data: true }),
        Stage::per_condition(vec![
            Task::Practice { in_data: false },
            Task::Games { count: 1 },
        ]),
    ];
    let mut lab = Lab::new(settings, 8);
    for number in 1..=8 {
        let games = lab.complete(number);
        let slot = lab.participant(number).slot.unwrap();
        let own = lab.study.sequence(slot)[0];
        let conditions: Vec<_> = games.iter().map(|game| game.condition).collect();
        assert_eq!(conditions, [0, own, own]);
        let practice: Vec<_> = games.iter().map(|game| game.practice).collect();
        assert_eq!(practice, [true, true, false]);
        assert!(
            games[..2]
                .iter()
                .all(|game| game.seed.is_none() && game.seat == 0)
        );
    }
}

#[test]
fn a_game_without_a_result_is_played_again() {
    let mut lab = Lab::new(within(1), 1);
    lab.open(1).unwrap();
    for _ in 0..4 {
        lab.act(1);
    }
    for attempt in 1..=MAX_ATTEMPTS {
        let due = lab.study.due(1).unwrap();
        assert_eq!(
            (due.attempt, due.seed, due.seat),
            (attempt, Some((0, [0; 32])), 0)
        );
        let placed = lab.place(1);
        lab.fold_all(placed);
        assert!(lab.study.due(1).is_none() && lab.study.place(1, [0; 16], [0; 16]).is_empty());
        assert!(
            lab.study
                .game_ended(1, [77; 16], Outcome::Finished, 0)
                .is_none()
        );
        let ended = lab.ended(1, Outcome::Aborted);
        lab.fold(ended);
    }
    // After the last attempt the participant is not kept waiting.
    assert!(lab.study.due(1).is_none());
    lab.act(1);
    let due = lab.study.due(1).unwrap();
    assert_eq!(
        (due.attempt, due.seed, due.seat),
        (1, Some((1, [1; 32])), 1)
    );
}
