//! Rooms of all kinds play through the proxy while one thing after another goes wrong. In the end
//! nothing that was acknowledged is lost, and nobody has received anything that did not happen.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use chefshat_client::Client;
use chefshat_proto::v1::{self, record_line::Line, record_service_client::RecordServiceClient};
use chefshat_record::replay;
use chefshat_tests::{BusyRooms, Ledger, RoomKind};

use crate::cluster::{Cluster, Leases};
use crate::faults::Faults;

/// Number of faults; `CHEFSHAT_FAULTS` overrides it.
const ROUNDS: u64 = 20;
/// From which the faults follow; `CHEFSHAT_FAULTS_SEED` overrides it.
const SEED: u64 = 17;
const NODES: usize = 3;

/// Rooms of all kinds: long and short games, shared and separate streams, events at once and with
/// decisions, with built-in agents.
fn rooms() -> Vec<RoomKind> {
    let mut kinds: Vec<RoomKind> = (0..8)
        .map(|number| RoomKind {
            rules: v1::RuleSet {
                stop: Some(v1::rule_set::Stop::TargetShifts(1 + number % 3)),
                ..v1::RuleSet::default()
            },
            one_stream: number % 2 == 1,
            delivery: match number % 4 {
                0 | 1 => v1::EventDelivery::AtOnce,
                _ => v1::EventDelivery::WithDecisions,
            },
            ..RoomKind::default()
        })
        .collect();
    for kind in &mut kinds[4..6] {
        kind.built_in = 1;
        kind.policy.pace_ms = Some(2);
    }
    kinds[7].rules = v1::RuleSet::default();
    kinds
}

fn setting(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => (text.parse()).unwrap_or_else(|_| panic!("{name} is a number")),
        Err(_) => default,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_and_nothing_else_published_whatever_fails() {
    let rounds = setting("CHEFSHAT_FAULTS", ROUNDS);
    let seed = setting("CHEFSHAT_FAULTS_SEED", SEED);
    eprintln!("{rounds} faults from seed {seed}");
    let begun = Instant::now();
    let mut cluster = Cluster::start(NODES, Leases::Short).await;
    let busy_rooms = BusyRooms::start(&cluster.url(), rooms());
    let mut faults = Faults::new(seed);
    let mut seconds: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for round in 1..=rounds {
        let before = Instant::now();
        let fault = faults.strike(&mut cluster, &busy_rooms).await;
        let took = before.elapsed().as_secs_f64();
        seconds.entry(fault).or_default().push(took);
        eprintln!("{round} of {rounds}: {fault:?}, {took:.1} s");
    }
    let ledger = Arc::clone(&busy_rooms.ledger);
    let games = busy_rooms.finish().await;
    let acknowledged = assert_recorded(&cluster, &ledger, &games).await;
    let epochs = assert_journals(&cluster);
    for (fault, seconds) in seconds {
        let mean = seconds.iter().sum::<f64>() / seconds.len() as f64;
        eprintln!("{:3} x {fault:?}, {mean:.1} s each", seconds.len());
    }
    eprintln!(
        "{rounds} faults from seed {seed}, {} games, {acknowledged} decisions acknowledged, {epochs} times a game changed hands; \
         {:.1} s",
        games.len(),
        begun.elapsed().as_secs_f64()
    );
}

/// Checks that the records contain what the clients know, and that all nodes show the same.
/// Returns the number of acknowledged decisions.
async fn assert_recorded(cluster: &Cluster, ledger: &Ledger, games: &[String]) -> usize {
    let client = cluster.nodes[0].client().await;
    let mut acknowledged = 0;
    for game in games {
        let record = client.record(game).await.expect("a stored record");
        let replayed = replay::replay(&record).unwrap_or_else(|error| panic!("{game}: {error}"));
        assert_eq!(replayed.state, v1::RoomState::Finished, "{game}");
        acknowledged += ledger.assert_committed(game, &record);
        for line in &record {
            if let Some(Line::Decision(decision)) = &line.line {
                assert_eq!(
                    decision.source(),
                    v1::DecisionSource::Agent,
                    "{game}: {decision:?}"
                );
            }
        }
    }
    assert_eq!(
        u64::try_from(acknowledged),
        Ok(ledger.count()),
        "all of them"
    );
    let played: BTreeSet<&String> = games.iter().collect();
    assert_eq!(played.len(), games.len(), "each game once");
    let listed = listed(&client).await;
    assert_eq!(listed.iter().collect::<BTreeSet<_>>(), played);
    for node in &cluster.nodes[1..] {
        assert_eq!(self::listed(&node.client().await).await, listed);
    }
    acknowledged
}

/// Checks what is stored. Returns how often a game got another owner.
fn assert_journals(cluster: &Cluster) -> u64 {
    let number = |sql: &str| -> u64 { cluster.select(sql).parse().expect("a number") };
    let fell = number(
        "SELECT count(*) FROM (SELECT epoch < lag(epoch) OVER (PARTITION BY game ORDER BY position) AS fell FROM journal) AS entries \
         WHERE fell",
    );
    assert_eq!(fell, 0, "an owner wrote after the next one");
    let gaps = number(
        "SELECT count(*) FROM (SELECT game FROM journal GROUP BY game HAVING max(position) + 1 <> count(*)) AS games",
    );
    assert_eq!(gaps, 0, "a journal has a gap");
    let numbers = cluster.select(
        "SELECT count(*) = (SELECT last FROM finished) AND min(listed) = 1 AND max(listed) = count(*) FROM games WHERE listed IS NOT NULL",
    );
    assert_eq!(numbers, "t", "finished games are numbered without gaps");
    let owners = "SELECT coalesce(sum(owners - 1), 0) FROM (SELECT count(DISTINCT epoch) AS owners FROM journal GROUP BY game) AS games";
    number(owners)
}

/// The games whose records a node has, in its order.
pub(crate) async fn listed(client: &Client) -> Vec<String> {
    let mut service = RecordServiceClient::new(client.channel());
    let mut games = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListRecordsRequest {
            page_size: 100,
            page_token,
            ..v1::ListRecordsRequest::default()
        };
        let page = service.list_records(request).await.expect("a page");
        let page = page.into_inner();
        games.extend(page.records.into_iter().map(|summary| summary.game_id));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return games;
        }
    }
}
