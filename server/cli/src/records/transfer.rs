//! `chefshat records get`, `stream` and `import`: transfers records between a server and files,
//! which are written atomically.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_client::v1::record_service_client::RecordServiceClient;
use chefshat_client::v1::{self, RecordLine, record_line::Line};
use chefshat_client::{Client, Connection, Error};
use chefshat_record::jsonl;
use clap::Args;
use indicatif::ProgressBar;
use prost::Message as _;
use tonic::{Code, Response, Status};
use tonic_types::StatusExt as _;

use super::super::connect::{SecretArgs, ServerArg};
use super::super::error::{is_broken_pipe, tell};
use super::super::numbers::counted;
use super::super::{CommandError, progress, say};
use super::filter::FilterArgs;
use super::list::in_a_line;

/// Maximum size of a response in bytes: a part of a record.
const MAX_RESPONSE_BYTES: usize = 16 * 1024 * 1024;
/// Bytes of lines per message: half of the server's limit.
const PART_BYTES: usize = 32 * 1024;
/// Maximum number of times that a record is sent.
const MAX_ATTEMPTS: u32 = 60;

/// Download the record of one game.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat records get 5f0c6a4de2b14b7f8a3d9c1e7b60425d --out game.jsonl"
)]
pub(super) struct Get {
    /// ID of the game.
    #[arg(value_name = "GAME-ID")]
    game_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// File to write. Default: standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Download many records, oldest first.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat records stream --state finished --out-dir ./games\n  \
                  chefshat records stream --room-name friday > friday.jsonl\n  \
                  chefshat records stream --out-dir ./games --after 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n\n\
                  Exit code 0: all records arrived. 1: the server could not read some, which are named, or the download broke off."
)]
pub(super) struct Stream {
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    #[command(flatten)]
    filter: FilterArgs,
    /// Directory to write to, one file GAME-ID.jsonl per record. Default: standard output, one
    /// record after the other.
    #[arg(long, value_name = "FOLDER")]
    out_dir: Option<PathBuf>,
    /// Resume an interrupted download: only the records after that of this game, the last one that
    /// arrived.
    #[arg(
        long,
        value_name = "GAME-ID",
        default_value = "",
        hide_default_value = true
    )]
    after: String,
}

/// Import records of games played elsewhere: on another server or at a physical table. The server
/// verifies them first and must have been started with --allow-import. Games that it already has are
/// skipped, so an import that broke off can be repeated.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  chefshat records import ./game.jsonl ./games/*.jsonl")]
pub(super) struct Import {
    /// The records to import.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    server: ServerArg,
    /// Print each record's summary as a JSON line.
    #[arg(long)]
    json: bool,
}

/// What has arrived of a stream.
#[derive(Default)]
struct Received {
    count: u64,
    /// The game of the last record.
    last: String,
    /// What the server could not read.
    unreadable: Vec<v1::UnreadableRecord>,
}

impl Get {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let lines = client.record(self.game_id).await?;
        match &self.out {
            Some(file) => jsonl::write(file, &lines)?,
            None => print(&lines)?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

impl Stream {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let request = v1::StreamRecordsRequest {
            filter: Some(self.filter.message()),
            after: self.after.clone(),
        };
        let mut received = Received {
            last: self.after.clone(),
            ..Received::default()
        };
        let bar = progress::styled(
            ProgressBar::no_length(),
            "{spinner} {human_pos} records, {per_sec}",
        );
        let streamed = self.receive(&client, request, &mut received, &bar).await;
        bar.finish_and_clear();
        if let Some(folder) = &self.out_dir {
            let records = counted(received.count, "record");
            say(format_args!("{records} in {}", folder.display()))?;
        }
        for record in &received.unreadable {
            tell(format_args!(
                "not received: {}: {}",
                record.game_id, record.problem
            ));
        }
        if let Err(error) = streamed {
            return Err(match received.last.as_str() {
                "" => error,
                _ if is_broken_pipe(&error) => error,
                last => format!("{error}\nresume with --after {last}").into(),
            });
        }
        Ok(match received.unreadable.is_empty() {
            true => ExitCode::SUCCESS,
            false => ExitCode::FAILURE,
        })
    }

    /// Keeps what the server sends, up to the end of the stream.
    async fn receive(
        &self,
        client: &Client,
        request: v1::StreamRecordsRequest,
        received: &mut Received,
        bar: &ProgressBar,
    ) -> Result<(), CommandError> {
        let mut parts = (service(client).stream_records(request).await)
            .map_err(Error::from)?
            .into_inner();
        let mut record: Vec<RecordLine> = Vec::new();
        while let Some(part) = parts.message().await.map_err(Error::from)? {
            received.unreadable.extend(part.unreadable);
            for line in part.lines {
                let last = matches!(line.line, Some(Line::Footer(_)));
                record.push(line);
                if last {
                    received.last = self.keep(&std::mem::take(&mut record))?;
                    received.count += 1;
                    bar.inc(1);
                }
            }
        }
        match record.is_empty() {
            true => Ok(()),
            false => Err("the server ended the stream in the middle of a record".into()),
        }
    }

    /// Writes a record. Returns the id of its game.
    fn keep(&self, record: &[RecordLine]) -> Result<String, CommandError> {
        let Some(Line::Header(header)) = record.first().and_then(|line| line.line.as_ref()) else {
            return Err("the server sent a record without a header".into());
        };
        // The ID becomes a file name: do not trust the server.
        if header.game_id.len() != 32
            || !header.game_id.bytes().all(|byte| byte.is_ascii_hexdigit())
        {
            return Err(format!("the server sent a record of a game {:?}", header.game_id).into());
        }
        match &self.out_dir {
            None => print(record)?,
            Some(folder) => {
                jsonl::write(&folder.join(format!("{}.jsonl", header.game_id)), record)?;
            }
        }
        Ok(header.game_id.clone())
    }
}

impl Import {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect().await?;
        let service = service(&client);
        let bar = progress::of_items(self.files.len() as u64, "records");
        let mut failed = 0;
        let mut not_imported = |problem: &dyn std::fmt::Display| {
            bar.suspend(|| tell(format_args!("not imported: {problem}")));
            bar.inc(1);
            failed += 1;
        };
        for file in &self.files {
            // One that is damaged or refused ends no import of the others.
            let lines = match jsonl::read(file) {
                Ok(lines) => lines,
                Err(problem) => {
                    not_imported(&problem);
                    continue;
                }
            };
            let parts = in_parts(lines);
            let send = || {
                let (mut service, parts) = (service.clone(), tokio_stream::iter(parts.clone()));
                async move { service.import_record(parts).await }
            };
            let added = match when_allowed(send).await {
                Ok(added) => added,
                Err(status) => {
                    let error = Error::from(status);
                    // As when an import that broke off is begun again.
                    if error.reason() == Some("GAME_KNOWN") {
                        let file = file.display();
                        bar.suspend(|| tell(format_args!("already there: {file}")));
                        bar.inc(1);
                        continue;
                    }
                    let refused = refused(file, &error);
                    if !is_about_record(&error) {
                        return Err(refused);
                    }
                    not_imported(&refused);
                    continue;
                }
            };
            let summary = (added.into_inner().record)
                .ok_or("the server did not return the imported record")?;
            let line = if self.json {
                serde_json::to_string(&summary)?
            } else {
                in_a_line(&summary)
            };
            bar.suspend(|| say(line))?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(match failed {
            0 => ExitCode::SUCCESS,
            _ => ExitCode::FAILURE,
        })
    }
}

/// Sends a request, and again when the server says that it may be: a server limits what it stores for
/// a caller in a second.
async fn when_allowed<T, F>(send: impl Fn() -> F) -> Result<Response<T>, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let mut attempt = 1;
    loop {
        let status = match send().await {
            Ok(response) => return Ok(response),
            Err(status) => status,
        };
        let retry = status.get_details_retry_info();
        match retry.and_then(|retry| retry.retry_delay) {
            Some(delay) if attempt < MAX_ATTEMPTS => tokio::time::sleep(delay).await,
            _ => return Err(status),
        }
        attempt += 1;
    }
}

/// Whether a refusal is about the record alone, so that the server may accept another.
fn is_about_record(error: &Error) -> bool {
    matches!(
        error.code(),
        Code::InvalidArgument | Code::AlreadyExists | Code::OutOfRange
    ) || error.reason() == Some("RECORD_TOO_LARGE")
}

fn service(client: &Client) -> RecordServiceClient<Connection> {
    RecordServiceClient::new(client.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES)
}

fn refused(file: &Path, error: &Error) -> CommandError {
    let (name, message) = (file.display(), error.message());
    match error.reason() {
        Some("IMPORT_OFF") => format!(
            "{name}: {message}; its host can allow imports with `chefshat serve --allow-import`"
        )
        .into(),
        _ => format!("{name}: {message}").into(),
    }
}

/// The lines of a record in messages within the server's limit.
fn in_parts(lines: Vec<RecordLine>) -> Vec<v1::ImportRecordRequest> {
    let mut parts: Vec<v1::ImportRecordRequest> = Vec::new();
    let mut room = 0;
    for line in lines {
        let size = line.encoded_len();
        match parts.last_mut() {
            Some(part) if size <= room => part.lines.push(line),
            _ => {
                room = PART_BYTES;
                parts.push(v1::ImportRecordRequest { lines: vec![line] });
            }
        }
        room = room.saturating_sub(size);
    }
    parts
}

/// Writes a record to standard output.
fn print(lines: &[RecordLine]) -> Result<(), CommandError> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    for line in lines {
        serde_json::to_writer(&mut out, line).map_err(io::Error::from)?;
        out.write_all(b"\n")?;
    }
    Ok(out.flush()?)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::time::Duration;

    use tonic_types::ErrorDetails;

    use crate::records::transfer::*;

    /// A server that refuses a request this many times, and names a time to try again.
    async fn sent_to_a_busy_server(refusals: u32) -> Result<u32, Status> {
        let sent = Cell::new(0);
        let response = when_allowed(|| {
            sent.set(sent.get() + 1);
            std::future::ready(match sent.get() {
                number if number > refusals => Ok(Response::new(number)),
                _ => {
                    let details = ErrorDetails::with_retry_info(Some(Duration::from_millis(1)));
                    let code = Code::ResourceExhausted;
                    Err(Status::with_error_details(code, "too many bytes", details))
                }
            })
        });
        response.await.map(Response::into_inner)
    }

    #[tokio::test]
    async fn a_record_is_sent_again_when_the_server_says_that_it_may_be() {
        let sent = sent_to_a_busy_server(3).await;
        assert_eq!(sent.expect("the fourth one"), 4);
        let refused = sent_to_a_busy_server(MAX_ATTEMPTS).await;
        refused.expect_err("given up");
        let full = || std::future::ready(Err::<Response<()>, _>(Status::data_loss("full")));
        when_allowed(full).await.expect_err("no time to try again");
    }

    #[test]
    fn a_record_is_sent_whole_and_in_parts_that_fit() {
        let line = |bytes: usize| RecordLine {
            line: Some(Line::Header(Box::new(v1::RecordHeader {
                room_name: "x".repeat(bytes),
                ..v1::RecordHeader::default()
            }))),
        };
        let lines: Vec<RecordLine> = [10, 31_000, 900, 20_000, 40_000, 5, 5].map(line).into();
        let parts = in_parts(lines.clone());
        let counts: Vec<usize> = parts.iter().map(|part| part.lines.len()).collect();
        assert_eq!(counts, [3, 1, 1, 2]);
        let sent: Vec<RecordLine> = parts.into_iter().flat_map(|part| part.lines).collect();
        assert_eq!(sent, lines);
        assert!(in_parts(Vec::new()).is_empty());
    }
}
