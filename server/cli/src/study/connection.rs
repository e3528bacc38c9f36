//! The connection of the commands to the server's studies.

use chefshat_client::{Connection, Error};
use chefshat_proto::v1::study_service_client::StudyServiceClient;

use crate::CommandError;
use crate::connect::ServerArg;

/// The server's service for researchers.
pub(super) async fn service(
    server: &ServerArg,
) -> Result<StudyServiceClient<Connection>, CommandError> {
    Ok(StudyServiceClient::new(server.connect().await?.channel()))
}

/// A refusal, for people.
pub(super) fn refused(status: tonic::Status) -> CommandError {
    Error::from(status).into()
}
