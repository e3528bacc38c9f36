//! Physical tables: reporting what happens there, and following their state.

use futures::Stream;
use rand::TryRng as _;

use crate::backoff::Backoff;
use crate::client::Client;
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::Error;
use crate::repeat::repeated;
use crate::stream::Reconnecting;
use crate::v1::{self, table_service_client::TableServiceClient};

impl Client {
    /// Reports something that happened at a physical table. `table_ticket` comes from
    /// [`Client::create_room`], or from `GetPhysicalTable` of a tournament. If the response is lost,
    /// the call is repeated and reports nothing twice.
    ///
    /// If the rules or the cards do not allow a report, the call succeeds: see `verdict` and
    /// `detail`.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `REPORT_REFUSED` with the malformed field in the metadata,
    /// `GAME_NOT_STARTED`, `GAME_OVER`, `GAME_NOT_OVER`, `NOT_CORRECTABLE`, `NO_SUCH_OPTION`,
    /// `TOO_MANY_HELD_REPORTS`, `TOO_MANY_QUESTIONS`.
    ///
    /// # Panics
    /// If the operating system has no random bytes.
    pub async fn report(
        &self,
        table_ticket: impl Into<String>,
        report: v1::TableReport,
    ) -> Result<v1::ReportResponse, Error> {
        let mut id = [0; 16];
        rand::rngs::SysRng
            .try_fill_bytes(&mut id)
            .expect("the operating system gives random bytes");
        let id = id.map(|byte| format!("{byte:02x}")).concat();
        self.report_with_id(table_ticket, id, report).await
    }

    /// [`report`](Self::report) with an id of 1 to 64 characters, under which the same report can be
    /// sent again after an error.
    ///
    /// # Errors
    /// As [`report`](Self::report); `REPORT_ID_USED` if another report had the id.
    pub async fn report_with_id(
        &self,
        table_ticket: impl Into<String>,
        report_id: impl Into<String>,
        report: v1::TableReport,
    ) -> Result<v1::ReportResponse, Error> {
        let request = v1::ReportRequest {
            table_ticket: table_ticket.into(),
            report_id: report_id.into(),
            report: Some(report),
        };
        let service = service(self);
        repeated(|| async { service.clone().report(request.clone()).await }).await
    }

    /// Follows the state of a physical table. Connects when the first state is requested.
    pub fn follow_table(&self, table_ticket: impl Into<String>) -> TableFollower {
        TableFollower {
            service: service(self),
            table_ticket: table_ticket.into(),
            stream: Reconnecting::new(Backoff::default()),
            over: false,
        }
    }
}

/// Follows one table across lost connections; created by [`Client::follow_table`].
#[derive(Debug)]
pub struct TableFollower {
    service: TableServiceClient<Connection>,
    table_ticket: String,
    stream: Reconnecting<v1::TableServiceWatchResponse>,
    over: bool,
}

impl TableFollower {
    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.stream.set_backoff(backoff);
        self
    }

    /// The state of the table: at once, then after every change; `None` after the state in which
    /// the game is over. Cancel safe: dropping the future loses nothing.
    ///
    /// # Errors
    /// The server's refusal (`TICKET_UNKNOWN`, `TOO_MANY_SPECTATORS`), or the last failure if the
    /// connection cannot be restored in time. After an error there are no more states.
    pub async fn next(&mut self) -> Result<Option<v1::TableState>, Error> {
        if self.over {
            return Ok(None);
        }
        let watch = || {
            let (mut service, table_ticket) = (self.service.clone(), self.table_ticket.clone());
            let request = v1::TableServiceWatchRequest { table_ticket };
            async move { service.watch(request).await }
        };
        let state = self
            .stream
            .next_state(watch, |response| response.state)
            .await;
        self.over = (state.as_ref()).map_or(true, |it| it.stage() == v1::TableStage::Over);
        state.map(Some)
    }

    /// Converts the follower to a [`Stream`].
    pub fn into_stream(self) -> impl Stream<Item = Result<v1::TableState, Error>> + Send {
        futures::stream::try_unfold(self, |mut follower| async {
            let state = follower.next().await?;
            Ok(state.map(|state| (state, follower)))
        })
    }
}

fn service(client: &Client) -> TableServiceClient<Connection> {
    TableServiceClient::new(client.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES)
}
