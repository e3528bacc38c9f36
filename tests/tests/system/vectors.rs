//! Vector streams over real connections: their records equal those of the engine alone, limits and
//! refusals are reported, and they end with the server.

use std::collections::BTreeMap;

use chefshat_agents::game_seed;
use chefshat_client::{ActionId, Client, RandomAgent, VectorGames};
use chefshat_engine::{Game, RuleSetSpec, Seed};
use chefshat_proto::v1::{self, record_line::Line, vector_setup::Seeds, vector_setup::Start};
use chefshat_record::replay::replay;
use chefshat_tests::{TestServer, patiently};

use crate::played::{ended, original};

pub(crate) fn setup(games: u32, total: u64) -> v1::VectorSetup {
    v1::VectorSetup {
        games,
        total_games: total,
        seeds: Some(Seeds::BaseSeed(11)),
        ..v1::VectorSetup::default()
    }
}

fn masks(batch: &v1::VectorBatch) -> impl Iterator<Item = &[u8]> {
    let width = batch.action_masks.len() / (batch.rows as usize).max(1);
    batch.action_masks.chunks(width.max(1))
}

fn choose(agent: &mut RandomAgent, batch: &v1::VectorBatch) -> Vec<ActionId> {
    masks(batch)
        .map(|mask| agent.choose(mask).expect("a legal action"))
        .collect()
}

pub(crate) async fn play_on(
    games: &mut VectorGames,
    mut batch: Box<v1::VectorBatch>,
    mut look: impl FnMut(&v1::VectorBatch, &[ActionId]),
) -> Box<v1::VectorBatch> {
    let mut agent = RandomAgent::new(5);
    while !batch.done {
        let actions = choose(&mut agent, &batch);
        look(&batch, &actions);
        batch = games.step(actions).await.expect("the actions are legal");
    }
    batch
}

/// The refusal's reason and field.
async fn refused(client: &Client, setup: v1::VectorSetup) -> (String, String) {
    let error = client.vector(setup).await.expect_err("refused");
    let field = error.metadata().get("field").cloned().unwrap_or_default();
    (error.reason().unwrap_or_default().to_owned(), field)
}

#[tokio::test]
async fn games_of_a_batch_have_the_records_of_the_engine_alone() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let wanted = v1::VectorSetup {
        client_seats: vec![0, 2],
        opponents: vec!["greedy".into(), "random_unmasked".into()],
        reward_scheme: v1::RewardScheme::PaperIntended.into(),
        records: true,
        ..setup(4, 10)
    };
    let (mut games, batch) = client.vector(wanted).await.expect("games");
    assert_eq!(
        games.started().built_in_agents,
        ["", "greedy", "", "random_unmasked"]
    );
    assert_eq!(games.started().base_seed, Some(11));
    // The client's answers, game by game.
    let mut indices: BTreeMap<u32, u64> = BTreeMap::new();
    let mut answers: BTreeMap<u64, Vec<(u32, u32)>> = BTreeMap::new();
    let last = play_on(&mut games, batch, |batch, actions| {
        if let Some(begun) = &batch.beginnings {
            let (games, indexed) = (
                begun.games.as_chunks::<4>().0,
                begun.indices.as_chunks::<8>().0,
            );
            for (game, index) in games.iter().zip(indexed) {
                indices.insert(u32::from_le_bytes(*game), u64::from_le_bytes(*index));
            }
        }
        let rows = batch.games.as_chunks::<4>().0.iter().zip(&batch.seats);
        for ((game, seat), action) in rows.zip(actions) {
            let index = indices[&u32::from_le_bytes(*game)];
            answers
                .entry(index)
                .or_default()
                .push(((*seat).into(), action.0));
        }
    })
    .await;
    assert_eq!(last.totals.expect("totals").games, 10);

    let mut records: BTreeMap<u64, Vec<v1::RecordLine>> = BTreeMap::new();
    for part in games.take_records() {
        records.entry(part.index).or_default().extend(part.lines);
    }
    assert_eq!(
        records.keys().copied().collect::<Vec<_>>(),
        (0..10).collect::<Vec<_>>()
    );
    for (index, lines) in records {
        let verified = replay(&lines).expect("a valid record");
        assert_eq!(verified.state, v1::RoomState::Finished);
        // The engine alone, with the same decisions, deals and continues as the record says.
        let rules = RuleSetSpec::default().validate().expect("default rules");
        let Seed(seed) = game_seed(11, index);
        let mut alone = Game::new(rules, Seed(seed), |_| {});
        let mut own = answers.remove(&index).expect("answers").into_iter();
        let mut decisions = 0;
        for line in &lines {
            let Some(Line::Decision(decision)) = &line.line else {
                continue;
            };
            decisions += 1;
            let open = alone.decision().expect("a decision is open");
            assert_eq!(decision.seat as usize, open.seat.index());
            assert_eq!(decision.action_mask, alone.legal_actions().to_bytes(214));
            if decision.seat % 2 == 0 {
                assert_eq!(own.next(), Some((decision.seat, decision.action)));
            }
            let action = u16::try_from(decision.action).expect("an action");
            alone
                .apply(chefshat_engine::ActionId::new(action), |_| {})
                .expect("a legal action");
        }
        assert!(alone.is_over() && own.next().is_none() && decisions > 100);
        let standings = alone.standings().expect("it is over");
        let received = lines.iter().find_map(|line| match &line.line {
            Some(Line::Event(v1::GameEvent {
                kind: Some(v1::game_event::Kind::GameEnded(end)),
                ..
            })) => Some(end.clone()),
            _ => None,
        });
        let received = received.expect("the end of the game");
        assert_eq!(received.reveal.expect("the seed").game_seed, seed);
        let points: Vec<u64> = standings.iter().map(|(_, _, points)| points).collect();
        let recorded: Vec<u64> = received.standings.iter().map(|one| one.points).collect();
        assert_eq!(recorded, points);
    }
}

#[tokio::test]
async fn games_branch_from_a_recorded_one() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = original(&client).await;
    let decisions = first.decisions().len() as u64 / 2;
    let point = |decisions, same_deals| v1::BranchPoint {
        game_id: first.game_id().into(),
        decisions,
        same_deals,
    };
    let branched = |point| v1::VectorSetup {
        start: Some(Start::Branch(point)),
        ..setup(3, 3)
    };
    let wanted = branched(point(decisions, true));
    let (mut games, batch) = client.vector(wanted).await.expect("games");
    // All start with the next decision.
    let next = &first.decisions()[decisions as usize];
    assert_eq!(batch.rows, 3);
    for (mask, seat) in masks(&batch).zip(&batch.seats) {
        assert_eq!(
            (mask, u32::from(*seat)),
            (next.action_mask.as_slice(), next.seat)
        );
    }
    let last = play_on(&mut games, batch, |_, _| {}).await;
    assert_eq!(last.totals.expect("totals").games, 3);

    let too_far = refused(&client, branched(point(1_000_000, false))).await;
    assert_eq!(too_far, ("BRANCH_REFUSED".into(), "decisions".into()));
    let unknown = v1::BranchPoint {
        game_id: "0".repeat(32),
        ..point(1, false)
    };
    assert_eq!(refused(&client, branched(unknown)).await.0, "GAME_UNKNOWN");
    let with_rules = v1::VectorSetup {
        rules: Some(chefshat_tests::one_shift()),
        ..branched(point(1, false))
    };
    assert_eq!(
        refused(&client, with_rules).await,
        ("BRANCH_REFUSED".into(), "rules".into())
    );
    // Rooms of the same server are unaffected.
    let room = ended(
        &client,
        v1::CreateRoomRequest {
            seats: (0..4).map(|_| crate::played::built_in("random")).collect(),
            ..v1::CreateRoomRequest::default()
        },
    )
    .await;
    assert!(!room.decisions().is_empty());
}

#[tokio::test]
async fn invalid_requests_are_refused_with_a_reason() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let standard = || setup(2, 0);
    let table: Vec<(v1::VectorSetup, &str, &str)> = vec![
        (setup(0, 0), "SETUP_REFUSED", "games"),
        (setup(100_000, 0), "SETUP_REFUSED", "games"),
        (setup(3, 2), "SETUP_REFUSED", "total_games"),
        (
            v1::VectorSetup {
                client_seats: vec![1, 0],
                ..standard()
            },
            "SETUP_REFUSED",
            "client_seats",
        ),
        (
            v1::VectorSetup {
                client_seats: vec![4],
                ..standard()
            },
            "SETUP_REFUSED",
            "client_seats",
        ),
        (
            v1::VectorSetup {
                client_seats: vec![0],
                opponents: vec!["nobody".into()],
                ..standard()
            },
            "SETUP_REFUSED",
            "opponents",
        ),
        (
            v1::VectorSetup {
                client_seats: vec![0],
                opponents: vec!["random".into(); 2],
                ..standard()
            },
            "SETUP_REFUSED",
            "opponents",
        ),
        (
            v1::VectorSetup {
                reward_scheme: 99,
                ..standard()
            },
            "SETUP_REFUSED",
            "reward_scheme",
        ),
        (
            v1::VectorSetup {
                other_decisions: "random".into(),
                ..standard()
            },
            "SETUP_REFUSED",
            "other_decisions",
        ),
        (
            v1::VectorSetup {
                max_invalid_attempts: 3,
                ..standard()
            },
            "SETUP_REFUSED",
            "max_invalid_attempts",
        ),
        (
            v1::VectorSetup {
                records: true,
                invalid_actions: v1::InvalidActionRule::AskAgain.into(),
                ..standard()
            },
            "SETUP_REFUSED",
            "records",
        ),
        (
            v1::VectorSetup {
                rules: Some(v1::RuleSet {
                    players: Some(9),
                    ..v1::RuleSet::default()
                }),
                ..standard()
            },
            "RULE_SET_REFUSED",
            "players",
        ),
        (
            v1::VectorSetup {
                start: Some(Start::Scripted(v1::ScriptedShift::default())),
                ..standard()
            },
            "SCRIPT_REFUSED",
            "hands",
        ),
        (
            v1::VectorSetup {
                seeds: Some(Seeds::GameSeeds(v1::GameSeeds {
                    seeds: vec![vec![1; 31]],
                })),
                ..standard()
            },
            "SEED_REFUSED",
            "game_seeds",
        ),
    ];
    for (wanted, reason, field) in table {
        assert_eq!(
            refused(&client, wanted).await,
            (reason.into(), field.into())
        );
    }

    let (mut games, batch) = client.vector(standard()).await.expect("games");
    let error = games
        .step([ActionId(0)])
        .await
        .expect_err("one action for two rows");
    assert_eq!(error.reason(), Some("ACTIONS_REFUSED"));
    assert_eq!(error.metadata()["rows"], "2");
    drop((games, batch));
    let (mut games, _) = client.vector(standard()).await.expect("games");
    let error = games
        .step([ActionId(199), ActionId(70_000)])
        .await
        .expect_err("an unknown action");
    assert_eq!(error.reason(), Some("ILLEGAL_ACTION"));
    assert_eq!(error.metadata()["row"], "0");
    let gone = games.step([ActionId(0), ActionId(0)]).await;
    let gone = gone.expect_err("the stream has ended");
    assert_eq!(gone.reason(), Some("STEP_GIVEN_UP"));
    let column = |game: u32| game.to_le_bytes().to_vec();
    let base = Some(v1::vector_reset::Seeds::BaseSeed(1));
    for (games, all, seeds) in [
        (column(7), false, None),
        (column(0), true, None),
        (column(0), false, base.clone()),
        (vec![0; 3], false, None),
    ] {
        let (mut stepped, _) = client.vector(standard()).await.expect("games");
        let reset = v1::VectorReset { games, all, seeds };
        let error = stepped.reset(reset).await.expect_err("refused");
        assert_eq!(error.reason(), Some("RESET_REFUSED"));
        let error = stepped.step([ActionId(0), ActionId(0)]).await;
        let error = error.expect_err("the games have ended");
        assert_eq!(error.reason(), Some("STEP_GIVEN_UP"));
    }
}

#[tokio::test]
async fn attempts_are_asked_again_and_recorded() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let wanted = v1::VectorSetup {
        client_seats: vec![1],
        opponents: vec!["greedy".into()],
        decisions: v1::DecisionScope::Turns.into(),
        other_decisions: "greedy".into(),
        skip_forced: true,
        invalid_actions: v1::InvalidActionRule::AskAgain.into(),
        max_invalid_attempts: 3,
        reward_scheme: v1::RewardScheme::Validity.into(),
        records: true,
        seeds: Some(Seeds::GameSeeds(v1::GameSeeds {
            seeds: vec![vec![1; 32], vec![2; 32]],
        })),
        ..setup(2, 2)
    };
    let (mut games, mut batch) = client.vector(wanted).await.expect("games");
    assert_eq!(games.started().base_seed, None);
    let mut agent = RandomAgent::new(3);
    while !batch.done {
        let answers = choose(&mut agent, &batch);
        // Game 0 never answers with a legal action: gifts belong to the exchange.
        let own = batch.games.as_chunks::<4>().0.iter().zip(answers);
        let answers: Vec<ActionId> = own
            .map(|(game, action)| {
                if *game == [0; 4] {
                    ActionId(200)
                } else {
                    action
                }
            })
            .collect();
        batch = games.step(answers).await.expect("asked again");
    }
    let mut records: BTreeMap<u64, Vec<v1::RecordLine>> = BTreeMap::new();
    for part in games.take_records() {
        records.entry(part.index).or_default().extend(part.lines);
    }
    assert_eq!(records.len(), 2);
    for (index, lines) in records {
        replay(&lines).expect("a valid record");
        let (mut defaults, mut own) = (0, 0);
        for line in &lines {
            let Some(Line::Decision(decision)) = &line.line else {
                continue;
            };
            if decision.seat == 1 && decision.invalid_attempts == [200; 3] {
                assert_eq!(decision.source(), v1::DecisionSource::Invalid);
                assert_eq!(decision.invalid_reward, Some(-3.0));
                defaults += 1;
            } else if decision.seat == 1 {
                assert_eq!(decision.source(), v1::DecisionSource::Agent);
                own += 1;
            }
        }
        assert!(
            own > 0 && (defaults > 0) == (index == 0),
            "{index} {own} {defaults}"
        );
    }
}

#[tokio::test]
async fn games_are_reset_over_the_wire() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let (mut games, first) = client.vector(setup(3, 0)).await.expect("games");
    let begun = |batch: &v1::VectorBatch| -> Vec<u64> {
        let begun = batch.beginnings.clone().unwrap_or_default();
        let indices = begun.indices.as_chunks::<8>().0.iter();
        indices.map(|index| u64::from_le_bytes(*index)).collect()
    };
    assert_eq!(begun(&first), [0, 1, 2]);
    let actions = choose(&mut RandomAgent::new(1), &first);
    games.step(actions).await.expect("a legal action");
    let some = v1::VectorReset {
        games: 1u32.to_le_bytes().to_vec(),
        ..v1::VectorReset::default()
    };
    assert_eq!(begun(&games.reset(some).await.expect("reset")), [4]);
    let all = v1::VectorReset {
        all: true,
        ..v1::VectorReset::default()
    };
    assert_eq!(
        begun(&games.reset(all.clone()).await.expect("reset")),
        [3, 7, 5]
    );
    let seeded = v1::VectorReset {
        seeds: Some(v1::vector_reset::Seeds::BaseSeed(11)),
        ..all
    };
    let again = games.reset(seeded).await.expect("reset");
    assert_eq!(begun(&again), [0, 1, 2]);
    assert_eq!(
        (again.observations, again.seats),
        (first.observations, first.seats)
    );
    let none = games
        .reset(v1::VectorReset::default())
        .await
        .expect("restored");
    assert_eq!((begun(&none), none.rows), (vec![], 3));
}

#[tokio::test]
async fn streams_are_limited_and_end_with_the_server() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let limits = client.server_info().await.expect("information").limits;
    // One caller may have half of them on the server's machine.
    let most = limits["max_vector_streams"] * limits["local_share_percent"] / 100;
    assert!(limits["max_vector_seats"] >= 16_384);
    let mut open = Vec::new();
    for _ in 0..most {
        open.push(client.vector(setup(1, 0)).await.expect("games"));
    }
    let error = client.vector(setup(1, 0)).await.expect_err("one too many");
    assert_eq!(error.reason(), Some("TOO_MANY_VECTOR_STREAMS"));
    assert!(error.message().contains(&most.to_string()));
    // A stream that is dropped makes room for another, as soon as the server notices.
    open.pop();
    patiently("room for another stream", async {
        while client.vector(setup(1, 0)).await.is_err() {
            tokio::task::yield_now().await;
        }
    })
    .await;
    // The seats of all its streams together are limited too.
    open.truncate(1);
    let whole = u32::try_from(limits["max_vector_seats"] / 4).expect("a number of games");
    let error = patiently("too many games", async {
        loop {
            match client.vector(setup(whole, 0)).await {
                Ok(stream) => open.push(stream),
                Err(error) if error.reason() == Some("TOO_MANY_VECTOR_GAMES") => break error,
                Err(_) => tokio::task::yield_now().await,
            }
        }
    })
    .await;
    let share = limits["max_vector_seats_in_all"] * limits["local_share_percent"] / 100;
    assert_eq!(open.len() as u64, share / (4 * u64::from(whole)));
    assert!(error.message().contains(&share.to_string()));
    let (mut games, batch) = open.swap_remove(0);
    let actions = choose(&mut RandomAgent::new(1), &batch);
    games.step(actions.clone()).await.expect("it still plays");
    let _ = server.stop().await;
    let error = patiently("the end of the stream", games.step(actions)).await;
    let error = error.expect_err("the server has ended");
    assert_eq!(error.reason(), Some("SHUTTING_DOWN"));
}
