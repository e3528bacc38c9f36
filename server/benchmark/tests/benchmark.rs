//! The tasks and what a record proves about them. Hosted games are tested with `chefshat bench`.

use chefshat_agents::{AgentKind, BuiltInAgent, NamedAgent};
use chefshat_benchmark::{
    AgentInfo, Commitment, DealsKey, GameScore, Problem, Task, TaskResult, check, play_offline,
    tasks,
};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::jsonl::{self, Record};
use chefshat_record::language_model::ModelUsage;
use chefshat_record::outcome::{FALLBACK, Identity};
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
        // Decisions of the opponents and of the agents that others are compared with.
        for (deal, kind) in AgentKind::ALL.into_iter().enumerate() {
            for line in played(task, deal, kind) {
                if let Some(Line::Decision(decision)) = line.line {
                    hash.update(
                        [decision.seat, decision.action]
                            .map(u32::to_le_bytes)
                            .as_flattened(),
                    );
                }
            }
        }
        hex::encode(&hash.finalize()[..8])
    };
    let digests: Vec<_> = (tasks().iter())
        .map(|task| (task.name.as_str(), digest(task)))
        .collect();
    // Written down, so that results of different versions of the program stay comparable.
    let expected = [
        ("shift", "d4aed45ae182c4a3"),
        ("game", "35e313730d8a09fa"),
        ("small_deck", "40a69409743b1b3f"),
        ("language_model", "e82e71819716ae05"),
    ];
    assert_eq!(
        digests,
        expected.map(|(name, digest)| (name, digest.to_owned()))
    );
}

#[test]
fn hidden_deals_follow_from_a_key_that_nobody_else_needs_to_know() {
    let published = task("shift");
    let [hidden, others] = [7, 8].map(|byte| published.with_deals(Some(&DealsKey([byte; 32]))));
    // printf %s "ChefsHat-v1 shift 3 0707…07" | sha256sum, and of the digits alone.
    assert_eq!(
        hex::encode(hidden.seed(3).0),
        "070a495824b75ec3c14ba14624f67a741ebcb846592b7876f2785bc3b6bd2bd0"
    );
    let commitment = hidden.deals_commitment().expect("it has one");
    assert_eq!(
        commitment.to_string(),
        "1967c0fdaed0b8f2618d3b1f4a9f8541ed315505acc26f5a41f382da8bdd9954"
    );
    assert_eq!(published.deals_commitment(), None);
    for (text, is_one) in [
        (commitment.to_string(), true),
        ("0707".into(), false),
        ("\n".repeat(64), false),
    ] {
        assert_eq!(Commitment::try_from(text.clone()).is_ok(), is_one, "{text}");
    }
    let digits = "07".repeat(32);
    assert!(!format!("{hidden:?}").contains(&digits));
    assert!(
        !serde_json::to_string(&hidden)
            .expect("data")
            .contains(&digits)
    );
    let visibility = |task: &Task| task.room(0).policy.expect("it has one").visibility();
    assert_eq!(visibility(&hidden), v1::Visibility::Private);
    assert_eq!(visibility(published), v1::Visibility::Unspecified);
    let played = record(&hidden, 0);
    assert!(check(&hidden, 0, &played).is_ok());
    for other in [published, &others] {
        let problem = check(other, 0, &played).expect_err("it has other deals");
        assert!(matches!(problem, Problem::OtherDeal));
    }
    // Results of different deals are not compared.
    let result = |task: &Task| {
        let games = [0, 1].map(|deal| check(task, deal, &record(task, deal)).ok());
        TaskResult::of(task, AgentInfo::default(), &games)
    };
    let [of_hidden, of_others, of_published] = [&hidden, &others, published].map(result);
    assert!(of_hidden.paired_difference(&of_hidden).is_some());
    assert_eq!(of_hidden.paired_difference(&of_others), None);
    assert_eq!(of_hidden.paired_difference(&of_published), None);
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
}

/// A change of a policy.
type Mutation = fn(&mut v1::RoomPolicy);

#[test]
fn rooms_that_help_the_agent_are_refused() {
    let clock = |change: fn(&mut v1::KindClock)| {
        let mut clock = v1::KindClock {
            kind: v1::ParticipantKind::Agent.into(),
            ..v1::KindClock::default()
        };
        change(&mut clock);
        clock
    };
    let longer = clock(|clock| clock.decision_time_ms = Some(10_001));
    let bank = clock(|clock| clock.bank_ms = Some(1));
    // Servers give people an absence time of their own.
    let absence = clock(|clock| clock.absence_time_ms = Some(20_000));
    let refused: [(Mutation, &str); 9] = [
        (
            |policy| policy.decision_time_ms = Some(10_001),
            "longer time",
        ),
        (|policy| policy.bank_ms = Some(1), "time bank"),
        (
            |policy| policy.max_invalid_attempts = Some(11),
            "invalid attempts",
        ),
        (|policy| policy.max_timeouts = Some(4), "timeouts"),
        (
            |policy| policy.substitute = "trained".to_owned(),
            "substitute",
        ),
        (
            |policy| policy.abort = v1::AbortPolicy::AnyLost.into(),
            "aborted",
        ),
        (|policy| policy.pace_ms = Some(1), "pace"),
        (
            |policy| {
                policy.spectators_see_hands = Some(true);
                policy.spectator_delay_decisions = Some(1);
            },
            "spectators see hands",
        ),
        (|policy| policy.hints = true, "hints"),
    ];
    let problem = |change: &dyn Fn(&mut v1::RoomPolicy)| {
        let mut lines = played(task("shift"), 0, AgentKind::Greedy);
        let mut policy = task("shift").policy();
        change(&mut policy);
        // Clocks of kinds are not those of built-in agents.
        let bank = policy.bank_ms.unwrap_or(0);
        for line in &mut lines {
            match line.line.as_mut().expect("every line has a content") {
                Line::Decision(decision) => decision.bank_left_ms = bank,
                Line::Header(header) => change(header.policy.as_mut().expect("it has one")),
                Line::Event(v1::GameEvent {
                    kind: Some(v1::game_event::Kind::GameStarted(started)),
                    ..
                }) => change(started.policy.as_mut().expect("it has one")),
                _ => {}
            }
        }
        check(task("shift"), 0, &read(&lines))
            .err()
            .map(|it| it.to_string())
    };
    for (change, expected) in refused {
        let problem = problem(&change).expect("it must not count");
        assert!(problem.contains("different policy"), "{problem}");
        assert!(problem.contains(expected), "{problem}");
    }
    for (clock, expected) in [(longer, "longer time"), (bank, "time bank")] {
        let problem = problem(&|policy| policy.clocks = vec![clock]).expect("it must not count");
        assert!(problem.contains(expected), "{problem}");
    }
    assert_eq!(problem(&|policy| policy.clocks = vec![absence]), None);
}

#[test]
fn decisions_of_a_fallback_are_counted() {
    let shift = task("shift");
    let mut lines = played(shift, 0, AgentKind::Greedy);
    for line in &mut lines {
        if let Some(Line::Decision(decision)) = &mut line.line
            && decision.seat == 0
        {
            let extra = [(FALLBACK.to_owned(), "greedy".to_owned())].into();
            decision.annotations = Some(v1::Annotations {
                extra,
                ..v1::Annotations::default()
            });
        }
    }
    let score = check(shift, 0, &read(&lines)).expect("it is a correct record");
    assert_eq!(score.fallback_decisions, score.choices);
    assert!(score.choices > 0 && score.choices < score.decisions);
    let own = check(shift, 0, &record(shift, 0)).expect("it is a correct record");
    assert_eq!((own.choices, own.fallback_decisions), (score.choices, 0));
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
fn nobody_plays_under_the_name_of_a_built_in_agent() {
    let shift = task("shift");
    let lines = play_offline(shift, 0, "greedy", |seed| {
        BuiltInAgent::new(AgentKind::Random, seed)
    });
    let problem = check(shift, 0, &read(&lines)).expect_err("it was random");
    assert!(
        matches!(problem, Problem::Deviates { seat: 0, .. }),
        "{problem}"
    );
}

#[test]
fn a_result_counts_with_all_deals_and_its_own_decisions() {
    let player = Identity::of(&v1::Participant {
        name: "Mia".to_owned(),
        ..v1::Participant::default()
    });
    let game = |points: u64, fallback_decisions: u64| {
        Some(GameScore {
            points,
            shifts: 1,
            place: 1,
            player: player.clone(),
            decisions: 200,
            choices: 100,
            fallback_decisions,
            invalid_attempts: 0,
            language_model: None,
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
    assert_eq!(better.language_model, None);
    let by_model = [100, 200, 300, 400].map(|tokens| {
        let cost = Some(tokens as f64 / 100.0);
        let language_model = Some(ModelUsage { tokens, cost });
        Some(GameScore {
            language_model,
            ..game(1, 0).expect("it has a score")
        })
    });
    let (tokens, cost) = (1_000, Some(10.0));
    assert_eq!(
        result(&by_model).language_model,
        Some(ModelUsage { tokens, cost })
    );
    assert!(better.is_valid(), "{:?}", better.problems);
    assert_eq!(better.points_per_shift.mean, 4.0);
    assert_eq!(better.decision_ms, Some([1.0, 3.0]));
    let other = Some(GameScore {
        player: Identity {
            name: "Ben".to_owned(),
            ..player.clone()
        },
        ..game(5, 0).expect("it has a score")
    });
    // A row of a table does not say who played.
    let four = [(); 4].map(|()| game(5, 0));
    let greedy = AgentInfo {
        name: "greedy".to_owned(),
        ..AgentInfo::default()
    };
    assert_eq!(
        TaskResult::of(&task, greedy.clone(), &four).problems,
        ["greedy is the name of a built-in agent, but Mia played"]
    );
    let built_in = four.clone().map(|game| {
        let player = Identity {
            name: "greedy".to_owned(),
            built_in: true,
            ..player.clone()
        };
        game.map(|game| GameScore { player, ..game })
    });
    assert!(TaskResult::of(&task, greedy, &built_in).is_valid());
    let mixed = result(&[game(5, 0), other, game(5, 0), game(5, 0)]);
    assert_eq!(
        mixed.problems,
        ["several participants played, such as Ben and Mia"]
    );
    let worse = result(&[game(4, 0), game(2, 0), game(4, 0), game(2, 0)]);
    let versus = better.paired_difference(&worse).expect("the same task");
    // The same on every deal, so nothing is uncertain, although the points of the deals differ.
    assert_eq!(versus.points_per_shift.interval95, [1.0, 1.0]);
    assert_ne!(better.points_per_shift.interval95, [4.0, 4.0]);
    let nothing_in_common = result(&[None, None, None, game(1, 0)]);
    let first_two = result(&[game(1, 0), game(2, 0)]);
    assert_eq!(first_two.paired_difference(&nothing_in_common), None);
    let incomplete = result(&[game(5, 0), None, game(5, 0), game(3, 0)]);
    assert!(!incomplete.is_valid());
    let versus = incomplete.paired_difference(&worse).expect("the same task");
    assert_eq!(versus.deals, 3, "only deals that both played");
    assert!(!result(&[game(5, 90), game(5, 0), game(5, 0), game(5, 0)]).is_valid());
}

#[test]
fn texts_that_move_the_cursor_or_look_like_others_are_not_shown() {
    let named = |name: &str| AgentInfo {
        name: name.to_owned(),
        ..AgentInfo::default()
    };
    assert!(named("Größe 7").is_printable());
    let looks_like_another = [
        "greedy\u{200b}",
        "\u{202e}ydeerg",
        " greedy",
        "greedy\u{a0}",
    ];
    let too_long = "a".repeat(65);
    for name in ["", "\u{1b}[2J", "a\nb", &too_long]
        .into_iter()
        .chain(looks_like_another)
    {
        assert!(!named(name).is_printable(), "{name:?}");
    }
}
