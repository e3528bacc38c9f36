//! Creates a room and plays all of its seats over one stream, each with its own agent.
//!
//! `cargo run -p chefshat-client --example many_seats -- [SERVER]`

use chefshat_client::{ActionId, Agent, Client, ConnectOptions, RandomAgent, legal_actions, v1};

/// Takes the first legal action: the rarest playable face with the fewest cards.
struct First;

impl Agent for First {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        legal_actions(request)
            .next()
            .expect("some action is always legal")
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let server = std::env::args().nth(1);
    let client = Client::connect_with(
        server.as_deref().unwrap_or("localhost:50051"),
        &ConnectOptions::from_env(),
    )
    .await?;

    let request = v1::CreateRoomRequest {
        name: "many seats".to_owned(),
        ..Default::default()
    };
    let made = client.create_room(request).await?;
    let room = made.room.ok_or("the server made no room")?;
    println!("room {}", room.room_id);

    let mut seats: Vec<(String, Box<dyn Agent>)> = Vec::new();
    for seat in &room.seats {
        let name = format!("agent {}", seat.seat);
        let joined = client.join_with_code(made.join_code.as_str(), name).await?;
        let agent: Box<dyn Agent> = if seat.seat == 0 {
            Box::new(First)
        } else {
            Box::new(RandomAgent::new(u64::from(seat.seat)))
        };
        seats.push((joined.ticket, agent));
    }
    for outcome in client.play_many(seats).await {
        let outcome = outcome?;
        let (seat, answers) = (outcome.seat, outcome.answers);
        match outcome.standing() {
            Some(line) => {
                println!(
                    "seat {seat}: place {}, {} points, {answers} decisions",
                    line.place, line.points
                );
            }
            None => println!("seat {seat}: no result"),
        }
    }
    Ok(())
}
