//! Episodes: rewards, final observations, places.

use std::collections::BTreeMap;
use std::num::NonZeroU64;

use chefshat_agents::{AgentKind, BuiltInAgent, game_seed};
use chefshat_engine::{ActionId, Game, RewardScheme, RuleSetSpec, Seat, Stop, Viewer};
use chefshat_simulation::vector::{
    Episode, InvalidActions, Seeds, Situation, Start, VectorGames, VectorSetup,
};

use super::*;

#[test]
fn rewards_add_up_to_the_statistics() {
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
            // By game and seat, within the running episode: rewards received, and rewards by the
            // Shifts' statistics.
            let mut received: BTreeMap<(u32, u8), f64> = BTreeMap::new();
            let mut counted: BTreeMap<(u32, u8), f64> = BTreeMap::new();
            let (mut wrong, mut episodes, mut brought) = (0u64, 0, false);
            loop {
                let shifts = &batch.shifts;
                let sums = f32s(&shifts.reward_sums);
                for (game, sums) in u32s(&shifts.games).into_iter().zip(sums.chunks(4)) {
                    for (seat, sum) in (0..).zip(sums) {
                        *counted.entry((game, seat)).or_default() += f64::from(*sum);
                    }
                }
                let endings = &batch.endings;
                let rewards = f32s(&endings.rewards);
                for (row, game) in u32s(&endings.games).into_iter().enumerate() {
                    let key = (game, endings.seats[row]);
                    let received = received.remove(&key).unwrap_or(0.0) + f64::from(rewards[row]);
                    let counted = counted.remove(&key).unwrap();
                    let close = (received - counted).abs() < 1e-3;
                    assert!(
                        close,
                        "{} by {episode:?}: {received} {counted}",
                        scheme.name()
                    );
                    episodes += 1;
                    brought |= received != 0.0;
                }
                let rewards = f32s(&batch.rewards);
                for (row, game) in u32s(&batch.games).into_iter().enumerate() {
                    let reward = f64::from(rewards[row]);
                    *received.entry((game, batch.seats[row])).or_default() += reward;
                }
                wrong += u32s(&shifts.wrong).into_iter().map(u64::from).sum::<u64>();
                if batch.done {
                    break;
                }
                // Every fifth action at a turn is illegal: a gift.
                let mut actions = some_actions(&batch);
                for (row, action) in actions.iter_mut().enumerate() {
                    if batch.kinds[row] == 1 && (batch.step + row as u64).is_multiple_of(5) {
                        *action = ActionId::new(201);
                    }
                }
                batch = games.step(&actions).unwrap();
            }
            assert_eq!(batch.totals.games, 8);
            assert!(wrong > 100 && batch.totals.invalid_attempts == wrong);
            assert!(received.is_empty() && counted.is_empty());
            assert!(brought && episodes >= 8 * 4, "{}", scheme.name());
        }
    }
}

#[test]
fn an_episode_ends_for_every_seat_with_its_final_observation() {
    // A one-Shift game ends where the same Shift of a longer game does, so its last observation is
    // the expected one.
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
        let mut first: BTreeMap<u32, Vec<(Situation, u8)>> = BTreeMap::new();
        while first.len() < 3 {
            batch = games.step(&some_actions(&batch)).unwrap();
            let ended = &batch.endings;
            assert_eq!(ended.rows % 4, 0, "one row for each seat");
            for (row, game) in u32s(&ended.games).into_iter().enumerate() {
                let rules = spec(shifts).validate().unwrap();
                let seen = ended.situation(row, &rules).unwrap();
                let place = ended.places_taken[row];
                assert_eq!(ended.game_over[row], u8::from(shifts == 1));
                let seat = Seat::new(usize::from(ended.seats[row]));
                assert_eq!(seen.observation.seat, Some(seat));
                assert_eq!(seen.observation.places[seat], place);
                let points = seen.observation.points[seat];
                assert_eq!(points, [5, 3, 1, 0][usize::from(place) - 1]);
                first.entry(game).or_default().push((seen, ended.ends[row]));
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
fn statistics_of_a_shift_joined_midway_count_from_there() {
    // Greedy agents until the first seat has finished, then random ones.
    let mut game = Game::new(rules(), game_seed(3, 3), |_| {});
    let mut greedy = BuiltInAgent::new(AgentKind::Greedy, [0; 32]);
    let mut turns = 0;
    while game
        .observe(Viewer::Spectator)
        .places
        .values()
        .all(|place| *place == 0)
    {
        let open = game.decision().unwrap();
        let view = game.observe(Viewer::Seat(open.seat));
        let action = greedy.decide(&view, &game.legal_actions());
        game.apply(action, |_| {}).unwrap();
        turns += 1;
    }
    let start = Start::Point {
        game: Box::new(game),
        same_deals: true,
    };
    let setup = all_client(1)
        .with_start(start)
        .unwrap()
        .with_rewards(Some(RewardScheme::PaperIntended))
        .with_statistics(true);
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut received = [0.0; 4];
    while batch.shifts.rows == 0 {
        batch = games.step(&some_actions(&batch)).unwrap();
        for (seat, reward) in batch.seats.iter().zip(f32s(&batch.rewards)) {
            received[usize::from(*seat)] += reward;
        }
    }
    for (seat, reward) in batch.endings.seats.iter().zip(f32s(&batch.endings.rewards)) {
        received[usize::from(*seat)] += reward;
    }
    let counted: u32 = u32s(&batch.shifts.valid).iter().sum();
    assert_eq!(u32s(&batch.shifts.turns), [counted + turns]);
    // The rewards of the places match those received.
    for (sum, received) in f32s(&batch.shifts.reward_sums).into_iter().zip(received) {
        assert!((sum - received).abs() < 1e-4, "{sum} {received}");
    }
}

#[test]
fn an_adjudicated_shift_awards_places_so_its_episode_is_finished() {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        max_turns: 3,
        ..RuleSetSpec::default()
    };
    let setup = VectorSetup::new(spec.validate().unwrap(), 1, &[None; 4], Seeds::Base(3))
        .unwrap()
        .with_statistics(true);
    let (mut games, mut batch) = VectorGames::new(setup);
    while batch.endings.rows == 0 {
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    assert_eq!(batch.shifts.adjudicated, [1]);
    assert_eq!(batch.endings.ends, [1; 4]);
    let mut places = batch.endings.places_taken.clone();
    places.sort_unstable();
    assert_eq!(places, [1, 2, 3, 4]);
}
