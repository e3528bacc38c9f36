//! What a client can read: the rules, its own events, finished records. A record has the reasons of
//! decisions if the server shows them to this client (docs/access.md).

use chefshat_client::v1::{self, record_line::Line};
use rmcp::ErrorData;
use rmcp::model::{ReadResourceResult, Resource, ResourceContents, ResourceTemplate};

use super::seats::Seats;
use chefshat_cli::error::CommandError;
use chefshat_cli::language::REASON;
use chefshat_cli::language::events;
use chefshat_cli::narration::clean;
use chefshat_cli::narration::view::GameView;

const RULES: &str = "chefshat://rules";
const TABLES: &str = "chefshat://tables/";
const EVENTS: &str = "/events";
const RECORDS: &str = "chefshat://records/";
const COMPLETE: &str = ".jsonl";
/// Finished records that are listed: the newest ones.
const LISTED_RECORDS: u32 = 20;
/// Maximum characters of a reason in a record.
const MAX_REASON: usize = 1000;

/// The rules of the game.
const RULES_TEXT: &str = include_str!("../../../../docs/rules.md");

/// What can be read now. Without an answer of the server, it has no finished records.
pub(super) async fn all(seats: &Seats) -> Vec<Resource> {
    let mut all = vec![
        Resource::new(RULES, "rules")
            .with_description("The rules of Chef's Hat. Sections 1 to 6 are all you need to play.")
            .with_mime_type("text/markdown"),
    ];
    for (handle, _) in seats.listed() {
        let uri = format!("{TABLES}{handle}{EVENTS}");
        let about = "What has happened at this table, as your seat saw it.";
        all.push(text_resource(
            &uri,
            &format!("events of table {handle}"),
            about,
        ));
    }
    match records(seats).await {
        Ok(records) => all.extend(records.iter().map(record_resource)),
        Err(error) => tracing::warn!("finished records cannot be listed: {error}"),
    }
    all
}

/// What can be read with an id.
pub(super) fn templates() -> Vec<ResourceTemplate> {
    let template = |path: &str, name: &str, about: &str| {
        ResourceTemplate::new(path, name).with_description(about)
    };
    vec![
        template(
            &format!("{TABLES}{{table}}{EVENTS}"),
            "events of a table",
            "What has happened at a table, as your seat saw it.",
        )
        .with_mime_type("text/plain"),
        template(
            &format!("{RECORDS}{{game_id}}"),
            "finished record",
            "A finished game in words, with the reasons for decisions.",
        )
        .with_mime_type("text/plain"),
        template(
            &format!("{RECORDS}{{game_id}}{COMPLETE}"),
            "finished record, complete",
            "A finished game with all hands, as JSON Lines (long).",
        )
        .with_mime_type("application/jsonl"),
    ]
}

/// Reads a resource.
///
/// # Errors
/// There is no such resource, or the server does not answer.
pub(super) async fn read(seats: &Seats, uri: &str) -> Result<ReadResourceResult, ErrorData> {
    let (text, kind) = if uri == RULES {
        (RULES_TEXT.to_owned(), "text/markdown")
    } else if let Some(handle) = uri
        .strip_prefix(TABLES)
        .and_then(|it| it.strip_suffix(EVENTS))
    {
        let seat = seats
            .get(Some(handle))
            .map_err(|error| unknown(uri, &error))?;
        (
            seat.read(|live| events::history(&live.events)),
            "text/plain",
        )
    } else if let Some(game_id) = uri.strip_prefix(RECORDS) {
        let (game_id, complete) = match game_id.strip_suffix(COMPLETE) {
            Some(game_id) => (game_id, true),
            None => (game_id, false),
        };
        let lines = record(seats, game_id)
            .await
            .map_err(|error| unknown(uri, &error.to_string()))?;
        match complete {
            true => (
                as_json(&lines).map_err(|error| unknown(uri, &error.to_string()))?,
                "application/jsonl",
            ),
            false => (in_text(&lines), "text/plain"),
        }
    } else {
        return Err(unknown(
            uri,
            "resources/list and resources/templates/list name what there is",
        ));
    };
    let contents = ResourceContents::text(text, uri).with_mime_type(kind);
    Ok(ReadResourceResult::new(vec![contents]))
}

fn unknown(uri: &str, why: &str) -> ErrorData {
    ErrorData::resource_not_found(format!("{uri}: {why}"), None)
}

fn text_resource(uri: &str, name: &str, about: &str) -> Resource {
    Resource::new(uri, name)
        .with_description(about)
        .with_mime_type("text/plain")
}

fn record_resource(summary: &v1::RecordSummary) -> Resource {
    let names: Vec<String> = summary
        .seats
        .iter()
        .map(|seat| clean(&seat.name, 15))
        .collect();
    let about = format!("Finished game of {}.", names.join(", "));
    let uri = format!("{RECORDS}{}", summary.game_id);
    text_resource(&uri, &format!("record {}", summary.game_id), &about)
}

async fn records(seats: &Seats) -> Result<Vec<v1::RecordSummary>, CommandError> {
    let request = v1::ListRecordsRequest {
        page_size: LISTED_RECORDS,
        newest_first: true,
        ..v1::ListRecordsRequest::default()
    };
    Ok(seats.client().await?.list_records(request).await?.records)
}

async fn record(seats: &Seats, game_id: &str) -> Result<Vec<v1::RecordLine>, CommandError> {
    let client = seats.client_for(game_id).await?;
    Ok(client.record(game_id).await?)
}

fn as_json(lines: &[v1::RecordLine]) -> serde_json::Result<String> {
    let lines: Result<Vec<String>, _> = lines.iter().map(serde_json::to_string).collect();
    Ok(lines?.join("\n"))
}

/// A record in words: its events, and after a decision the reason for it.
fn in_text(lines: &[v1::RecordLine]) -> String {
    let mut view = GameView::default();
    let mut texts = Vec::new();
    let mut reason = None;
    for line in lines.iter().filter_map(|line| line.line.as_ref()) {
        match line {
            Line::Decision(decision) => {
                let extra = decision.annotations.as_ref().map(|it| &it.extra);
                reason = extra
                    .and_then(|extra| extra.get(REASON))
                    .map(|it| clean(it, MAX_REASON));
            }
            Line::Event(event) => {
                let mut event = events::advance(&mut view, None, event);
                if let Some(reason) = reason.take() {
                    event.words = format!("{} ({reason})", event.words);
                }
                texts.push(event);
            }
            _ => {}
        }
    }
    events::history(&texts)
}
