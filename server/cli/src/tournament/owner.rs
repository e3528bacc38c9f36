//! Commands for the owner of a tournament: `chefshat tournament start` and `close`.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_client::v1;
use clap::Args;

use super::super::connect::ServerArg;
use super::super::{CommandError, say};
use super::words::state;

/// The tournament and the proof of ownership.
#[derive(Debug, Args)]
pub(super) struct Owned {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    tournament_id: String,
    /// The secret printed by `tournament create`.
    #[arg(
        long,
        env = "CHEFSHAT_OWNER_TOKEN",
        hide_env_values = true,
        required_unless_present = "owner_file"
    )]
    owner_token: Option<String>,
    /// File with the secret, written by `tournament create`.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArg,
    /// Print the tournament as a JSON line.
    #[arg(long)]
    json: bool,
}

impl Owned {
    /// Starts the tournament with the participants who have joined.
    pub(super) async fn start(self) -> Result<ExitCode, CommandError> {
        let (token, client) = (self.token()?, self.server.connect().await?);
        let tournament = client
            .start_tournament(self.tournament_id.as_str(), token)
            .await?;
        self.print("started", &tournament)
    }

    /// Closes the tournament.
    pub(super) async fn close(self) -> Result<ExitCode, CommandError> {
        let (token, client) = (self.token()?, self.server.connect().await?);
        let tournament = client
            .close_tournament(self.tournament_id.as_str(), token)
            .await?;
        self.print("closed", &tournament)
    }

    /// The owner token; the file has priority over the environment.
    fn token(&self) -> Result<String, CommandError> {
        match (&self.owner_file, &self.owner_token) {
            (Some(file), _) => std::fs::read_to_string(file)
                .map(|text| text.trim().to_owned())
                .map_err(|error| format!("--owner-file: {}: {error}", file.display()).into()),
            (None, Some(token)) => Ok(token.clone()),
            (None, None) => Err("give --owner-token or --owner-file".into()),
        }
    }

    fn print(&self, event: &str, tournament: &v1::Tournament) -> Result<ExitCode, CommandError> {
        if self.json {
            say(serde_json::json!({"event": event, "tournament": tournament}))?;
        } else {
            let (id, state) = (&tournament.tournament_id, state(tournament.state()));
            say(format_args!("tournament {id} is {state}"))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
