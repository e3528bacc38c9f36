//! Histories: complete within their width, and the same in two worlds that a seat cannot tell apart.

use chefshat_agents::game_seed;
use chefshat_engine::{Game, Script, Seat, SeatOrder};
use chefshat_simulation::vector::{MAX_HISTORY, SetupError, Start, VectorGames, VectorSetup};
use proptest::prelude::*;

use super::*;

/// The rows of a seat, with all columns of its observations.
fn seen_by(batch: &Batch, seat: u8) -> Option<String> {
    let row = batch.seats.iter().position(|of| *of == seat)?;
    assert_eq!(batch.rows, 1);
    assert_eq!(row, 0);
    Some(format!(
        "{:?} {:?} {:?} {:?}",
        batch.observations, batch.masks, batch.kinds, batch.rewards
    ))
}

/// One game of the client that begins with these hands.
fn scripted(script: Script) -> VectorSetup {
    all_client(1)
        .with_history(64)
        .unwrap()
        .with_start(Start::Script(Box::new(script)))
        .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_seat_cannot_tell_hidden_cards_apart(
        seed in any::<u64>(), viewer in 0u8..4, order in Just([0, 1, 2, 3]).prop_shuffle(),
        salt in any::<u64>(), later in any::<bool>(),
    ) {
        let hands = *Game::new(rules(), game_seed(seed, 0), |_| {}).hands();
        // Two others change hands, jokers included.
        let others: Vec<usize> = (0..4).filter(|seat| *seat != usize::from(viewer)).collect();
        let (one, other) = (Seat::new(others[salt as usize % 3]), Seat::new(others[(salt as usize + 1) % 3]));
        let mut changed = hands;
        changed[one] = hands[other];
        changed[other] = hands[one];
        let script = |hands| {
            let mut script = Script::first_shift(hands);
            if later {
                script.shift = 2;
                script.last_order = SeatOrder::from_slice(&order.map(Seat::new));
            }
            script
        };
        let (mut first, mut a) = VectorGames::new(scripted(script(hands)));
        let (mut second, mut b) = VectorGames::new(scripted(script(changed)));
        // The viewer's own exchange shows it other cards, and another opening is public.
        let mut told = false;
        for step in 0..80 {
            let pair = (masks(&a)[0], masks(&b)[0]);
            if a.seats != b.seats || a.kinds != b.kinds {
                break;
            }
            let received = |batch: &Batch| batch.observations.received.clone();
            if a.seats == [viewer] && received(&a) == received(&b) {
                prop_assert_eq!(seen_by(&a, viewer), seen_by(&b, viewer));
                told = true;
            } else if a.seats == [viewer] {
                break;
            }
            let common: Vec<_> = pair.0.iter().filter(|action| pair.1.contains(*action)).collect();
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
        prop_assume!(told);
    }
}

#[test]
fn too_wide_histories_are_refused() {
    let error = all_client(1).with_history(MAX_HISTORY + 1).unwrap_err();
    assert_eq!(error, SetupError::History(MAX_HISTORY + 1));
    assert!(error.to_string().contains("choose at most 1024"));
    assert!(all_client(4096).with_history(32).is_ok());
    let error = all_client(4096).with_history(33).unwrap_err();
    assert_eq!(error, SetupError::History(33));
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
