//! Measures what passes through single rows of the database:
//! `cargo test -p chefshat-store --lib measure -- --ignored --nocapture`.

use std::time::Instant;

use super::*;
use chefshat_postgres::Server;
use chefshat_room::ids::Id;

/// Ends of games are numbered in the order of their commits, by one row of the database.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "measures"]
async fn starts_and_ends_of_three_nodes() {
    const GAMES: u32 = 3_000;
    let server = Server::syncing();
    let database = server.database();
    let mut nodes = Vec::new();
    for _ in 0..3 {
        nodes.push(node_with(&database, PostgresOptions::default()).await);
    }
    let mut ids = Vec::new();
    let starts = (0..GAMES).zip(nodes.iter().cycle()).map(|(number, store)| {
        let mut id = [0; 16];
        id[..4].copy_from_slice(&number.to_be_bytes());
        let id = GameId::from_bytes(id);
        ids.push(id.to_string());
        let header = Arc::new(GameHeader {
            room_id: Id::from_bytes(*id.bytes()),
            game_id: id,
            join_code: number.to_string(),
            ..(*durable(1)).clone()
        });
        store.create(header, vec![entry(1)])
    });
    let starts: Vec<_> = starts.collect();
    let began = Instant::now();
    let journals = futures::future::join_all(starts).await;
    let starting = began.elapsed();
    let ends = journals.into_iter().zip(ids).map(|(journal, game_id)| {
        let mut journal = journal.expect("created");
        let summary = v1::RecordSummary {
            game_id,
            ..*summary(1)
        };
        async move { journal.finish(Some(Box::new(summary)), None).await }
    });
    let began = Instant::now();
    for ended in futures::future::join_all(ends).await {
        ended.expect("ended");
    }
    for (what, time) in [("starts", starting), ("ends", began.elapsed())] {
        println!("{:.0} {what}/s", f64::from(GAMES) / time.as_secs_f64());
    }
    for node in nodes {
        node.close().await;
    }
}
