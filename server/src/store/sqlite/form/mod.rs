//! The form in which headers and journals stand in the database: protocol buffers of their own, so that neither a change of the engine's
//! types nor one of the protocol's messages touches what was kept. Fields are only ever added. Messages of the protocol that are the same
//! for good (rule sets, policies, annotations, expressions) are kept as they are.

mod entry;
mod header;
mod tournament;

use chefshat_engine::ActionId;
use chefshat_proto::v1;
use prost::Message as _;

pub(super) use entry::{put_entry, read_entries};
pub(super) use header::{header_from_bytes, header_to_bytes};
pub(super) use tournament::{
    tournament_entries_from_bytes, tournament_entries_to_bytes, tournament_from_bytes,
    tournament_to_bytes,
};

/// Version of the form.
pub(super) const FORM: i64 = 1;

/// Why something that was kept cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Unreadable(pub(super) String);

impl Unreadable {
    fn new(problem: impl Into<String>) -> Self {
        Self(problem.into())
    }
}

impl From<prost::DecodeError> for Unreadable {
    fn from(error: prost::DecodeError) -> Self {
        Self(error.to_string())
    }
}

/// The lines of an imported game as a blob.
pub(super) fn lines_to_bytes(lines: &[v1::RecordLine]) -> Vec<u8> {
    let mut out = Vec::new();
    for line in lines {
        line.encode_length_delimited(&mut out)
            .expect("a vector takes what is put in");
    }
    out
}

/// Reads the lines of an imported game.
///
/// # Errors
/// What is no line.
pub(super) fn lines_from_bytes(mut bytes: &[u8]) -> Result<Vec<v1::RecordLine>, Unreadable> {
    let mut lines = Vec::new();
    while !bytes.is_empty() {
        lines.push(v1::RecordLine::decode_length_delimited(&mut bytes)?);
    }
    Ok(lines)
}

fn action(number: u32) -> Result<ActionId, Unreadable> {
    u16::try_from(number)
        .map(ActionId::new)
        .map_err(|_| Unreadable::new(format!("{number} is no action")))
}

fn array<const N: usize>(bytes: &[u8], what: &str) -> Result<[u8; N], Unreadable> {
    bytes
        .try_into()
        .map_err(|_| Unreadable::new(format!("{what} has {} bytes, not {N}", bytes.len())))
}
