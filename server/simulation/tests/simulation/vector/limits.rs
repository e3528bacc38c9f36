//! Options of the client, refused input, and bounds of a step.

use std::num::{NonZeroU32, NonZeroU64};

use chefshat_agents::{AgentKind, game_seed};
use chefshat_engine::{DecisionKind, Game, RewardScheme, RuleSetSpec, Script, Seat, Stop};
use chefshat_simulation::vector::{
    Decisions, InvalidActions, MAX_RECORDED, Seeds, SetupError, Start, StepError, VectorGames,
    VectorSetup,
};

use super::*;

#[test]
fn an_invalid_action_is_refused_or_asked_again() {
    let (mut games, batch) = VectorGames::new(all_client(2));
    let mut actions = some_actions(&batch);
    actions[1] = ActionId::new(199);
    let refused = games.step(&actions).unwrap_err();
    assert!(
        matches!(refused, StepError::Illegal { row: 1, game: 1, action, .. } if action == ActionId::new(199)),
        "{refused}"
    );
    assert!(refused.to_string().contains("action 199 is not legal"));
    assert_eq!(
        games.step(&actions[..1]).unwrap_err(),
        StepError::Actions { given: 1, rows: 2 }
    );
    // Nothing has changed: the right actions are still accepted.
    let next = games.step(&some_actions(&batch)).unwrap();
    assert_eq!((next.step, next.totals.decisions), (2, 2));

    let limit = NonZeroU32::new(3);
    let setup = all_client(2)
        .with_rewards(Some(RewardScheme::Validity))
        .with_invalid_actions(InvalidActions::AskAgain { limit });
    let (mut games, batch) = VectorGames::new(setup);
    let opener = batch.seats[1];
    let right = some_actions(&batch)[0];
    let wrong = ActionId::new(199);
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
fn the_client_can_take_turns_only() {
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
fn forced_decisions_can_be_skipped() {
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
fn invalid_options_are_refused() {
    let kinds = [None; 4];
    let new = |games, agents: &[Option<AgentKind>], seeds| {
        VectorSetup::new(rules(), games, agents, seeds).unwrap_err()
    };
    assert_eq!(new(0, &kinds, Seeds::Base(1)), SetupError::NoGames);
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
    // With hands of three cards a Shift may end before the client is asked, several times in a row.
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
        // Two of each game, and one that the client's action ends.
        assert!(batch.totals.shifts - before <= 2 * 3);
        before = batch.totals.shifts;
        shifts = batch.totals.shifts;
    });
    assert_eq!(shifts, 4000);
}

#[test]
fn records_in_memory_are_bounded() {
    // An endless game: its only Shift has no practical turn limit, and everyone may pass forever.
    let rules = RuleSetSpec {
        max_turns: u32::MAX,
        max_idle_pizzas: u32::MAX,
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let setup = VectorSetup::new(rules.validate().unwrap(), 2, &[None; 4], Seeds::Base(5))
        .unwrap()
        .with_records(true)
        .with_invalid_actions(InvalidActions::AskAgain { limit: None });
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut steps = 0u64;
    let error = loop {
        let actions: Vec<ActionId> = masks(&batch)
            .iter()
            .map(|mask| mask.iter().last().unwrap())
            .collect();
        match games.step(&actions) {
            Ok(next) => batch = next,
            Err(error) => break error,
        }
        steps += 1;
        assert!(2 * steps <= MAX_RECORDED, "no limit was reached");
    };
    assert_eq!(error, StepError::RecordsTooLong);
    assert_eq!(2 * (steps + 1), MAX_RECORDED + 2);
}

#[test]
fn a_step_has_bounded_work() {
    // One attempt in hundreds is legal, and the client finishes most Shifts early, so steps take
    // many attempts but still end.
    let rules = RuleSetSpec {
        faces: 15,
        ..RuleSetSpec::default()
    };
    let careless = Some(AgentKind::RandomUnmasked);
    let agents = [None, careless, careless, careless];
    let setup =
        VectorSetup::new(rules.validate().unwrap(), 16_384, &agents, Seeds::Base(5)).unwrap();
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut left_out = 0;
    for _ in 0..6 {
        let actions = some_actions(&batch);
        batch = games.step(&actions).unwrap();
        left_out += 16_384 - batch.rows;
        assert!(!batch.done);
    }
    assert!(left_out > 0, "the limit was never reached");
}
