//! Games stepped in batches: the stream of `VectorService`, without any interpretation of the
//! columns.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;

use crate::connection::MAX_RESPONSE_BYTES;
use crate::v1::run_request::Request;
use crate::v1::run_response::Response;
use crate::v1::vector_service_client::VectorServiceClient;
use crate::{ActionId, Client, Error, v1};

/// Games that a server steps for this client.
#[derive(Debug)]
pub struct VectorGames {
    requests: mpsc::Sender<v1::RunRequest>,
    responses: Streaming<v1::RunResponse>,
    started: v1::VectorStarted,
    records: Vec<v1::VectorRecord>,
    /// Whether the response to a cancelled call is still to come.
    given_up: bool,
}

impl Client {
    /// Starts games and returns their first batch.
    ///
    /// # Errors
    /// `SETUP_REFUSED`, `RULE_SET_REFUSED`, `SCRIPT_REFUSED`, `BRANCH_REFUSED`, `SEED_REFUSED`,
    /// `GAME_UNKNOWN` with the offending field in the metadata; `TOO_MANY_VECTOR_STREAMS`.
    pub async fn vector(
        &self,
        setup: v1::VectorSetup,
    ) -> Result<(VectorGames, Box<v1::VectorBatch>), Error> {
        // One request is in flight at a time.
        let (requests, stream) = mpsc::channel(1);
        send(&requests, Request::Setup(Box::new(setup))).await;
        let mut service = VectorServiceClient::new(self.channel())
            .max_decoding_message_size(MAX_RESPONSE_BYTES)
            .max_encoding_message_size(MAX_RESPONSE_BYTES);
        let mut responses = service.run(ReceiverStream::new(stream)).await?.into_inner();
        let Some(Response::Started(started)) = next(&mut responses).await? else {
            return Err(Error::incomplete("started"));
        };
        let mut games = VectorGames {
            requests,
            responses,
            started,
            records: Vec::new(),
            given_up: false,
        };
        let batch = games.batch().await?;
        Ok((games, batch))
    }
}

impl VectorGames {
    /// The setup as the server applied it.
    pub fn started(&self) -> &v1::VectorStarted {
        &self.started
    }

    /// Answers each row of the last batch, in order, and returns the next batch. Not cancel safe:
    /// dropping the future before the batch arrives ends the games, because it would be unknown
    /// which rows the next actions are for.
    ///
    /// # Errors
    /// `ACTIONS_REFUSED`, and `ILLEGAL_ACTION` if configured as an error; both end the games.
    /// `STEP_GIVEN_UP` after a dropped call.
    pub async fn step(
        &mut self,
        actions: impl IntoIterator<Item = ActionId>,
    ) -> Result<Box<v1::VectorBatch>, Error> {
        // An action beyond 16 bits is as illegal as the largest index.
        let column: Vec<u8> = (actions.into_iter())
            .flat_map(|action| u16::try_from(action.0).unwrap_or(u16::MAX).to_le_bytes())
            .collect();
        let actions = v1::VectorActions {
            actions: column.into(),
        };
        self.ask(Request::Actions(actions)).await
    }

    /// Abandons games and starts new ones in their place; returns the next batch. As cancel safe as
    /// [`step`](Self::step).
    ///
    /// # Errors
    /// `RESET_REFUSED`, which ends the games. `STEP_GIVEN_UP`.
    pub async fn reset(&mut self, reset: v1::VectorReset) -> Result<Box<v1::VectorBatch>, Error> {
        self.ask(Request::Reset(reset)).await
    }

    /// The states of these games, in any order: everything that determines how they continue,
    /// hidden cards included. The batch still requires a reply. As cancel safe as
    /// [`step`](Self::step).
    ///
    /// # Errors
    /// `STATES_REFUSED`, `STATES_TOO_LARGE`, which end the games. `STEP_GIVEN_UP`.
    pub async fn save(&mut self, games: &[u32]) -> Result<Vec<Vec<u8>>, Error> {
        if std::mem::replace(&mut self.given_up, true) {
            return Err(Error::step_given_up());
        }
        let games = column(games);
        send(&self.requests, Request::Save(v1::VectorSave { games })).await;
        let Some(Response::States(saved)) = next(&mut self.responses).await? else {
            return Err(Error::incomplete("states"));
        };
        self.given_up = false;
        Ok(saved.states)
    }

    /// Replaces these games, in ascending order, by saved ones, and returns the next batch. As
    /// cancel safe as [`step`](Self::step).
    ///
    /// # Errors
    /// `STATES_REFUSED`, which ends the games. `STEP_GIVEN_UP`.
    pub async fn restore(
        &mut self,
        games: &[u32],
        states: Vec<Vec<u8>>,
    ) -> Result<Box<v1::VectorBatch>, Error> {
        let games = column(games);
        self.ask(Request::Restore(v1::VectorRestore { games, states }))
            .await
    }

    /// The parts of records received since the last call, in order, if the setup requests records.
    /// They are stored until then.
    pub fn take_records(&mut self) -> Vec<v1::VectorRecord> {
        std::mem::take(&mut self.records)
    }

    async fn ask(&mut self, request: Request) -> Result<Box<v1::VectorBatch>, Error> {
        if std::mem::replace(&mut self.given_up, true) {
            return Err(Error::step_given_up());
        }
        send(&self.requests, request).await;
        let batch = self.batch().await?;
        self.given_up = false;
        Ok(batch)
    }

    async fn batch(&mut self) -> Result<Box<v1::VectorBatch>, Error> {
        loop {
            match next(&mut self.responses).await? {
                Some(Response::Batch(batch)) => return Ok(batch),
                Some(Response::Record(record)) => self.records.push(record),
                Some(Response::Started(_) | Response::States(_)) | None => {
                    return Err(Error::incomplete("batch"));
                }
            }
        }
    }
}

/// A column of u32.
fn column(numbers: &[u32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

async fn send(requests: &mpsc::Sender<v1::RunRequest>, request: Request) {
    let request = v1::RunRequest {
        request: Some(request),
    };
    // If the stream has ended, the next response says why.
    let _ = requests.send(request).await;
}

async fn next(responses: &mut Streaming<v1::RunResponse>) -> Result<Option<Response>, Error> {
    Ok(responses
        .message()
        .await?
        .and_then(|message| message.response))
}
