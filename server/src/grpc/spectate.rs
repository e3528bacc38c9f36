//! `SpectatorService`: watching a room without a seat.

use std::pin::Pin;
use std::sync::Arc;

use chefshat_proto::v1::{
    SpectatorServiceWatchRequest, SpectatorServiceWatchResponse,
    spectator_service_server::SpectatorService,
};
use futures::{Stream, StreamExt as _};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};

use super::room_service::find;
use super::status::Refusal;
use crate::config::HEARTBEAT;
use crate::outbox::Outbox;
use crate::room::SpectateRequest;
use crate::rooms::Rooms;

/// The service.
#[derive(Debug, Clone)]
pub struct Spectate {
    rooms: Arc<Rooms>,
    closing: CancellationToken,
}

impl Spectate {
    /// The service for these rooms; `closing` ends its streams.
    pub fn new(rooms: Arc<Rooms>, closing: CancellationToken) -> Self {
        Self { rooms, closing }
    }
}

#[tonic::async_trait]
impl SpectatorService for Spectate {
    type WatchStream =
        Pin<Box<dyn Stream<Item = Result<SpectatorServiceWatchResponse, Status>> + Send>>;

    async fn watch(
        &self,
        request: Request<SpectatorServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let request = request.into_inner();
        let room = find(&self.rooms, &request.room_id)?;
        let (outbox, messages) = Outbox::new();
        let from = request.from_sequence.saturating_sub(1);
        room.spectate(SpectateRequest {
            outbox: Arc::clone(&outbox),
            from: usize::try_from(from).unwrap_or(usize::MAX),
            snapshot: request.snapshot,
        })
        .await
        .map_err(Refusal::from)?
        .map_err(Refusal::from)?;
        let closing = self.closing.clone();
        tokio::spawn(async move {
            tokio::select! {
                () = outbox.abandoned() => {}
                () = closing.cancelled() => outbox.end(Ok(())),
            }
        });
        let messages =
            tokio_stream::StreamExt::timeout_repeating(messages, tokio::time::interval(HEARTBEAT))
                .map(|message| message.unwrap_or_else(|_| Ok(Vec::new())).map(merge));
        Ok(Response::new(Box::pin(messages)))
    }
}

/// Everything that was ready, as one message.
fn merge(parts: Vec<SpectatorServiceWatchResponse>) -> SpectatorServiceWatchResponse {
    let mut whole = SpectatorServiceWatchResponse::default();
    for part in parts {
        whole.room = whole.room.or(part.room);
        whole.snapshot = whole.snapshot.or(part.snapshot);
        whole.events.extend(part.events);
    }
    whole
}
