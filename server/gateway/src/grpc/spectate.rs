//! `SpectatorService`: watching a room without a seat.

use std::pin::Pin;
use std::sync::Arc;

use chefshat_proto::v1::SpectatorServiceWatchRequest;
use futures::{Stream, TryStreamExt as _};
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};

use super::access::opened;
use super::lookup::Lookup;
use super::status::{room_failed, room_gone, stream_ended};
use chefshat_admission::limits::Key;
use chefshat_base::metrics::StreamKind;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::room::SpectateRequest;
use chefshat_wire::encoded::Updates;
use chefshat_wire::encoded::service::spectator_service_server::SpectatorService;
use chefshat_wire::outbox::{Outbox, SPECTATOR_CAPACITY, StreamEnd};

/// The service.
#[derive(Debug, Clone)]
pub struct Spectate {
    lookup: Lookup,
    closing: CancellationToken,
}

impl Spectate {
    /// Creates the service for the rooms that callers reach; `closing` ends its streams.
    pub fn new(lookup: Lookup, closing: CancellationToken) -> Self {
        Self { lookup, closing }
    }
}

impl SpectatorService for Spectate {
    type WatchStream = Pin<Box<dyn Stream<Item = Result<Updates, Status>> + Send>>;

    async fn watch(
        &self,
        request: Request<SpectatorServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let (caller, request) = opened(request);
        let charged = Key::of_caller(&caller);
        let room = self.lookup.room(&caller, &request.room_id).await?;
        let header = self.lookup.rooms().header(room.id());
        let is_owner = header.is_some_and(|it| self.lookup.is_owner(&caller, &it));
        let (outbox, messages) = Outbox::with_capacity(SPECTATOR_CAPACITY);
        let from = request.from_sequence.saturating_sub(1);
        room.spectate(SpectateRequest {
            outbox: Arc::clone(&outbox),
            from: usize::try_from(from).unwrap_or(usize::MAX),
            snapshot: request.snapshot,
            is_owner,
            charged,
        })
        .await
        .map_err(room_failed(room_gone))?;
        let closing = self.closing.clone();
        let metrics = self.lookup.rooms().metrics();
        metrics.add_outbox(&outbox);
        let counted = metrics.stream(StreamKind::Spectate);
        tokio::spawn(named(LongTask::Spectate, async move {
            let _counted = counted;
            tokio::select! {
                () = outbox.abandoned() => {}
                () = closing.cancelled() => outbox.end(StreamEnd::Complete),
            }
        }));
        Ok(Response::new(Box::pin(messages.map_err(stream_ended))))
    }
}
