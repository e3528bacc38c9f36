//! A tournament of sixty-four on three nodes, of which the one that owns it is killed twice.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Backoff, Client, Outcome, PlayError, PlayOptions, RandomAgent};
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_tests::{Ledger, PATIENCE, one_shift, patiently, scores};
use futures::future::join_all;
use tokio::task::JoinSet;

use crate::cluster::{Cluster, Leases};
use crate::rounds::listed;

const NODES: usize = 3;
const PARTICIPANTS: u32 = 64;
const BUILT_IN: u32 = 24;
const ROUNDS: u32 = 4;
/// Tables per round.
const TABLES: u32 = PARTICIPANTS / 4;
/// Games that are over when the owner is killed.
const KILLED_AT: [u32; 2] = [10, 35];
/// Time between two looks at the tournament.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

fn options() -> PlayOptions {
    PlayOptions {
        backoff: Backoff {
            give_up_after: PATIENCE,
            ..Backoff::default()
        },
        ..PlayOptions::default()
    }
}

fn settings() -> v1::TournamentSettings {
    let agents = ["random", "greedy"].map(str::to_owned);
    v1::TournamentSettings {
        name: "Coppa dei nodi".into(),
        format: v1::TournamentFormat::Swiss.into(),
        rules: Some(one_shift()),
        rounds: ROUNDS,
        built_in_agents: (agents.into_iter().cycle())
            .take(BUILT_IN as usize)
            .collect(),
        start_when_joined: PARTICIPANTS,
        // Nobody is late, whatever happens to the nodes.
        no_show_time_ms: 3_600_000,
        policy: Some(v1::RoomPolicy {
            decision_time_ms: Some(3_600_000),
            pace_ms: Some(2),
            ..v1::RoomPolicy::default()
        }),
        ..v1::TournamentSettings::default()
    }
}

/// A participant over its own connection, to the end.
async fn play(
    url: String,
    code: String,
    number: u32,
    ledger: Arc<Ledger>,
) -> Result<Vec<Outcome>, PlayError> {
    let client = Client::connect(&url).await.expect("the proxy listens");
    let request = v1::JoinTournamentRequest {
        join_code: code,
        name: format!("agent {number}"),
        max_games: 1 + number % 2,
        ..v1::JoinTournamentRequest::default()
    };
    let joined = client.join_tournament(request).await.expect("a place");
    let make = |_: &v1::Attached| ledger.wrap(RandomAgent::new(number.into()));
    client
        .play_tournament_with(joined.ticket, make, &options())
        .await
}

/// Waits until this number of games are over and others are running.
async fn in_the_middle(client: &Client, tournament_id: &str, games_over: u32) {
    let reached = async {
        loop {
            // A node that has just lost the owner says so.
            if let Ok(now) = client.tournament(tournament_id).await {
                let is_over = now.state() == v1::TournamentState::Finished;
                assert!(!is_over, "it ended before its owner could be killed");
                if now.games_over >= games_over && now.games_playing > 0 {
                    return;
                }
            }
            tokio::time::sleep(LOOK_AGAIN).await;
        }
    };
    patiently("the middle", reached).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tournament_whose_owner_is_killed_twice_counts_every_game_once() {
    let mut cluster = Cluster::start(NODES, Leases::Steady).await;
    let client = Client::connect(cluster.url()).await.expect("it listens");
    let created = client.create_tournament(settings()).await;
    let created = created.expect("a tournament");
    let id = created.tournament.expect("a tournament").tournament_id;
    let ledger = Arc::new(Ledger::default());
    let mut playing = JoinSet::new();
    for number in 0..PARTICIPANTS - BUILT_IN {
        let code = created.join_code.clone();
        playing.spawn(play(cluster.url(), code, number, Arc::clone(&ledger)));
    }
    for games_over in KILLED_AT {
        tokio::select! {
            () = in_the_middle(&client, &id, games_over) => {}
            ended = playing.join_next() => panic!("a participant has left: {ended:?}"),
        }
        let owner = cluster.owner_of(&id);
        cluster.kill(owner).await;
        cluster.taken_over(owner).await;
        assert_ne!(cluster.owner_of(&id), owner);
        cluster.restart(owner).await;
    }
    while let Some(outcomes) = patiently("the end", playing.join_next()).await {
        let outcomes = outcomes.expect("no panic");
        for outcome in outcomes.expect("it played to the end") {
            assert!(outcome.standing().is_some(), "no game was aborted");
        }
    }
    ledger.assert_nothing_unexpected();

    let request = v1::ListTournamentGamesRequest {
        tournament_id: id.clone(),
        page_size: 100,
        ..v1::ListTournamentGamesRequest::default()
    };
    let page = client.tournament_games(request).await.expect("a page");
    assert_eq!(page.next_page_token, "");
    let different: BTreeSet<&str> = page.games.iter().map(|it| it.game_id.as_str()).collect();
    assert_eq!(different.len(), (ROUNDS * TABLES) as usize);
    assert_eq!(page.games.len(), different.len(), "each game once");
    let games = join_all(page.games.iter().map(async |game| {
        assert_eq!(game.state(), v1::TournamentGameState::Counted, "{game:?}");
        let record = client.record(&game.game_id).await.expect("a record");
        let Some(Line::Header(header)) = &record[0].line else {
            panic!("a record begins with its header");
        };
        assert_eq!(header.tournament_id, id);
        (game.clone(), record)
    }));
    let games = games.await;
    let acknowledged: usize = (games.iter())
        .map(|(game, record)| ledger.assert_committed(&game.game_id, record))
        .sum();
    assert_eq!(
        u64::try_from(acknowledged),
        Ok(ledger.count()),
        "all of them"
    );
    // Games that were called in vain leave no records.
    for node in &cluster.nodes {
        let listed = listed(&node.client().await).await;
        assert_eq!(listed.len(), different.len());
        assert!(listed.iter().all(|game| different.contains(game.as_str())));
    }
    let results = client.tournament_results(&id).await.expect("results");
    let scores = scores(&games);
    assert_eq!(results.standings.len(), PARTICIPANTS as usize);
    for standing in &results.standings {
        assert_eq!(standing.score, scores[&standing.participant]);
        assert_eq!((standing.games, standing.forfeited), (ROUNDS, 0));
    }
}
