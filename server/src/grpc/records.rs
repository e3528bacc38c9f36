//! `RecordService`: records of games that have ended.

use std::pin::Pin;
use std::sync::Arc;

use chefshat_proto::v1::{self, record_service_server::RecordService};
use futures::{Stream, StreamExt as _, stream};
use tokio::sync::Semaphore;
use tonic::{Code, Request, Response, Status};

use super::status::{room_failed, status};
use crate::config::MAX_RECORDS_IN_HAND;
use crate::convert::record_lines;
use crate::ids::Id;
use crate::rooms::Rooms;

/// Lines in one message: bounds it to well below what gRPC clients accept.
const LINES_PER_MESSAGE: usize = 512;

/// The service.
#[derive(Debug, Clone)]
pub struct Records {
    rooms: Arc<Rooms>,
    /// Records are large while they are put together: only so many at a time.
    turns: Arc<Semaphore>,
}

impl Records {
    /// The service for these rooms.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            turns: Arc::new(Semaphore::new(MAX_RECORDS_IN_HAND)),
        }
    }
}

#[tonic::async_trait]
impl RecordService for Records {
    type GetRecordStream =
        Pin<Box<dyn Stream<Item = Result<v1::GetRecordResponse, Status>> + Send>>;

    async fn get_record(
        &self,
        request: Request<v1::GetRecordRequest>,
    ) -> Result<Response<Self::GetRecordStream>, Status> {
        let unknown = || {
            status(
                Code::NotFound,
                "GAME_UNKNOWN",
                "the server holds no game of this id",
                [("field", "game_id")],
            )
        };
        let game = Id::parse(&request.into_inner().game_id).ok_or_else(unknown)?;
        if self.rooms.is_running(game) {
            return Err(status(
                Code::FailedPrecondition,
                "GAME_RUNNING",
                "this game has not ended; its record can be had when it has",
                [("field", "game_id")],
            ));
        }
        // Nobody closes it; if somebody did, the request would merely not wait.
        let _turn = self.turns.acquire().await.ok();
        let (header, journal) = self
            .rooms
            .finished(game)
            .await
            .map_err(|error| {
                tracing::error!(%game, %error, "a record was not read");
                room_failed()
            })?
            .ok_or_else(unknown)?;
        // Replaying a game takes milliseconds: not on a thread that serves others.
        let lines = tokio::task::spawn_blocking(move || record_lines(&header, &journal))
            .await
            .map_err(|error| {
                tracing::error!(%game, %error, "a record was not made");
                room_failed()
            })?;
        let messages = stream::iter(lines)
            .chunks(LINES_PER_MESSAGE)
            .map(|lines| Ok(v1::GetRecordResponse { lines }));
        Ok(Response::new(Box::pin(messages)))
    }
}
