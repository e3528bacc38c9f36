//! The encoding of headers and journals in the database: separate protocol buffers, so that stored
//! games do not depend on the engine's types or the protocol's messages. Fields are only ever
//! added. Messages of the protocol that only grow (rule sets, policies, annotations, expressions) are
//! stored as they are, and so are the changes of a study, whose core gives their fields their numbers.

mod entry;
#[cfg(test)]
mod forms;
mod header;
mod signature;
mod study;
mod tournament;
mod unit;

use chefshat_engine::ActionId;
use chefshat_proto::v1;
use prost::Message;

#[cfg(test)]
pub(super) use entry::put_entry;
pub(super) use entry::{entries_to_bytes, put_entries, read_entries};
pub(super) use header::{
    OWNER_WITHIN, header_from_bytes, header_to_bytes, stored_header, stored_owner, stored_unit,
};
pub(super) use signature::{signature_from_bytes, signature_to_bytes};
pub use study::changes_to_bytes;
pub(super) use study::traces_to_bytes;
pub(super) use tournament::{tournament_entries_from_bytes, tournament_from_bytes};

/// Version of the encoding. It is raised by every new kind of entry and every new field, so that nodes
/// of the version before leave alone what they would read without it; `forms.rs` knows what each
/// version has.
///
/// 2: absence times; participants who leave during a game; tournaments that are changed by hand.
/// 3: the confirmed end of a game at a physical table; connections that are lost with a node;
/// participants who join a study by its open link; devices and sessions of a study; steps that its
/// participants pass over; its test participants, its groups, and those who are screened out.
pub(super) const FORM: i64 = 3;
/// The oldest version that this one reads.
const OLDEST_FORM: i64 = 1;

/// Why stored data cannot be read.
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

/// Checks that this version reads an encoding.
///
/// # Errors
/// It does not.
pub(super) fn check_form(form: i64) -> Result<(), Unreadable> {
    if (OLDEST_FORM..=FORM).contains(&form) {
        Ok(())
    } else {
        let problem =
            format!("it has encoding {form}; this version reads encodings {OLDEST_FORM} to {FORM}");
        Err(Unreadable(problem))
    }
}

/// Encodes the lines of an imported game.
pub(super) fn lines_to_bytes(lines: &[v1::RecordLine]) -> Vec<u8> {
    let mut out = Vec::new();
    for line in lines {
        line.encode_length_delimited(&mut out)
            .expect("a vector grows as needed");
    }
    out
}

/// Decodes the lines of an imported game.
///
/// # Errors
/// An invalid line.
pub(super) fn lines_from_bytes(bytes: &[u8]) -> Result<Vec<v1::RecordLine>, Unreadable> {
    read_messages(bytes, Ok)
}

/// Reads messages that stand one after another, each behind its length.
fn read_messages<M: Message + Default, T>(
    mut bytes: &[u8],
    read: impl Fn(M) -> Result<T, Unreadable>,
) -> Result<Vec<T>, Unreadable> {
    let mut values = Vec::new();
    while !bytes.is_empty() {
        values.push(read(M::decode_length_delimited(&mut bytes)?)?);
    }
    Ok(values)
}

fn action(number: u32) -> Result<ActionId, Unreadable> {
    u16::try_from(number)
        .map(ActionId::new)
        .map_err(|_| Unreadable::new(format!("{number} is not an action")))
}

fn array<const N: usize>(bytes: &[u8], what: &str) -> Result<[u8; N], Unreadable> {
    bytes
        .try_into()
        .map_err(|_| Unreadable::new(format!("{what} has {} bytes, not {N}", bytes.len())))
}
