//! Complete states: a restored game continues as the saved one would, anywhere; other bytes are
//! refused.

use std::num::{NonZeroU32, NonZeroU64};

use chefshat_agents::{AgentKind, BuiltInAgent};
use chefshat_engine::{Opening, PassScope, RewardScheme, RuleSet, RuleSetSpec, Stop, Viewer};
use chefshat_simulation::vector::{
    Batch, Decisions, Episode, InvalidActions, SavedGame, Seeds, SetupError, Start, StateError,
    StepError, VectorGames, VectorSetup,
};
use proptest::prelude::*;
use proptest::sample::select;

use super::*;

const AGENTS: [Option<AgentKind>; 5] = [
    None,
    None,
    Some(AgentKind::Random),
    Some(AgentKind::RandomUnmasked),
    Some(AgentKind::Greedy),
];

/// Any rules of short games.
fn any_rules() -> impl Strategy<Value = RuleSet> {
    let numbers = (2u8..=6, 4u8..=15, 0u8..=2, 1u32..5);
    let limits = (1u32..4, prop_oneof![1u32..120, Just(10_000)]);
    (numbers, any::<[bool; 6]>(), limits).prop_filter_map(
        "a hand needs three cards",
        |((players, faces, jokers, target), flags, (max_idle_pizzas, max_turns))| {
            let [exchange, special_actions, top, opening_pass, turn, shifts] = flags;
            let spec = RuleSetSpec {
                players,
                faces,
                jokers,
                stop: match shifts {
                    true => Stop::Shifts(target),
                    false => Stop::Points(3 * target),
                },
                points: Vec::new(),
                exchange,
                special_actions,
                opening: [Opening::Golden, Opening::AnyTopFace][usize::from(top)],
                opening_pass,
                pass_scope: [PassScope::Pizza, PassScope::Turn][usize::from(turn)],
                max_idle_pizzas,
                max_turns,
            };
            spec.validate().ok()
        },
    )
}

/// Any setup with a few games.
fn any_setup() -> impl Strategy<Value = VectorSetup> {
    let agents = prop::collection::vec(select(&AGENTS[..]), 6);
    let schemes = prop::option::of(select(&RewardScheme::ALL[..]));
    let others = select(&AGENTS[..]);
    let options = (others, prop::option::of(1u32..4), any::<[bool; 6]>());
    let numbers = (1u32..5, any::<u64>(), prop::option::of(0u64..4));
    (any_rules(), agents, schemes, options, numbers).prop_map(
        |(rules, mut agents, scheme, (others, limit, flags), (games, seed, more))| {
            let [by_game, turns, skip, ask, statistics, records] = flags;
            agents.truncate(rules.players());
            agents[0] = None;
            let total = more.and_then(|more| NonZeroU64::new(u64::from(games) + more));
            VectorSetup::new(rules, games, &agents, Seeds::Base(seed))
                .unwrap()
                .with_total_games(total)
                .unwrap()
                .with_rewards(scheme)
                .with_episode([Episode::Shift, Episode::Game][usize::from(by_game)])
                .with_decisions(match turns {
                    true => Decisions::Turns { others },
                    false => Decisions::All,
                })
                .with_skip_forced(skip)
                .with_invalid_actions(match ask {
                    true => InvalidActions::AskAgain {
                        limit: limit.and_then(NonZeroU32::new),
                    },
                    false => InvalidActions::Error,
                })
                .with_statistics(statistics)
                .with_records(records)
                .with_history([0, 5, 40][(seed % 3) as usize])
                .unwrap()
        },
    )
}

/// Actions for a batch: legal, and sometimes illegal where they are asked again.
fn actions(setup: &VectorSetup, batch: &Batch, salt: u64) -> Vec<ActionId> {
    let asks = setup.invalid_actions() != InvalidActions::Error;
    let size = setup.rules().actions().size();
    let masks = masks(batch);
    let rows = masks.iter().enumerate();
    rows.map(|(row, mask)| {
        let action = some_action(mask, salt, row);
        let wrong = asks && (salt + row as u64).is_multiple_of(4);
        let other = ActionId::new((action.index() + 1) % size);
        if wrong { other } else { action }
    })
    .collect()
}

/// Plays some steps and returns the batches, without what counts since the games were created.
fn play_on(games: &mut VectorGames, mut batch: Batch, steps: u64) -> Vec<Batch> {
    let mut seen = Vec::new();
    for salt in 0..steps {
        if batch.done {
            break;
        }
        let chosen = actions(games.setup(), &batch, salt);
        batch = games.step(&chosen).unwrap();
        let mut shown = batch.clone();
        (shown.step, shown.totals) = (0, Default::default());
        seen.push(shown);
    }
    seen
}

fn all(setup: &VectorSetup) -> Vec<u32> {
    (0..setup.games()).collect()
}

fn through_bytes(states: &[SavedGame]) -> Vec<SavedGame> {
    let bytes = states.iter().map(SavedGame::to_bytes);
    bytes
        .map(|bytes| SavedGame::from_bytes(&bytes).unwrap())
        .collect()
}

/// Games of a setup after some steps, with the last batch.
fn begun(setup: &VectorSetup, steps: u64) -> (VectorGames, Batch) {
    let (mut games, mut batch) = VectorGames::new(setup.clone());
    for salt in 0..steps {
        if batch.done {
            break;
        }
        let chosen = actions(setup, &batch, salt * 7 + 1);
        batch = games.step(&chosen).unwrap();
    }
    (games, batch)
}

/// Bytes with a changed content and the right checksum.
fn damaged(bytes: &[u8], at: usize, change: u8) -> Vec<u8> {
    let mut bytes = bytes[..bytes.len() - 4].to_vec();
    let at = at % bytes.len();
    bytes[at] = bytes[at].wrapping_add(change);
    let checksum = crc32fast::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 96,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn restored_games_continue_identically(setup in any_setup(), before in 0u64..150) {
        let (mut games, batch) = begun(&setup, before);
        let states = games.save(&all(&setup)).unwrap();
        let bytes: Vec<_> = states.iter().map(SavedGame::to_bytes).collect();
        let expected = play_on(&mut games, batch.clone(), 80);
        let rows = |batch: &Batch| (batch.games.clone(), batch.rewards.clone(), batch.masks.clone());

        // Into the same games.
        let again = games.restore(&all(&setup), states).unwrap();
        prop_assert_eq!(rows(&again), rows(&batch));
        prop_assert!(again.beginnings.rows == 0 && again.endings.rows == 0);
        prop_assert_eq!(&play_on(&mut games, again, 80), &expected);

        // Into other games, from bytes.
        let read = bytes.iter().map(|bytes| SavedGame::from_bytes(bytes).unwrap()).collect();
        let (mut other, _) = begun(&setup, before / 3);
        let again = other.restore(&all(&setup), read).unwrap();
        prop_assert_eq!(&again.observations, &batch.observations);
        let saved = other.save(&all(&setup)).unwrap();
        prop_assert_eq!(saved.iter().map(SavedGame::to_bytes).collect::<Vec<_>>(), bytes);
        prop_assert_eq!(&play_on(&mut other, again, 80), &expected);
    }

    #[test]
    fn copies_play_as_the_original(setup in any_setup(), before in 0u64..100) {
        let (mut games, batch) = begun(&setup, before);
        prop_assume!(batch.rows > 0);
        let game = u32s(&batch.games)[0];
        let (mut copies, first) = games.fork(&[game], 3, None).unwrap();
        prop_assert_eq!(first.rows, 3);
        let one = batch.observations.hands.len() / batch.rows as usize;
        prop_assert_eq!(&first.observations.hands, &batch.observations.hands[..one].repeat(3));
        // The same action in all of them, until an episode ends.
        let mut original = batch;
        let mut copied = first;
        for salt in 0..60 {
            let row = u32s(&original.games).iter().position(|of| *of == game);
            let Some(row) = row.filter(|_| copied.rows == 3) else { break };
            let mut chosen: Vec<_> = masks(&original).iter().map(|mask| mask.nth(0).unwrap()).collect();
            chosen[row] = some_action(&masks(&original)[row], salt, 0);
            copied = copies.step(&[chosen[row]; 3]).unwrap();
            original = games.step(&chosen).unwrap();
            // The first end of an episode. After the end of a game others follow than copies.
            let seats = setup.client_seats().count();
            let first_end = |batch: &Batch, of: u32| {
                let games = u32s(&batch.endings.games);
                let row = games.iter().position(|game| *game == of)?;
                Some(batch.endings.places_taken[row..row + seats].to_vec())
            };
            let ended = first_end(&original, game);
            for copy in 0..3 {
                prop_assert_eq!(&first_end(&copied, copy), &ended);
            }
            if original.endings.rows > 0 {
                break;
            }
            let row = u32s(&original.games).iter().position(|of| *of == game);
            if let Some(row) = row {
                prop_assert_eq!(&copied.seats, &vec![original.seats[row]; 3]);
                let masks = masks(&original);
                prop_assert!(super::masks(&copied).iter().all(|mask| *mask == masks[row]));
            }
        }
    }

    #[test]
    fn changed_bytes_are_refused_or_are_games(
        setup in any_setup(),
        before in 0u64..60,
        changes in prop::collection::vec((any::<usize>(), 1u8..), 24),
    ) {
        let (games, _) = begun(&setup, before);
        let bytes = games.save(&[0]).unwrap()[0].to_bytes();
        for (at, change) in changes {
            // Damage is found by the checksum.
            let mut broken = bytes.clone();
            let place = at % broken.len();
            broken[place] = broken[place].wrapping_add(change);
            prop_assert!(SavedGame::from_bytes(&broken).is_err());
            prop_assert!(SavedGame::from_bytes(&bytes[..place]).is_err());
            // Forged bytes are not.
            let forged = damaged(&bytes, at, change);
            if let Ok(state) = SavedGame::from_bytes(&forged) {
                prop_assert_eq!(state.to_bytes(), forged);
                let (mut games, _) = VectorGames::new(setup.clone());
                if let Ok(batch) = games.restore(&[0], vec![state]) {
                    play_on(&mut games, batch, 200);
                }
            }
        }
    }
}

#[test]
fn others_continue_a_game() {
    let alone = |agents| against(agents, 1).with_rewards(Some(RewardScheme::Points));
    let (mut games, mut batch) = VectorGames::new(alone([AgentKind::Greedy; 3]));
    while batch.totals.shifts < 8 || batch.observations.places.contains(&1) {
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    let states = games.save(&[0]).unwrap();
    let bytes = states[0].to_bytes();

    // The client plays all seats of it for a while, and what it did not play comes back as it was.
    let all = all_client(1).with_rewards(Some(RewardScheme::Points));
    let (mut others, _) = VectorGames::new(all.clone());
    let there = others.restore(&[0], states.clone()).unwrap();
    assert_eq!(
        (&there.masks, &there.rewards),
        (&batch.masks, &batch.rewards)
    );
    let back = others.save(&[0]).unwrap();
    let here = games.restore(&[0], back).unwrap();
    assert_eq!(here.masks, batch.masks);
    assert_eq!(games.save(&[0]).unwrap()[0].to_bytes(), bytes);

    // What the agents would have been rewarded for is not the client's.
    let mut next = others.restore(&[0], states.clone()).unwrap();
    let mut decided = 0;
    while next.endings.rows == 0 {
        assert_eq!(f32s(&next.rewards), [0.0]);
        next = others.step(&some_actions(&next)).unwrap();
        decided += 1;
    }
    assert!(decided > 4, "{decided}");

    // Where the client's seat is an agent's, the game continues to the next decision of the client.
    let agents = [Some(AgentKind::Greedy), None, Some(AgentKind::Greedy), None];
    let setup = VectorSetup::new(rules(), 1, &agents, Seeds::Base(9)).unwrap();
    let (mut seats, _) = VectorGames::new(setup.with_rewards(Some(RewardScheme::Points)));
    let taken = seats.restore(&[0], states.clone()).unwrap();
    let expected = {
        // `greedy` decides alike in a game of the client's, by its observation alone.
        let (mut games, _) = VectorGames::new(all.clone());
        games.restore(&[0], states.clone()).unwrap();
        let mut agent = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
        loop {
            let saved = games.save(&[0]).unwrap();
            let game = saved[0].game().unwrap();
            let seat = game.decision().unwrap().seat;
            if agents[seat.index()].is_none() {
                break game.legal_actions();
            }
            let observation = game.observe(Viewer::Seat(seat));
            let action = agent.decide(&observation, &game.legal_actions());
            games.step(&[action]).unwrap();
        }
    };
    assert_eq!(masks(&taken), [expected]);

    // The random numbers of an agent that stays continue; those of a new one begin.
    let random = [AgentKind::Random, AgentKind::Greedy, AgentKind::Greedy];
    let (mut some, _) = VectorGames::new(alone(random));
    let mut batch = some.restore(&[0], states.clone()).unwrap();
    for _ in 0..5 {
        batch = some.step(&some_actions(&batch)).unwrap();
    }
    let saved = some.save(&[0]).unwrap();
    let (mut again, _) = VectorGames::new(alone(random));
    again.restore(&[0], saved.clone()).unwrap();
    let mixed = alone([AgentKind::Random, AgentKind::Random, AgentKind::Greedy]);
    let (mut mixed, _) = VectorGames::new(mixed);
    mixed.restore(&[0], saved.clone()).unwrap();
    assert_eq!(again.save(&[0]).unwrap()[0].to_bytes(), saved[0].to_bytes());
    let both_ways = mixed.save(&[0]).unwrap();
    again.restore(&[0], both_ways).unwrap();
    assert_eq!(again.save(&[0]).unwrap()[0].to_bytes(), saved[0].to_bytes());
    let forks = Start::Saved {
        games: saved.into(),
        same_deals: true,
    };
    let (mut forks, first) = VectorGames::new(all.with_start(forks).unwrap());
    assert_eq!(first.masks, batch.masks);
    forks.step(&some_actions(&first)).unwrap();

    // A record would name the wrong agents.
    let recorded = |setup: VectorSetup| VectorGames::new(setup.with_records(true)).0;
    let states = recorded(all_client(1)).save(&[0]).unwrap();
    let error = recorded(against([AgentKind::Greedy; 3], 1)).restore(&[0], states);
    let expected = "list of seats: \"client, client, client, client\", here \"client, greedy, greedy, greedy\"";
    let error = error.unwrap_err().to_string();
    assert!(error.contains(expected), "{error}");
}

#[test]
fn states_of_other_setups_are_refused_by_what_differs() {
    let (games, _) = begun(&all_client(2), 5);
    let states = games.save(&[0]).unwrap();
    let rules = |change: fn(&mut RuleSetSpec)| {
        let mut spec = RuleSetSpec::default();
        change(&mut spec);
        let rules = spec.validate().unwrap();
        let agents = vec![None; rules.players()];
        VectorSetup::new(rules, 2, &agents, Seeds::Base(7)).unwrap()
    };
    let cases = [
        (
            rules(|spec| spec.players = 5),
            "number of players: 4, here 5",
        ),
        (rules(|spec| spec.faces = 9), "number of faces: 11, here 9"),
        (
            rules(|spec| spec.stop = Stop::Shifts(3)),
            "target: Points(15), here Shifts(3)",
        ),
        (rules(|spec| spec.max_turns = 9), "max_turns: 10000, here 9"),
        (
            all_client(2).with_rewards(Some(RewardScheme::Winning)),
            "reward scheme: \"none\", here \"winning\"",
        ),
        (
            all_client(2).with_statistics(true),
            "shift_statistics: false, here true",
        ),
        (
            all_client(2).with_records(true),
            "records: false, here true",
        ),
    ];
    for (setup, expected) in cases {
        let (mut other, _) = VectorGames::new(setup);
        let error = other.restore(&[1], states.clone()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    // Episodes, seeds and the number of games do not matter.
    let setup = all_client(9)
        .with_episode(Episode::Game)
        .with_seeds(Seeds::Base(8));
    let (mut other, _) = VectorGames::new(setup);
    assert!(other.restore(&[8], states).is_ok());
}

#[test]
fn wrong_games_and_counts_are_refused() {
    let (mut games, before) = begun(&all_client(3), 4);
    let states = games.save(&[2, 0]).unwrap();
    let none = StepError::NoGame { game: 3, last: 2 };
    assert_eq!(games.save(&[3]).unwrap_err(), none);
    let cases = [
        (
            &[0u32][..],
            StateError::Count {
                games: 1,
                states: 2,
            },
        ),
        (&[1, 3], none.into()),
        (&[1, 1], StepError::Order { game: 1 }.into()),
    ];
    for (chosen, expected) in cases {
        assert_eq!(games.restore(chosen, states.clone()).unwrap_err(), expected);
    }
    let unchanged = games.step(&some_actions(&before)).unwrap();
    assert_eq!(unchanged.rows, 3);
    let error = SavedGame::from_bytes(b"chefsave\x02\x00----").unwrap_err();
    assert_eq!(error, StateError::Version(2));
    assert!(error.to_string().contains("format version 2"));
}

#[test]
fn forged_decisions_are_refused() {
    let setup = all_client(1).with_records(true);
    let (mut games, batch) = begun(&setup, 12);
    let mut bytes = games.save(&[0]).unwrap()[0].to_bytes();
    let kept = games.restore(&[0], through_bytes(&games.save(&[0]).unwrap()));
    assert_eq!(kept.unwrap().masks, batch.masks);
    // The last decision: its action, whether by default, and no attempts.
    let at = bytes.len() - 4 - 7;
    bytes = damaged(&bytes, at, 1);
    let forged = SavedGame::from_bytes(&bytes).unwrap();
    let error = games.restore(&[0], vec![forged]).unwrap_err();
    assert_eq!(error, StateError::Record);
}

#[test]
fn a_fork_with_seeds_keeps_the_cards_and_changes_what_is_dealt_later() {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    let random = Some(AgentKind::Random);
    let agents = [None, random, random, random];
    let setup = VectorSetup::new(spec.validate().unwrap(), 2, &agents, Seeds::Base(3)).unwrap();
    let setup = setup.with_total_games(NonZeroU64::new(2)).unwrap();
    let (games, _) = begun(&setup, 3);
    let second_hands = |seeds| {
        let (mut copies, mut batch) = games.fork(&[1, 0], 4, seeds).unwrap();
        assert_eq!(batch.beginnings.rows, 8);
        let width = 12;
        let first: Vec<_> = batch
            .observations
            .hands
            .chunks(width)
            .map(<[u8]>::to_vec)
            .collect();
        let mut second = vec![Vec::new(); 8];
        while !batch.done {
            let games = u32s(&batch.games);
            let shifts = u32s(&batch.observations.shifts);
            for (row, hand) in batch.observations.hands.chunks(width).enumerate() {
                let dealt = &mut second[games[row] as usize];
                if shifts[row] == 2 && dealt.is_empty() {
                    dealt.extend_from_slice(hand);
                }
            }
            let masks = masks(&batch);
            let firsts = masks.iter().map(|mask| mask.nth(0).unwrap());
            batch = copies.step(&firsts.collect::<Vec<_>>()).unwrap();
        }
        assert_eq!(batch.totals.games, 8, "no game follows a copy");
        (first, second)
    };
    let distinct = |hands: &[Vec<u8>]| {
        let mut hands = hands.to_vec();
        hands.sort();
        hands.dedup();
        hands.len()
    };
    let (first, second) = second_hands(None);
    assert_eq!(first[0], first[2]);
    assert_eq!((distinct(&first), distinct(&second)), (2, 2));
    let (seeded, second) = second_hands(Some(Seeds::Base(11)));
    assert_eq!(seeded, first);
    assert_eq!(distinct(&second), 8);
    assert_eq!(second_hands(Some(Seeds::Base(11))).1, second);

    let error = games.fork(&[0], 0, None).unwrap_err();
    assert_eq!(error, SetupError::NoGames);
    let over = {
        let (mut games, mut batch) = VectorGames::new(setup.clone());
        while !batch.done {
            batch = games.step(&some_actions(&batch)).unwrap();
        }
        games.fork(&[0], 1, None).unwrap_err().to_string()
    };
    assert!(over.contains("is over"), "{over}");
    let missing = games.fork(&[7], 1, None).unwrap_err().to_string();
    assert!(missing.starts_with("game 7 does not exist"), "{missing}");
    let recorded = Start::Saved {
        games: games.save(&[0]).unwrap().into(),
        same_deals: true,
    };
    let recorded = setup.clone().with_records(true).with_start(recorded);
    assert_eq!(recorded.unwrap_err(), SetupError::SavedRecords);
    let none: Vec<SavedGame> = Vec::new();
    let empty = Start::Saved {
        games: none.into(),
        same_deals: true,
    };
    assert_eq!(setup.with_start(empty).unwrap_err(), SetupError::NoSaved);
}
