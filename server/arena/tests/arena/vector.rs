//! Games stepped together: each goes as it goes alone, rewards and endings add up to what Shifts say, and the owner's rules are kept.

use std::collections::BTreeMap;
use std::num::{NonZeroU32, NonZeroU64};

use chefshat_arena::vector::{
    Batch, Decisions, Episode, InvalidActions, PlayedGame, Seeds, SetupError, Start, StepError,
    VectorGames, VectorSetup,
};
use chefshat_arena::{AgentKind, BuiltInAgent, Listener, agent_seed, game_seed};
use chefshat_engine::{
    Action, Decision, DecisionKind, Game, Mask, RewardScheme, RuleSet, RuleSetSpec, Script, Seat,
    Stop, Viewer,
};

fn rules() -> RuleSet {
    RuleSetSpec::default().validate().unwrap()
}

fn all_client(games: u32) -> VectorSetup {
    VectorSetup::new(rules(), games, &[None; 4], Seeds::Base(7)).unwrap()
}

fn against(agents: [AgentKind; 3], games: u32) -> VectorSetup {
    let agents = [None, Some(agents[0]), Some(agents[1]), Some(agents[2])];
    VectorSetup::new(rules(), games, &agents, Seeds::Base(7)).unwrap()
}

fn u32s(column: &[u8]) -> Vec<u32> {
    column
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| u32::from_le_bytes(*bytes))
        .collect()
}

fn u64s(column: &[u8]) -> Vec<u64> {
    column
        .as_chunks::<8>()
        .0
        .iter()
        .map(|bytes| u64::from_le_bytes(*bytes))
        .collect()
}

fn f32s(column: &[u8]) -> Vec<f32> {
    column
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect()
}

fn masks(batch: &Batch) -> Vec<Mask> {
    let width = batch.masks.len() / (batch.rows as usize).max(1);
    batch
        .masks
        .chunks(width.max(1))
        .map(|bytes| Mask::from_bytes(bytes).unwrap())
        .collect()
}

/// A policy without a generator: which legal action depends on the step and the row.
fn some_action(mask: &Mask, step: u64, row: usize) -> Action {
    let number = (step.wrapping_mul(31) + row as u64 * 17 + 5).wrapping_mul(0x9e37_79b9) >> 16;
    mask.nth(number as usize % mask.len()).unwrap()
}

fn some_actions(batch: &Batch) -> Vec<Action> {
    (masks(batch).iter().enumerate())
        .map(|(row, mask)| some_action(mask, batch.step, row))
        .collect()
}

/// Plays until all games are over; calls back with every batch.
fn play_out(setup: VectorSetup, mut look: impl FnMut(&VectorGames, &Batch)) -> Vec<PlayedGame> {
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut played = Vec::new();
    for _ in 0..100_000 {
        look(&games, &batch);
        played.append(&mut batch.played);
        if batch.done {
            return played;
        }
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    panic!("the games do not end");
}

#[test]
fn every_game_goes_as_it_goes_alone() {
    let setup = against(
        [
            AgentKind::Greedy,
            AgentKind::Random,
            AgentKind::RandomUnmasked,
        ],
        5,
    )
    .with_total_games(NonZeroU64::new(23))
    .unwrap()
    .with_records(true);
    // The mask, hand and cards left that were shown, and the answer, game by game.
    type Shown = (Mask, Vec<u8>, Vec<u8>, Action);
    let mut rows: BTreeMap<u64, Vec<Shown>> = BTreeMap::new();
    let mut indices: BTreeMap<u32, u64> = BTreeMap::new();
    let played = play_out(setup, |_, batch| {
        for (game, index) in u32s(&batch.beginnings.games)
            .into_iter()
            .zip(u64s(&batch.beginnings.indices))
        {
            indices.insert(game, index);
        }
        let actions = some_actions(batch);
        for (row, (game, mask)) in u32s(&batch.games).iter().zip(masks(batch)).enumerate() {
            let part = |column: &[u8], width: usize| column[row * width..][..width].to_vec();
            let hand = part(&batch.observations.hands, 12);
            let left = part(&batch.observations.cards_left, 4);
            rows.entry(indices[game])
                .or_default()
                .push((mask, hand, left, actions[row]));
        }
    });
    let mut found: Vec<u64> = played.iter().map(|game| game.index).collect();
    found.sort_unstable();
    assert_eq!(found, (0..23).collect::<Vec<_>>(), "each game once");
    for game in &played {
        assert_eq!(game.seed, game_seed(7, game.index));
        assert_eq!(u64::from(game.game), game.index % 5);
        let mut alone = Game::new(rules(), game.seed, |_| {});
        let mut seen = rows[&game.index].iter();
        for taken in &game.decisions {
            let open = alone.decision().unwrap();
            for attempt in &taken.attempts {
                assert!(!alone.legal_actions().contains(*attempt));
            }
            if open.seat == Seat::new(0) {
                let (mask, hand, left, action) = seen.next().unwrap();
                let view = alone.observe(Viewer::Seat(open.seat));
                assert_eq!(*mask, alone.legal_actions());
                assert!(view.hand.counts(11).eq(hand.iter().copied()));
                assert_eq!(view.cards_left.as_slice(), left);
                assert_eq!(*action, taken.action);
            }
            alone.apply(taken.action, |_| {}).unwrap();
        }
        assert!(alone.is_over() && seen.next().is_none());
    }
    let wrong = played.iter().flat_map(|game| &game.decisions);
    assert!(wrong.map(|taken| taken.attempts.len()).sum::<usize>() > 1000);
}

#[test]
fn with_the_owner_as_a_built_in_agent_the_games_are_those_of_a_batch() {
    struct Taken(Vec<Action>);
    impl Listener for Taken {
        fn on_decision(&mut self, _: Decision, action: Action) {
            self.0.push(action);
        }
    }
    let kinds = [
        AgentKind::Random,
        AgentKind::Greedy,
        AgentKind::Random,
        AgentKind::Greedy,
    ];
    let alone = chefshat_arena::Batch::new(rules(), &kinds, 6, 7).unwrap();
    let agents = [None, Some(kinds[1]), None, Some(kinds[3])];
    let setup = VectorSetup::new(rules(), 3, &agents, Seeds::Base(7))
        .unwrap()
        .with_total_games(NonZeroU64::new(6))
        .unwrap()
        .with_records(true);
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut minds: BTreeMap<(u32, usize), BuiltInAgent> = BTreeMap::new();
    let mut played = Vec::new();
    // The owner's agents see the game as the engine shows it, so the games are followed beside.
    let mut tables: BTreeMap<u32, Game> = BTreeMap::new();
    let mut others: BTreeMap<(u32, usize), BuiltInAgent> = BTreeMap::new();
    while !batch.done {
        for (game, index) in u32s(&batch.beginnings.games)
            .into_iter()
            .zip(u64s(&batch.beginnings.indices))
        {
            let seed = game_seed(7, index);
            tables.insert(game, Game::new(rules(), seed, |_| {}));
            for (seat, kind) in kinds.into_iter().enumerate() {
                let mind = BuiltInAgent::new(kind, agent_seed(seed, Seat::new(seat)));
                let whose = if seat % 2 == 0 {
                    &mut minds
                } else {
                    &mut others
                };
                whose.insert((game, seat), mind);
            }
        }
        let mut actions = Vec::new();
        for game in u32s(&batch.games) {
            let table = tables.get_mut(&game).unwrap();
            loop {
                let open = table.decision().unwrap();
                let key = (game, open.seat.index());
                let view = table.observe(Viewer::Seat(open.seat));
                let legal = table.legal_actions();
                if let Some(mind) = minds.get_mut(&key) {
                    let action = mind.decide(&view, &legal);
                    table.apply(action, |_| {}).unwrap();
                    actions.push(action);
                    break;
                }
                let action = others.get_mut(&key).unwrap().decide(&view, &legal);
                table.apply(action, |_| {}).unwrap();
            }
        }
        batch = games.step(&actions).unwrap();
        played.append(&mut batch.played);
    }
    assert_eq!(played.len(), 6);
    for game in played {
        let mut taken = Taken(Vec::new());
        alone.play_game(game.index, &mut taken);
        let actions: Vec<Action> = game.decisions.iter().map(|taken| taken.action).collect();
        assert_eq!(actions, taken.0);
    }
}

#[test]
fn rewards_add_up_to_what_the_shifts_say() {
    for scheme in RewardScheme::ALL {
        for episode in [Episode::Shift, Episode::Game] {
            let setup = all_client(4)
                .with_total_games(NonZeroU64::new(8))
                .unwrap()
                .with_rewards(Some(scheme))
                .with_episode(episode)
                .with_statistics(true)
                .with_invalid_actions(InvalidActions::AskAgain { limit: None });
            let (mut games, mut batch) = VectorGames::new(setup);
            let mut told = [0.0; 4];
            let mut counted = [0.0; 4];
            let mut wrong = 0u64;
            loop {
                for (seat, reward) in batch.seats.iter().zip(f32s(&batch.rewards)) {
                    told[usize::from(*seat)] += f64::from(reward);
                }
                let endings = &batch.endings;
                for (seat, reward) in endings.seats.iter().zip(f32s(&endings.rewards)) {
                    told[usize::from(*seat)] += f64::from(reward);
                }
                for sums in f32s(&batch.shifts.reward_sums).chunks(4) {
                    for (sum, more) in counted.iter_mut().zip(sums) {
                        *sum += f64::from(*more);
                    }
                }
                wrong += u32s(&batch.shifts.wrong)
                    .into_iter()
                    .map(u64::from)
                    .sum::<u64>();
                if batch.done {
                    break;
                }
                // Every fifth answer at a turn is wrong: no card is given there.
                let mut actions = some_actions(&batch);
                for (row, action) in actions.iter_mut().enumerate() {
                    if batch.kinds[row] == 1 && (batch.step + row as u64).is_multiple_of(5) {
                        *action = Action::new(201);
                    }
                }
                batch = games.step(&actions).unwrap();
            }
            assert_eq!(batch.totals.games, 8);
            assert!(wrong > 100 && batch.totals.invalid_attempts == wrong);
            for (told, counted) in told.iter().zip(counted) {
                let close = (told - counted).abs() < 1e-2;
                assert!(close, "{} by {episode:?}: {told} {counted}", scheme.name());
            }
            assert!(told.iter().any(|sum| *sum != 0.0), "{}", scheme.name());
        }
    }
}

#[test]
fn an_episode_ends_for_every_seat_with_what_it_saw_last() {
    // A game of one Shift ends where the same Shift of a longer game does, so its last view is the one wanted.
    let spec = |shifts| RuleSetSpec {
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    };
    let setup = |shifts| {
        let rules = spec(shifts).validate().unwrap();
        VectorSetup::new(rules, 3, &[None; 4], Seeds::Base(3))
            .unwrap()
            .with_rewards(Some(RewardScheme::Points))
            .with_statistics(true)
    };
    let mut endings = Vec::new();
    for shifts in [1, 2] {
        let setup = setup(shifts).with_total_games(NonZeroU64::new(3)).unwrap();
        let (mut games, mut batch) = VectorGames::new(setup);
        let mut first: BTreeMap<u32, String> = BTreeMap::new();
        while first.len() < 3 {
            batch = games.step(&some_actions(&batch)).unwrap();
            let ended = &batch.endings;
            assert_eq!(ended.rows % 4, 0, "one row for each seat");
            for (row, game) in u32s(&ended.games).into_iter().enumerate() {
                let part = |column: &[u8], width: usize| column[row * width..][..width].to_vec();
                let seen = &ended.observations;
                let place = ended.places_taken[row];
                let view = format!(
                    "{:?}",
                    (
                        (
                            ended.seats[row],
                            ended.ends[row],
                            place,
                            part(&ended.rewards, 4)
                        ),
                        (
                            part(&seen.hands, 12),
                            seen.golden[row],
                            part(&seen.boards, 3)
                        ),
                        (
                            part(&seen.cards_left, 4),
                            part(&seen.passed, 4),
                            part(&seen.places, 4)
                        ),
                        (
                            part(&seen.points, 16),
                            part(&seen.played, 12),
                            part(&seen.shifts, 4)
                        ),
                        part(&seen.pizzas, 4),
                    )
                );
                assert_eq!(ended.game_over[row], u8::from(shifts == 1));
                assert_eq!(part(&seen.places, 4)[usize::from(ended.seats[row])], place);
                let points = u32s(&part(&seen.points, 16))[usize::from(ended.seats[row])];
                assert_eq!(points, [5, 3, 1, 0][usize::from(place) - 1]);
                first.entry(game).or_default().push_str(&view);
            }
        }
        endings.push(first);
    }
    assert_eq!(endings[0], endings[1]);
}

#[test]
fn a_game_as_episode_ends_with_the_places_of_the_game() {
    let setup = all_client(2)
        .with_total_games(NonZeroU64::new(4))
        .unwrap()
        .with_episode(Episode::Game)
        .with_records(true);
    let mut ended: BTreeMap<u64, Vec<u8>> = BTreeMap::new();
    let mut indices: BTreeMap<u32, u64> = BTreeMap::new();
    let played = play_out(setup, |_, batch| {
        let endings = &batch.endings;
        for (game, place) in u32s(&endings.games).iter().zip(&endings.places_taken) {
            ended.entry(indices[game]).or_default().push(*place);
        }
        assert!(endings.game_over.iter().all(|over| *over == 1));
        for (game, index) in u32s(&batch.beginnings.games)
            .into_iter()
            .zip(u64s(&batch.beginnings.indices))
        {
            indices.insert(game, index);
        }
    });
    assert_eq!((ended.len(), played.len()), (4, 4));
    for game in played {
        let mut alone = Game::new(rules(), game.seed, |_| {});
        for taken in &game.decisions {
            alone.apply(taken.action, |_| {}).unwrap();
        }
        let standings = alone.standings().unwrap();
        let mut places = vec![0; 4];
        for (place, seat, _) in standings.iter() {
            places[seat.index()] = place;
        }
        assert_eq!(ended[&game.index], places);
    }
}

#[test]
fn an_invalid_action_is_refused_or_asked_again() {
    let (mut games, batch) = VectorGames::new(all_client(2));
    let mut actions = some_actions(&batch);
    actions[1] = Action::new(199);
    let refused = games.step(&actions).unwrap_err();
    assert!(
        matches!(refused, StepError::Illegal { row: 1, game: 1, action, .. } if action == Action::new(199)),
        "{refused}"
    );
    assert!(refused.to_string().contains("action 199 is not legal"));
    assert_eq!(
        games.step(&actions[..1]).unwrap_err(),
        StepError::Actions { given: 1, rows: 2 }
    );
    // Nothing was moved: the right answers are still taken.
    let next = games.step(&some_actions(&batch)).unwrap();
    assert_eq!((next.step, next.totals.decisions), (2, 2));

    let limit = NonZeroU32::new(3);
    let setup = all_client(2)
        .with_rewards(Some(RewardScheme::Validity))
        .with_invalid_actions(InvalidActions::AskAgain { limit });
    let (mut games, batch) = VectorGames::new(setup);
    let opener = batch.seats[1];
    let right = some_actions(&batch)[0];
    let wrong = Action::new(199);
    let first = games.step(&[right, wrong]).unwrap();
    assert_eq!(
        (
            u32s(&first.attempts)[1],
            f32s(&first.rewards)[1],
            first.seats[1]
        ),
        (1, -1.0, opener)
    );
    let other = |batch: &Batch| some_actions(batch)[0];
    let second = games.step(&[other(&first), wrong]).unwrap();
    assert_eq!(
        (u32s(&second.attempts)[1], f32s(&second.rewards)[1]),
        (2, -1.0)
    );
    assert_eq!(u32s(&second.attempts)[0], 0);
    let third = games.step(&[other(&second), wrong]).unwrap();
    assert_ne!(third.seats[1], opener, "the default was taken");
    assert_eq!(third.totals.invalid_attempts, 3);
    assert_eq!(third.totals.decisions, 4);
}

#[test]
fn the_owner_takes_turns_alone_if_it_wants_so() {
    for others in [None, Some(AgentKind::Greedy)] {
        let setup = against([AgentKind::Greedy; 3], 4)
            .with_decisions(Decisions::Turns { others })
            .with_total_games(NonZeroU64::new(12))
            .unwrap()
            .with_records(true);
        let mut rows = 0u64;
        let played = play_out(setup, |_, batch| {
            assert!(batch.kinds.iter().all(|kind| *kind == 1));
            rows += u64::from(batch.rows);
        });
        assert_eq!(played.len(), 12);
        let (mut turns, mut gifts) = (0u64, 0u64);
        for game in played {
            let mut alone = Game::new(rules(), game.seed, |_| {});
            for taken in &game.decisions {
                let open = alone.decision().unwrap();
                if open.seat == Seat::new(0) {
                    turns += u64::from(open.kind == DecisionKind::Turn);
                    if open.kind != DecisionKind::Turn {
                        gifts += 1;
                        let default = alone.default_action().unwrap();
                        assert!(others.is_some() || taken.action == default);
                    }
                }
                alone.apply(taken.action, |_| {}).unwrap();
            }
        }
        assert_eq!(turns, rows);
        assert!(gifts > 0);
    }
}

#[test]
fn forced_decisions_can_be_left_out() {
    let total = |skip| {
        let setup = all_client(3)
            .with_skip_forced(skip)
            .with_total_games(NonZeroU64::new(6))
            .unwrap();
        let mut asked = 0;
        let mut decisions = 0;
        play_out(setup, |_, batch| {
            asked += u64::from(batch.rows);
            decisions = batch.totals.decisions;
            if skip {
                assert!(masks(batch).iter().all(|mask| mask.len() > 1));
            }
        });
        (asked, decisions)
    };
    let (asked, decisions) = total(true);
    assert!(asked < decisions && asked > 100);
    let (asked, decisions) = total(false);
    assert_eq!(asked, decisions);
}

#[test]
fn games_begin_anew_when_asked() {
    let setup = all_client(3);
    let (mut games, first) = VectorGames::new(setup.clone());
    let mut batch = games.step(&some_actions(&first)).unwrap();
    for _ in 0..7 {
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    let some = games.reset_some(&[1]).unwrap();
    assert_eq!(u32s(&some.beginnings.games), [1]);
    assert_eq!(
        u64s(&some.beginnings.indices),
        [4],
        "game 1 goes on with index 1 + 3"
    );
    assert_eq!(some.rows, 3);
    let part = |batch: &Batch, row: usize| batch.observations.hands[row * 12..][..12].to_vec();
    assert_eq!(part(&some, 0), part(&batch, 0));
    assert_ne!(part(&some, 1), part(&batch, 1));
    let again = games.reset(None);
    assert_eq!(u64s(&again.beginnings.indices), [0, 1, 2]);
    assert_eq!(again.observations.hands, first.observations.hands);
    let other = games.reset(Some(Seeds::List(vec![game_seed(7, 2)].into())));
    assert_eq!(part(&other, 0), part(&first, 2));
    assert_eq!(part(&other, 1), part(&first, 2));
    for wrong in [&[3][..], &[1, 1], &[1, 0]] {
        assert!(matches!(
            games.reset_some(wrong).unwrap_err(),
            StepError::Game { last: 2, .. }
        ));
    }
}

#[test]
fn games_begin_with_hands_or_at_a_point() {
    let dealt = Game::new(rules(), game_seed(1, 1), |_| {});
    let script = Script::first_shift(*dealt.hands());
    let setup = all_client(3)
        .with_start(Start::Script(Box::new(script)))
        .unwrap();
    let (_, batch) = VectorGames::new(setup);
    let opener = dealt.decision().unwrap().seat;
    let hand: Vec<u8> = dealt.hands()[opener].counts(11).collect();
    assert_eq!(batch.observations.hands, hand.repeat(3));

    let mut game = dealt;
    while game.shift() < 2 || game.decision().unwrap().kind != DecisionKind::Turn {
        let legal = game.legal_actions();
        game.apply(some_action(&legal, 1, 1), |_| {}).unwrap();
    }
    for (same_deals, differ) in [(true, false), (false, true)] {
        let setup = all_client(2)
            .with_start(Start::Point {
                game: Box::new(game.clone()),
                same_deals,
            })
            .unwrap();
        let (mut games, mut batch) = VectorGames::new(setup);
        let seen: Vec<u8> = game.hands()[game.decision().unwrap().seat]
            .counts(11)
            .collect();
        assert_eq!(batch.observations.hands, seen.repeat(2));
        // Both games are played alike until the next deal, which is one for both, or each game's own.
        while u32s(&batch.observations.shifts) == [2, 2] {
            let action = some_action(&masks(&batch)[0], 1, 1);
            batch = games.step(&[action, action]).unwrap();
        }
        let (one, two) = batch.observations.hands.split_at(12);
        assert_eq!(one != two, differ);
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let kinds = [None; 4];
    let new = |games, agents: &[Option<AgentKind>], seeds| {
        VectorSetup::new(rules(), games, agents, seeds).unwrap_err()
    };
    assert!(matches!(
        new(0, &kinds, Seeds::Base(1)),
        SetupError::Games { .. }
    ));
    assert!(matches!(
        new(4097, &kinds, Seeds::Base(1)),
        SetupError::Games { .. }
    ));
    assert!(VectorSetup::new(rules(), 4096, &kinds, Seeds::Base(1)).is_ok());
    let one = [
        None,
        Some(AgentKind::Random),
        Some(AgentKind::Random),
        Some(AgentKind::Random),
    ];
    assert!(VectorSetup::new(rules(), 16_384, &one, Seeds::Base(1)).is_ok());
    assert!(matches!(
        new(16_385, &one, Seeds::Base(1)),
        SetupError::Games { .. }
    ));
    assert!(matches!(
        new(1, &kinds[..3], Seeds::Base(1)),
        SetupError::Seats {
            given: 3,
            players: 4
        }
    ));
    let nobody = [Some(AgentKind::Random); 4];
    assert_eq!(new(1, &nobody, Seeds::Base(1)), SetupError::NoClient);
    assert_eq!(
        new(1, &kinds, Seeds::List(Vec::new().into())),
        SetupError::NoSeeds
    );
    let few = all_client(3)
        .with_total_games(NonZeroU64::new(2))
        .unwrap_err();
    assert_eq!(few, SetupError::Total { total: 2, games: 3 });
    let dealt = Game::new(rules(), game_seed(1, 1), |_| {});
    let mut hands = *dealt.hands();
    hands[Seat::new(0)] = hands[Seat::new(1)];
    let start = Start::Script(Box::new(Script::first_shift(hands)));
    assert!(matches!(
        all_client(1).with_start(start).unwrap_err(),
        SetupError::Script(_)
    ));
}

#[test]
fn small_hands_do_not_keep_a_step_from_ending() {
    // With three cards in a hand a Shift may end before the owner is asked at all, and many may in a row.
    let rules = RuleSetSpec {
        players: 2,
        faces: 4,
        jokers: 0,
        points: Vec::new(),
        stop: Stop::Shifts(2000),
        ..RuleSetSpec::default()
    }
    .validate()
    .unwrap();
    let setup = VectorSetup::new(rules, 2, &[None, Some(AgentKind::Greedy)], Seeds::Base(5))
        .unwrap()
        .with_skip_forced(true)
        .with_total_games(NonZeroU64::new(2))
        .unwrap();
    let mut shifts = 0;
    let mut before = 0;
    play_out(setup, |_, batch| {
        assert!(batch.totals.shifts - before <= 2 * 9);
        before = batch.totals.shifts;
        shifts = batch.totals.shifts;
    });
    assert_eq!(shifts, 4000);
}
