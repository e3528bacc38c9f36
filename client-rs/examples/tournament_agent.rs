//! Takes part in a tournament with a new random agent for each game, and prints the final
//! standings.
//!
//! `cargo run -p chefshat-client --example tournament_agent -- JOIN-CODE [NAME] [SERVER]`

use chefshat_client::{Client, ConnectOptions, RandomAgent, v1};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let join_code = args.next().ok_or("give the tournament's join code")?;
    let name = args.next().unwrap_or_else(|| "random".to_owned());
    let server = args.next().unwrap_or_else(|| "localhost:50051".to_owned());

    let client = Client::connect_with(server, &ConnectOptions::from_env()).await?;
    let request = v1::JoinTournamentRequest {
        join_code,
        name,
        max_games: 4,
        stateless: true,
        ..Default::default()
    };
    let joined = client.join_tournament(request).await?;
    let tournament = joined.tournament.ok_or("the server named no tournament")?;
    println!("participant {}, waiting for games", joined.participant);

    let agent = |attached: &v1::Attached| {
        println!("game {}, seat {}", attached.game_id, attached.seat);
        RandomAgent::new(rand::random())
    };
    let outcomes = client.play_tournament(joined.ticket, agent).await?;
    println!("{} games", outcomes.len());

    let results = client.tournament_results(tournament.tournament_id).await?;
    for line in results.standings {
        let me = if line.participant == joined.participant {
            "  <- this agent"
        } else {
            ""
        };
        println!(
            "{}. participant {}: {} points of {} games{me}",
            line.place, line.participant, line.score, line.games
        );
    }
    Ok(())
}
