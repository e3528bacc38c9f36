//! `chefshat health`: asks a server for its health, as containers do.

use std::process::ExitCode;

use clap::Args;
use serde_json::json;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use super::connect::ServerArg;
use super::{CommandError, say};

/// Check that a server answers and takes new games.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit code: 0 if the server is serving, 1 if it does not answer or is stopping. Needs no token.\n\n\
                  Example:\n  chefshat health --server http://127.0.0.1:50051"
)]
pub(super) struct Health {
    #[command(flatten)]
    server: ServerArg,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Health {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect().await?;
        let answer = HealthClient::new(client.channel())
            .check(HealthCheckRequest::default())
            .await
            .map_err(|status| format!("{}: {}", self.server.url(), status.message()))?;
        let status = answer.into_inner().status();
        if self.json {
            say(json!({ "status": status.as_str_name() }))?;
        } else {
            say(status.as_str_name())?;
        }
        Ok(match status {
            ServingStatus::Serving => ExitCode::SUCCESS,
            _ => ExitCode::FAILURE,
        })
    }
}
