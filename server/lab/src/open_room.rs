//! A room on a server that this program has created, and closes if it is not needed.

use std::time::Duration;

use chefshat_cli::error::CommandError;
use chefshat_client::Client;
use chefshat_proto::v1;
use tokio::time::timeout;
use tokio_util::task::task_tracker::{TaskTracker, TaskTrackerToken};

/// How long closing a room may take.
const CLOSING: Duration = Duration::from_secs(5);

/// A room that is closed when this is dropped: it would take a place of the server's for as long as it
/// waits for somebody.
pub(crate) struct OpenRoom {
    client: Client,
    closing: TaskTracker,
    /// Waiting for `closing` includes this.
    _token: TaskTrackerToken,
    /// Its id and its owner token; `None`: it is not to be closed.
    secrets: Option<(String, String)>,
}

impl OpenRoom {
    /// Creates a room, in a task of its own: if the future is dropped meanwhile, the room is closed once
    /// it is there, by a task of `closing`.
    ///
    /// # Errors
    /// The server does not answer, or refuses.
    pub(crate) async fn create(
        client: &Client,
        closing: &TaskTracker,
        request: v1::CreateRoomRequest,
    ) -> Result<(v1::CreateRoomResponse, Self), CommandError> {
        let (client, tracker) = (client.clone(), closing.clone());
        let creating = closing.spawn(async move {
            let created = client.create_room(request).await?;
            let room = created.room.clone().unwrap_or_default();
            let secrets = Some((room.room_id, created.owner_token.clone()));
            let open = Self {
                _token: tracker.token(),
                client,
                closing: tracker,
                secrets,
            };
            Ok::<_, chefshat_client::Error>((created, open))
        });
        Ok(creating.await??)
    }

    /// Leaves the room to its players: its game has begun, or is over.
    pub(crate) fn leave_open(mut self) {
        self.secrets = None;
    }
}

impl Drop for OpenRoom {
    fn drop(&mut self) {
        if let Some((room, owner_token)) = self.secrets.take() {
            let client = self.client.clone();
            self.closing.spawn(async move {
                let _closed = timeout(CLOSING, client.close_room(room, owner_token)).await;
            });
        }
    }
}
