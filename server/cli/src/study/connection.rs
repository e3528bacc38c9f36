//! The connection of the commands to the server's studies.

use chefshat_client::{Connection, Error, MAX_RESPONSE_BYTES};
use chefshat_proto::v1::study_service_client::StudyServiceClient;

use crate::CommandError;
use crate::connect::ServerArg;

/// The server's service for researchers.
pub(super) async fn service(
    server: &ServerArg,
) -> Result<StudyServiceClient<Connection>, CommandError> {
    let service = StudyServiceClient::new(server.connect().await?.channel());
    Ok(service.max_decoding_message_size(MAX_RESPONSE_BYTES))
}

/// A refusal, for people.
pub(super) fn refused(status: tonic::Status) -> CommandError {
    Error::from(status).into()
}
