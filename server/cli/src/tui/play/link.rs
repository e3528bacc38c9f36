//! The connection of a ticket: carries what the SDK's follower learns to `part`, which handles it, and
//! the person's commands to the server.

use std::collections::BTreeSet;
use std::time::Duration;

use chefshat_client::v1::{seat_command::Command, seat_update::Update};
use chefshat_client::{Client, Followed};
use tokio::sync::mpsc;
use tokio::time::timeout;

use super::part::PartInput;

/// Time limit for describing a room.
const ROOM_TIMEOUT: Duration = Duration::from_secs(2);

/// A command for a game.
pub(super) type Order = (String, Command);

/// Follows the ticket of a seat, or of a place in a tournament, until it ends for good or `orders`
/// is closed.
pub(super) async fn link(
    client: Client,
    ticket: String,
    mut orders: mpsc::Receiver<Order>,
    heard: mpsc::Sender<PartInput>,
) {
    let mut follower = client.follow_ticket(ticket);
    let mut games = BTreeSet::new();
    loop {
        let followed = tokio::select! {
            followed = follower.next() => followed,
            order = orders.recv() => {
                let Some((game, command)) = order else {
                    return follower.leave().await;
                };
                follower.send(&game, command).await;
                continue;
            }
        };
        let what = match followed {
            Ok(Some(Followed::Entered(entered))) => PartInput::Entered(entered),
            Ok(Some(Followed::Update(game, update))) => match *update {
                Update::Attached(attached) => {
                    // Of a new game: its room lists the participants before the game starts.
                    let mut room = None;
                    if games.insert(game) {
                        let asked = client.get_room(&*attached.room_id);
                        let asked = timeout(ROOM_TIMEOUT, asked).await;
                        room = asked.ok().and_then(Result::ok).map(Box::new);
                    }
                    PartInput::Seated(attached, room)
                }
                update => PartInput::Update(game, Box::new(update)),
            },
            Ok(Some(Followed::Gone(game, error))) => PartInput::Gone(game, error.message()),
            Ok(Some(Followed::Lost(error))) => PartInput::Lost(error.message().to_owned()),
            Ok(None) => PartInput::Over(None),
            Err(error) => PartInput::Over(Some(error.message())),
        };
        let over = matches!(what, PartInput::Over(_));
        // The receiver may be gone.
        if heard.send(what).await.is_err() || over {
            return;
        }
    }
}
