//! The tasks and what a record proves about them. Hosted games are in `tests/` of the repository.

use chefshat_agents::{AgentKind, BuiltInAgent, NamedAgent};
use chefshat_benchmark::{
    AgentInfo, GameScore, Problem, Task, TaskResult, check, play_offline, tasks,
};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::jsonl::{self, Record};
use chefshat_record::signature::TextHash;
use sha2::{Digest as _, Sha256};

fn task(name: &str) -> &'static Task {
    Task::named(name).expect("there is such a task")
}

/// The record of a game of `greedy`, as it would be read from a file.
fn record(task: &Task, deal: usize) -> Record {
    read(&played(task, deal, AgentKind::Greedy))
}

fn played(task: &Task, deal: usize, kind: AgentKind) -> Vec<v1::RecordLine> {
    play_offline(task, deal, kind.name(), |seed| {
        BuiltInAgent::new(kind, seed)
    })
}

fn read(lines: &[v1::RecordLine]) -> Record {
    let text = jsonl::text(lines).expect("all numbers are finite");
    jsonl::read_text("memory".as_ref(), text.as_slice()).expect("a record that was just written")
}

#[test]
fn the_tasks_never_change() {
    let digest = |task: &Task| {
        let mut hash = Sha256::new();
        hash.update(serde_json::to_vec(task).expect("it is data"));
        for deal in 0..2500 {
            hash.update(task.seed(deal).0);
        }
        hex::encode(&hash.finalize()[..8])
    };
    let digests: Vec<_> = (tasks().iter())
        .map(|task| (task.name.as_str(), digest(task)))
        .collect();
    // Written down, so that results of different versions of the program stay comparable.
    let expected = [
        ("shift", "563b13869c96a1c9"),
        ("game", "9b5acb3df0157472"),
        ("small_deck", "eb266c68ef1bffb0"),
        ("language_model", "a1e203f90276ab88"),
    ];
    assert_eq!(
        digests,
        expected.map(|(name, digest)| (name, digest.to_owned()))
    );
}

#[test]
fn every_task_can_be_played_again() {
    for task in tasks() {
        let players = task.rule_set().players();
        assert_eq!(task.opponents.len(), players - 1, "{}", task.name);
        for deal in 0..2 * players {
            let opponents = task.opponents(deal);
            let own = task.seat(deal).index();
            assert_eq!(own, deal % players);
            for (seat, opponent) in opponents.iter().enumerate() {
                assert_eq!(opponent.is_none(), seat == own);
                // With a time for each decision, nobody could repeat them.
                let search = opponent.and_then(NamedAgent::search);
                assert!(search.is_none(), "{}", task.name);
            }
            let score = check(task, deal, &record(task, deal)).expect("it was played just now");
            assert_eq!((score.fallback_decisions, score.invalid_attempts), (0, 0));
            assert!(score.decisions > 0 && score.shifts > 0);
        }
    }
}

#[test]
fn the_first_opponent_sits_to_the_left_of_the_agent() {
    let names = task("game").opponents(2).into_iter();
    let names: Vec<_> = names.map(|agent| agent.map(NamedAgent::name)).collect();
    let expected = [Some("greedy"), Some("random"), None, Some("trained")];
    assert_eq!(names, expected.map(|name| name.map(str::to_owned)));
}

#[test]
fn what_is_not_the_game_of_the_deal_is_refused() {
    let shift = task("shift");
    let problem =
        |record: &Record, deal| check(shift, deal, record).expect_err("it must not count");
    assert!(matches!(problem(&record(shift, 1), 5), Problem::OtherDeal));
    let other_rules = Task {
        rules: task("game").rules.clone(),
        ..shift.clone()
    };
    let other_rules = record(&other_rules, 0);
    assert!(matches!(problem(&other_rules, 0), Problem::OtherRules));
    let other_opponents = Task {
        opponents: vec!["greedy".to_owned(); 3],
        ..shift.clone()
    };
    let weaker = record(&other_opponents, 0);
    assert!(matches!(
        problem(&weaker, 0),
        Problem::OtherOpponent { seat: 1, .. }
    ));
    let slower = Task {
        decision_time_ms: shift.decision_time_ms + 1,
        ..shift.clone()
    };
    let slow = record(&slower, 0);
    assert!(matches!(problem(&slow, 0), Problem::OtherPolicy(_)));
}

#[test]
fn opponents_that_do_not_play_as_they_do_are_found() {
    let shift = task("shift");
    let weaker = Task {
        opponents: vec!["random".to_owned(); 3],
        ..shift.clone()
    };
    let mut lines = played(&weaker, 0, AgentKind::Greedy);
    for line in &mut lines {
        let seats = match line.line.as_mut().expect("every line has a content") {
            Line::Header(header) => &mut header.seats,
            Line::Event(v1::GameEvent {
                kind: Some(v1::game_event::Kind::GameStarted(started)),
                ..
            }) => &mut started.seats,
            _ => continue,
        };
        for seat in seats
            .iter_mut()
            .filter(|seat| seat.built_in_agent == "random")
        {
            seat.built_in_agent = "trained".to_owned();
            seat.name = "trained".to_owned();
        }
    }
    let problem = check(shift, 0, &read(&lines)).expect_err("these are not trained agents");
    assert!(matches!(problem, Problem::Deviates { .. }), "{problem}");
}

#[test]
fn a_result_counts_with_all_deals_and_its_own_decisions() {
    let game = |points: u64, fallback_decisions: u64| {
        Some(GameScore {
            points,
            shifts: 1,
            place: 1,
            decisions: 100,
            fallback_decisions,
            invalid_attempts: 0,
            decision_times_us: vec![1000, 3000],
            signed_by: None,
            record: TextHash::default(),
        })
    };
    let task = Task {
        deals: 4,
        ..task("shift").clone()
    };
    let result = |games: &[Option<GameScore>]| TaskResult::of(&task, AgentInfo::default(), games);
    let better = result(&[game(5, 0), game(3, 0), game(5, 1), game(3, 0)]);
    assert!(better.is_valid(), "{:?}", better.problems);
    assert_eq!(better.points_per_shift.mean, 4.0);
    assert_eq!(better.decision_ms, Some([1.0, 3.0]));
    let worse = result(&[game(4, 0), game(2, 0), game(4, 0), game(2, 0)]);
    let versus = better.paired_difference(&worse).expect("the same task");
    // The same on every deal, so nothing is uncertain, although the points of the deals differ.
    assert_eq!(versus.points_per_shift.interval95, [1.0, 1.0]);
    assert_ne!(better.points_per_shift.interval95, [4.0, 4.0]);
    let incomplete = result(&[game(5, 0), None, game(5, 0), game(3, 0)]);
    assert!(!incomplete.is_valid());
    let versus = incomplete.paired_difference(&worse).expect("the same task");
    assert_eq!(versus.deals, 3, "only deals that both played");
    assert!(!result(&[game(5, 90), game(5, 0), game(5, 0), game(5, 0)]).is_valid());
}
