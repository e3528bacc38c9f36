//! Takes a seat with a join code, plays one game with random legal actions, and prints the
//! standings.
//!
//! `cargo run -p chefshat-client --example random_agent -- JOIN-CODE [SERVER]`

use chefshat_client::{Client, ConnectOptions, RandomAgent};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let code = args.next().ok_or("give the room's join code")?;
    let server = args.next().unwrap_or_else(|| "localhost:50051".to_owned());

    let client = Client::connect_with(server, &ConnectOptions::from_env()).await?;
    let joined = client.join_with_code(code, "random").await?;
    println!("seat {}, waiting for the others", joined.seat);

    let agent = RandomAgent::new(u64::from(std::process::id()));
    let outcome = client.play(joined.ticket, agent).await?;
    if let Some(reason) = outcome.aborted() {
        println!("no result: {}", reason.as_str_name());
    }
    for line in outcome.standings() {
        let me = if line.seat == outcome.seat {
            "  <- this agent"
        } else {
            ""
        };
        println!(
            "{}. seat {}: {} points{me}",
            line.place, line.seat, line.points
        );
    }
    Ok(())
}
