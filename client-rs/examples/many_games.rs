//! Steps 256 games in batches, as learning agents do: plays a random legal action on one seat of
//! each against three built-in agents, until 1,000 Shifts are over.
//!
//! `cargo run --release -p chefshat-client --example many_games -- [SERVER]`

use chefshat_client::{Client, ConnectOptions, RandomAgent, v1};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let server = std::env::args().nth(1);
    let client = Client::connect_with(
        server.as_deref().unwrap_or("localhost:50051"),
        &ConnectOptions::from_env(),
    )
    .await?;
    let setup = v1::VectorSetup {
        games: 256,
        client_seats: vec![0],
        opponents: vec!["greedy".to_owned()],
        reward_scheme: v1::RewardScheme::Points.into(),
        ..Default::default()
    };
    let (mut games, mut batch) = client.vector(setup).await?;
    let mut agent = RandomAgent::new(1);
    let (mut episodes, mut points) = (0, 0.0);
    while episodes < 1000 {
        let rows = batch.rows as usize;
        let width = batch.action_masks.len() / rows.max(1);
        let masks = batch.action_masks.chunks(width.max(1));
        let actions: Vec<_> = masks.filter_map(|mask| agent.choose(mask)).collect();
        batch = games.step(actions).await?;
        if let Some(ended) = &batch.endings {
            let (rewards, _) = ended.rewards.as_chunks::<4>();
            episodes += ended.rows;
            points += rewards
                .iter()
                .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
                .sum::<f64>();
        }
    }
    println!(
        "{episodes} Shifts, {:.2} points a Shift",
        points / f64::from(episodes)
    );
    Ok(())
}
