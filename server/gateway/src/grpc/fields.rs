//! Fields that several requests have, checked.

use chefshat_room::ids::request_id_of;
use chefshat_room::journal::ParticipantKind;
use tonic::Status;

use super::status::{field, invalid};
use chefshat_admission::access::Caller;
use chefshat_wire::convert::{self, Mirrored as _};

/// A name with at least `shortest` characters.
pub(super) fn checked_name(
    name: &'static str,
    text: &str,
    shortest: usize,
) -> Result<String, Status> {
    let checked = convert::checked_name(name, text, shortest);
    checked.map_err(|problem| field("NAME_REFUSED", &problem))
}

/// The kind of a participant; `None` if unspecified.
pub(super) fn checked_kind(kind: i32) -> Result<Option<ParticipantKind>, Status> {
    let checked = ParticipantKind::from_proto("kind", kind);
    checked.map_err(|problem| field("KIND_REFUSED", &problem))
}

/// A field of 32 bytes that its sender draws, if set.
pub(super) fn drawn(
    reason: &str,
    name: &'static str,
    bytes: &[u8],
) -> Result<Option<[u8; 32]>, Status> {
    if bytes.is_empty() {
        return Ok(None);
    }
    bytes.try_into().map(Some).map_err(|_| {
        let problem = format!("{} bytes; give 32 random ones, or none", bytes.len());
        invalid(reason, name, problem)
    })
}

/// The id of a request, if set, as it counts for its caller: the answer to a repeated request
/// contains secrets, and another token does not get them. Callers without a token are not told apart
/// by their addresses, because a client that repeats a request may have another one by then.
pub(super) fn request_id(bytes: &[u8], caller: &Caller) -> Result<Option<[u8; 32]>, Status> {
    let id = drawn("REQUEST_ID_REFUSED", "request_id", bytes)?;
    Ok(id.map(|id| match &caller.token_hash {
        Some(token) => request_id_of(&id, token),
        None => id,
    }))
}

/// The fingerprint of a name and its key; empty without a key.
pub(super) fn name_fingerprint(name: &str, key: &[u8]) -> Result<String, Status> {
    let key = drawn("NAME_KEY_REFUSED", "name_key", key)?;
    Ok(key.map_or_else(String::new, |key| convert::name_fingerprint(name, &key)))
}
