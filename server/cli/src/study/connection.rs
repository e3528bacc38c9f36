//! The connection of the commands to the server's studies.

use chefshat_client::{Connection, Error, MAX_RESPONSE_BYTES, repeated};
use chefshat_proto::v1;
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

/// A study and its participants.
pub(super) async fn get_study(
    service: &StudyServiceClient<Connection>,
    study_id: &str,
    owner_token: &str,
) -> Result<v1::GetStudyResponse, Error> {
    let request = v1::GetStudyRequest {
        study_id: study_id.to_owned(),
        owner_token: owner_token.to_owned(),
    };
    repeated(|| async { service.clone().get_study(request.clone()).await }).await
}

/// A refusal, for people.
pub(super) fn refused(status: tonic::Status) -> CommandError {
    Error::from(status).into()
}
