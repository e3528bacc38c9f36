//! Prints the public events of a room until its game is over.
//!
//! `cargo run -p chefshat-client --example watch -- ROOM-ID [SERVER]`

use chefshat_client::{Client, ConnectOptions, v1::game_event::Kind};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let room_id = args.next().ok_or("give the room's id")?;
    let server = args.next().unwrap_or_else(|| "localhost:50051".to_owned());

    let client = Client::connect_with(server, &ConnectOptions::from_env()).await?;
    let mut spectator = client.spectate(room_id, 1);
    let mut texts = Vec::new();
    while let Some(event) = spectator.next().await? {
        let text = |action: u32| texts.get(action as usize).map_or("?", String::as_str);
        let words = match &event.kind {
            Some(Kind::GameStarted(start)) => {
                let faces = start.rules.as_ref().and_then(|rules| rules.faces);
                texts = client.action_table(faces.unwrap_or_default()).await?.texts;
                format!("the game begins, {} cards each", start.hand_size)
            }
            Some(Kind::Play(play)) => {
                let (seat, left) = (play.seat, play.cards_left);
                format!("seat {seat} plays {}, {left} cards left", text(play.action))
            }
            Some(Kind::Pass(pass)) => format!("seat {} passes", pass.seat),
            Some(Kind::ShiftEnded(end)) => format!("the Shift ends, points {:?}", end.points),
            other => format!("{other:?}"),
        };
        println!(
            "{:>6} {:>8.3} s  {words}",
            event.sequence,
            event.elapsed_ms as f64 / 1000.0
        );
    }
    Ok(())
}
