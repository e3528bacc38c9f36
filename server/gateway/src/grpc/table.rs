//! `TableService`: reports from physical tables, and their states.

use std::pin::Pin;

use chefshat_proto::v1::{self, table_service_server::TableService};
use futures::{Stream, stream};
use tokio::sync::watch;
use tonic::{Request, Response, Status};

use super::access::opened;
use super::lookup::Lookup;
use super::status::{room_failed, room_gone, table_unknown};
use chefshat_admission::access::Caller;
use chefshat_hosting::room::{Handle, SentState};
use chefshat_room::ids::Token;

/// The service.
#[derive(Debug, Clone)]
pub struct TableCalls {
    lookup: Lookup,
}

impl TableCalls {
    /// Creates the service for the tables of these rooms.
    pub fn new(lookup: Lookup) -> Self {
        Self { lookup }
    }

    /// The room of a table's ticket, and the ticket's secret.
    async fn find(&self, caller: &Caller, ticket: &str) -> Result<(Handle, [u8; 32]), Status> {
        let token = Token::parse(ticket).ok_or_else(table_unknown)?;
        let room = (self.lookup).room_of_ticket(caller, token.subject, table_unknown);
        let room = room.await?;
        Ok((room, token.secret))
    }
}

impl TableService for TableCalls {
    type WatchStream =
        Pin<Box<dyn Stream<Item = Result<v1::TableServiceWatchResponse, Status>> + Send>>;

    async fn report(
        &self,
        request: Request<v1::ReportRequest>,
    ) -> Result<Response<v1::ReportResponse>, Status> {
        let (caller, request) = opened(request);
        let (room, secret) = self.find(&caller, &request.table_ticket).await?;
        let ruled = room.report(secret, request).await;
        let response = ruled.map_err(room_failed(table_unknown))?;
        Ok(Response::new(*response))
    }

    async fn watch(
        &self,
        request: Request<v1::TableServiceWatchRequest>,
    ) -> Result<Response<Self::WatchStream>, Status> {
        let (caller, request) = opened(request);
        let (room, secret) = self.find(&caller, &request.table_ticket).await?;
        let watching = room.watch_table(secret).await;
        let states = watching.map_err(room_failed(table_unknown))?;
        Ok(Response::new(Box::pin(followed(states))))
    }
}

/// The states of a table until its game is over.
fn followed(
    states: watch::Receiver<SentState>,
) -> impl Stream<Item = Result<v1::TableServiceWatchResponse, Status>> {
    stream::unfold(Some(states), |states| async move {
        let mut states = states?;
        if states.changed().await.is_err() {
            return Some((Err(room_gone()), None));
        }
        let state = states.borrow_and_update().as_ref().clone();
        let over = state.stage() == v1::TableStage::Over;
        let response = v1::TableServiceWatchResponse { state: Some(state) };
        Some((Ok(response), (!over).then_some(states)))
    })
}
