//! Histories: complete within their width, and the same in two worlds that a seat cannot tell apart.

use std::cell::Cell;

use chefshat_agents::game_seed;
use chefshat_engine::{Action, BySeat, Cards, Game, Script, Seat, SeatOrder};
use chefshat_simulation::vector::{
    MAX_HISTORY, SetupError, Start, StateError, VectorGames, VectorSetup,
};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::*;

/// Faces of the default deck.
const FACES: u8 = 11;
/// Kind of a gift.
const EXCHANGE: u8 = 2;

/// All columns of the only row, which is of this seat.
fn seen_by(batch: &Batch, seat: u8) -> String {
    assert_eq!(batch.seats, [seat]);
    format!(
        "{:?} {:?} {:?} {:?}",
        batch.observations, batch.masks, batch.kinds, batch.rewards
    )
}

/// One game of the client that begins with these hands.
fn scripted(script: Script, width: u16) -> VectorSetup {
    all_client(1)
        .with_history(width)
        .unwrap()
        .with_start(Start::Script(Box::new(script)))
        .unwrap()
}

/// Moves a joker from one seat to another, which gives its most common card.
fn move_joker(hands: &mut BySeat<Cards>, from: Seat, to: Seat) {
    let jokers = usize::from(FACES);
    let mut counts = [from, to].map(|seat| hands[seat].count_array(FACES));
    // Not of the last face, of which one may be the Golden card.
    let given = (0..jokers - 1).rev().find(|face| counts[1][*face] > 0);
    let given = given.expect("a hand has more cards than the last face");
    for (card, giver, receiver) in [(jokers, 0, 1), (given, 1, 0)] {
        counts[giver][card] -= 1;
        counts[receiver][card] += 1;
    }
    for (seat, counts) in [from, to].into_iter().zip(counts) {
        let golden = hands[seat].has_golden();
        hands[seat] = Cards::from_counts(FACES, &counts[..=jokers], golden).unwrap();
    }
}

/// Steps past special actions, which their seats decline. Returns who did.
fn declined(games: &mut VectorGames, batch: &mut Batch) -> Option<u8> {
    let decline = rules().actions().encode(Action::Decline).unwrap();
    let mut by = None;
    while masks(batch)[0].contains(decline) {
        by = Some(batch.seats[0]);
        *batch = games.step(&[decline]).unwrap();
    }
    by
}

/// What two other seats have otherwise in the second world.
#[derive(Copy, Clone, Debug)]
enum Change {
    /// Each the hand of the other.
    Hands,
    /// Each the hand of the other; one of them has both jokers.
    HandsWithJokers,
    /// One joker each: in the first world one of them has both.
    Joker,
}

/// What two worlds differ in, and how they are played.
#[derive(Clone, Debug)]
struct Worlds {
    seed: u64,
    viewer: u8,
    /// The order of the last Shift; `None` for a first Shift.
    order: Option<[usize; 4]>,
    change: Change,
    width: u16,
    salt: u64,
}

fn worlds() -> impl Strategy<Value = Worlds> {
    let order = prop::option::weighted(0.8, Just([0, 1, 2, 3]).prop_shuffle());
    let changes = prop::sample::select(vec![Change::Hands, Change::HandsWithJokers, Change::Joker]);
    let width = prop::sample::select(vec![1, 8, 20, 64]);
    let salt = any::<u64>();
    (any::<u64>(), 0u8..4, order, changes, width, salt).prop_map(
        |(seed, viewer, order, change, width, salt)| Worlds {
            seed,
            viewer,
            order,
            change,
            width,
            salt,
        },
    )
}

/// The comparisons made.
#[derive(Default, Debug)]
struct Compared {
    all: Cell<u32>,
    /// Those after special actions that other seats declined, in one world or another seat in each.
    declined: Cell<u32>,
    /// Those of them in which the declined one is not kept any more.
    forgotten: Cell<u32>,
}

/// Plays both worlds alike for as long as the viewer cannot know which one it is in, and compares
/// what it sees.
fn compare(worlds: &Worlds, compared: &Compared) -> Result<(), TestCaseError> {
    let &Worlds { viewer, salt, .. } = worlds;
    let others: Vec<usize> = (0..4).filter(|seat| *seat != usize::from(viewer)).collect();
    let one = Seat::new(others[salt as usize % 3]);
    let other = Seat::new(others[(salt as usize + 1) % 3]);
    let mut hands = *Game::new(rules(), game_seed(worlds.seed, 0), |_| {}).hands();
    if !matches!(worlds.change, Change::Hands) {
        for seat in hands.seats().filter(|seat| *seat != one) {
            while hands[seat].jokers() > 0 {
                move_joker(&mut hands, seat, one);
            }
        }
    }
    let mut changed = hands;
    match worlds.change {
        Change::Joker => move_joker(&mut changed, one, other),
        _ => (changed[one], changed[other]) = (hands[other], hands[one]),
    }
    let begin = |hands| {
        let mut script = Script::first_shift(hands);
        if let Some(order) = worlds.order {
            script.shift = 2;
            script.last_order = SeatOrder::from_slice(&order.map(Seat::new));
        }
        VectorGames::new(scripted(script, worlds.width))
    };
    let ((mut first, mut a), (mut second, mut b)) = (begin(hands), begin(changed));
    let by = [declined(&mut first, &mut a), declined(&mut second, &mut b)];
    let hidden = by[0] != by[1];
    for step in 0..80 {
        // Another opening is public.
        if a.seats != b.seats || a.kinds != b.kinds {
            break;
        }
        if a.seats == [viewer] {
            // Its own exchange may have shown it other cards.
            if a.observations.received != b.observations.received {
                break;
            }
            prop_assert_eq!(seen_by(&a, viewer), seen_by(&b, viewer));
            let count = |comparisons: &Cell<u32>, is_one| {
                comparisons.set(comparisons.get() + u32::from(is_one));
            };
            let entries = u32s(&a.observations.history_counts)[0];
            count(&compared.all, true);
            count(&compared.declined, hidden);
            // At least 17 entries are kept.
            let kept = u32::from(worlds.width.max(16)) + 1;
            count(&compared.forgotten, hidden && entries > kept);
        }
        let allowed = masks(&b)[0];
        let common: Vec<_> = (masks(&a)[0].iter())
            .filter(|action| allowed.contains(*action))
            .collect();
        if common.is_empty() {
            break;
        }
        let action = common[(salt.wrapping_add(step * 7919) % common.len() as u64) as usize];
        a = first.step(&[action]).unwrap();
        b = second.step(&[action]).unwrap();
        if u32s(&a.observations.shifts) != u32s(&b.observations.shifts) || a.endings.rows > 0 {
            break;
        }
    }
    Ok(())
}

#[test]
fn a_seat_cannot_tell_hidden_cards_apart() {
    let compared = Compared::default();
    let config = ProptestConfig {
        cases: 1024,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let found = TestRunner::new(config).run(&worlds(), |worlds| compare(&worlds, &compared));
    if let Err(error) = found {
        panic!("{error}");
    }
    let Compared {
        all,
        declined,
        forgotten,
    } = &compared;
    let enough = all.get() > 2000 && declined.get() > 800 && forgotten.get() > 400;
    assert!(enough, "{compared:?}");
}

#[test]
fn a_receiver_does_not_learn_which_card_was_given_first() {
    let (mut givers, mut receivers) = (0, 0);
    for (seed, width) in (0..20).flat_map(|seed| [(seed, 3), (seed, 5), (seed, 30)]) {
        let setup = || {
            let setup = VectorSetup::new(rules(), 1, &[None; 4], Seeds::Base(seed)).unwrap();
            setup.with_history(width).unwrap()
        };
        let ((mut first, mut a), (mut second, mut b)) =
            (VectorGames::new(setup()), VectorGames::new(setup()));
        while a.kinds != [EXCHANGE] {
            let actions = some_actions(&a);
            (a, b) = (
                first.step(&actions).unwrap(),
                second.step(&actions).unwrap(),
            );
        }
        let chef = a.seats[0];
        let gifts = masks(&a)[0];
        let (low, high) = (gifts.nth(0).unwrap(), gifts.nth(1).unwrap());
        for gifts in [(low, high), (high, low)] {
            (a, b) = (
                first.step(&[gifts.0]).unwrap(),
                second.step(&[gifts.1]).unwrap(),
            );
        }
        for _ in 0..20 {
            assert_eq!(a.seats, b.seats);
            let all = [&a, &b].map(|batch| seen_by(batch, a.seats[0]));
            if a.seats == [chef] {
                givers += u32::from(all[0] != all[1]);
            } else {
                assert_eq!(all[0], all[1]);
                receivers += u32::from(!a.observations.received.iter().all(|count| *count == 0));
            }
            let actions = some_actions(&a);
            (a, b) = (
                first.step(&actions).unwrap(),
                second.step(&actions).unwrap(),
            );
        }
    }
    assert!(givers > 20 && receivers > 20, "{givers}, {receivers}");
}

#[test]
fn too_wide_histories_are_refused() {
    let error = all_client(1).with_history(MAX_HISTORY + 1).unwrap_err();
    assert_eq!(error, SetupError::History(MAX_HISTORY + 1));
    assert!(error.to_string().contains("choose at most 1024"));
    assert!(all_client(1).with_history(MAX_HISTORY).is_ok());
}

#[test]
fn a_history_counts_all_actions_of_the_shift() {
    let setup = all_client(2).with_history(3).unwrap();
    let (mut games, mut batch) = VectorGames::new(setup);
    for step in 0..12 {
        assert_eq!(u32s(&batch.observations.history_counts), [step; 2]);
        let (entries, _) = batch.observations.history.as_chunks::<2>();
        for row in entries.chunks(3) {
            let zeros = row.iter().filter(|entry| **entry == [0, 0]).count();
            assert_eq!(zeros, 3usize.saturating_sub(step as usize));
        }
        batch = games.step(&some_actions(&batch)).unwrap();
    }
}

#[test]
fn a_state_has_all_actions_of_its_shift_or_says_that_it_has_not() {
    let seen = |games: &VectorGames| games.save(&[0]).unwrap()[0].seen();
    let decline = rules().actions().encode(Action::Decline).unwrap();
    let mut within = 0;
    for seed in 0..4 {
        let setup = VectorSetup::new(rules(), 1, &[None; 4], Seeds::Base(seed)).unwrap();
        let (mut dealt, mut batch) = VectorGames::new(setup.clone().with_history(512).unwrap());
        let (mut narrow, _) = VectorGames::new(setup.with_history(1).unwrap());
        let mut game = Game::new(rules(), game_seed(seed, 0), |_| {});
        let (mut shift, mut done) = (0, 0);
        while game.shift() < 4 && batch.rows > 0 {
            if game.shift() != shift {
                (shift, done) = (game.shift(), 0);
            }
            assert!(seen(&dealt).is_ok());
            // Some entries are always kept.
            assert!(done < 100 || seen(&narrow).is_err());
            let start = Start::Point {
                game: Box::new(game.clone()),
                same_deals: true,
            };
            let setup = all_client(1).with_history(512).unwrap();
            let (branch, _) = VectorGames::new(setup.with_start(start).unwrap());
            match seen(&branch) {
                Ok(_) => assert_eq!(done, 0),
                Err(error) => {
                    assert_eq!(error, StateError::HistoryTooShort);
                    assert!(done > 0);
                    within += 1;
                }
            }
            let actions = some_actions(&batch);
            done += u32::from(actions[0] != decline);
            game.apply(actions[0], |_| {}).unwrap();
            batch = dealt.step(&actions).unwrap();
            narrow.step(&actions).unwrap();
        }
    }
    assert!(within > 200, "{within}");
}
