//! Whose data, and where they are: in a data directory, or on a running server.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use chefshat_record::pseudonym::{Named, is_fingerprint};
use chefshat_server::participants::{ParticipantData, Skipped};
use chefshat_server::signing::key_of;
use chefshat_server::store::{SqliteStore, Store as _};
use clap::Args;
use clap::builder::NonEmptyStringValueParser;

use crate::connect::ServerArg;
use crate::data_dir;
use crate::error::{CommandError, tell};

/// The participant, and the data directory or server.
#[derive(Args)]
pub(super) struct Who {
    /// The exact name the participant played under.
    #[arg(value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    pub(super) name: String,
    /// Of those who played under the name, only the one with this fingerprint of its key: 16
    /// hexadecimal digits, as the participant's page and `chefshat leaderboard --json` show; none:
    /// those without a key. Default: all of the name.
    #[arg(long, value_name = "DIGITS", value_parser = fingerprint)]
    fingerprint: Option<String>,
    /// Data directory of a server that is stopped. Default: chefshat in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Address of a running server, instead of a data directory; https:// for TLS. Needs a token
    /// with the role admin.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Token of the server's operator, from `chefshat token create --role admin`. CHEFSHAT_TOKEN
    /// does the same and does not show in lists of processes.
    #[arg(long, env = "CHEFSHAT_TOKEN", hide_env_values = true)]
    token: Option<String>,
    /// PEM file of the certificate authorities to trust, instead of the system's.
    #[arg(long, env = "CHEFSHAT_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
}

/// Leaves out the token.
impl fmt::Debug for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = (&self.server, &self.data_dir);
        f.debug_tuple("Who")
            .field(&self.named())
            .field(&place)
            .finish()
    }
}

impl Who {
    /// Whom the data are of.
    pub(super) fn named(&self) -> Named {
        Named {
            name: self.name.clone(),
            fingerprint: self.fingerprint.clone(),
        }
    }

    /// The running server, if one was named.
    pub(super) fn server(&self) -> Option<ServerArg> {
        let server = self.server.clone()?;
        Some(ServerArg::new(server, self.token.clone(), self.ca.clone()))
    }

    /// The data directory, which must exist.
    pub(super) fn data_dir(&self) -> Result<PathBuf, CommandError> {
        let folder = data_dir::name(self.data_dir.clone())?;
        if folder.is_dir() {
            Ok(folder)
        } else {
            let folder = folder.display();
            Err(format!("there is no data directory {folder}; choose another with --data-dir, or a running server with --server").into())
        }
    }

    /// Where the data are, in words.
    pub(super) fn place(&self) -> Result<String, CommandError> {
        match &self.server {
            Some(server) => Ok(server.clone()),
            None => Ok(self.data_dir()?.display().to_string()),
        }
    }

    /// Opens the data directory, does something with its data, and closes it.
    pub(super) async fn with_data<T>(
        &self,
        work: impl AsyncFnOnce(&ParticipantData) -> Result<T, CommandError>,
    ) -> Result<T, CommandError> {
        let data_dir = self.data_dir()?;
        let store = Arc::new(SqliteStore::open_for_deletion(&data_dir).await?);
        let key = key_of(&data_dir)?.map(Arc::new);
        let data = ParticipantData::new(Arc::clone(&store) as _, Some(data_dir)).signing_with(key);
        let done = work(&data).await;
        drop(data);
        store.close().await;
        done
    }
}

/// Reads a fingerprint; empty for a participant without a key.
fn fingerprint(text: &str) -> Result<String, &'static str> {
    match text {
        "none" => Ok(String::new()),
        digits if !digits.is_empty() && is_fingerprint(digits) => Ok(digits.to_owned()),
        _ => Err("give 16 hexadecimal digits (0-9, a-f), or none for a participant without a key"),
    }
}

/// Fails if files with the name were left as they are; warns of others.
pub(super) fn check(skipped: &Skipped, name: &str) -> Result<(), CommandError> {
    for why in &skipped.other {
        tell(format_args!(
            "chefshat: warning: skipped a file that cannot be read: {why}"
        ));
    }
    if skipped.named.is_empty() {
        return Ok(());
    }
    Err(format!(
        "done, except for files that contain {name:?} but could not be read or written: {}; repair or remove them (`chefshat verify` \
         shows what is wrong) and run the command again",
        skipped.named.join("; ")
    )
    .into())
}
