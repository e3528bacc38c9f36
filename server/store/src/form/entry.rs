//! The entries of a journal.

use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_record::convert::seat_number;
use chefshat_record::outcome::is_by_fallback;
use prost::Message;

use super::{Unreadable, action, array};
use chefshat_room::ids::SecretHash;
use chefshat_room::journal::{
    AbortReason, Change, Decided, Entry, Marked, ParticipantKind, SeatedParticipant, Source,
};
use chefshat_wire::convert::{self, Deck};

/// Typical size of an encoded entry.
const TYPICAL_BYTES: usize = 32;

#[derive(Clone, PartialEq, Message)]
struct EntryForm {
    /// Microseconds since the room was created.
    #[prost(uint64, tag = "1")]
    at_us: u64,
    #[prost(
        oneof = "ChangeForm",
        tags = "2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18"
    )]
    change: Option<ChangeForm>,
}

#[derive(Clone, PartialEq, prost::Oneof)]
enum ChangeForm {
    #[prost(message, tag = "2")]
    Seated(SeatedForm),
    #[prost(uint32, tag = "3")]
    Vacated(u32),
    #[prost(message, tag = "4")]
    Started(StartedForm),
    #[prost(uint32, tag = "5")]
    Disconnected(u32),
    #[prost(uint32, tag = "6")]
    Returned(u32),
    #[prost(uint32, tag = "7")]
    Substituted(u32),
    #[prost(message, tag = "8")]
    Attempted(AttemptedForm),
    #[prost(message, tag = "9")]
    Decided(DecidedForm),
    #[prost(message, tag = "10")]
    Expressed(ExpressedForm),
    #[prost(uint32, tag = "11")]
    Aborted(u32),
    #[prost(bool, tag = "12")]
    ServerRestarted(bool),
    #[prost(message, tag = "13")]
    Reported(ReportedForm),
    #[prost(uint32, tag = "14")]
    Hinted(u32),
    #[prost(uint32, tag = "15")]
    Retired(u32),
    #[prost(message, tag = "16")]
    Marked(MarkedForm),
    #[prost(bool, tag = "17")]
    EndConfirmed(bool),
    #[prost(uint32, tag = "18")]
    DisconnectedWithNode(u32),
}

/// Whether these bytes are an entry of a kind that this version knows.
#[cfg(test)]
pub(super) fn is_known(bytes: &[u8]) -> bool {
    EntryForm::decode(bytes).is_ok_and(|entry| entry.change.is_some())
}

#[derive(Clone, PartialEq, Message)]
struct SeatedForm {
    #[prost(uint32, tag = "1")]
    seat: u32,
    #[prost(string, tag = "2")]
    name: String,
    #[prost(uint32, tag = "3")]
    kind: u32,
    #[prost(bytes = "vec", tag = "4")]
    ticket: Vec<u8>,
    #[prost(string, tag = "5")]
    name_fingerprint: String,
}

#[derive(Clone, PartialEq, Message)]
struct StartedForm {
    #[prost(bytes = "vec", repeated, tag = "1")]
    entropy: Vec<Vec<u8>>,
}

#[derive(Clone, PartialEq, Message)]
struct AttemptedForm {
    #[prost(uint32, tag = "1")]
    seat: u32,
    #[prost(uint32, tag = "2")]
    action: u32,
}

#[derive(Clone, PartialEq, Message)]
struct DecidedForm {
    #[prost(uint32, tag = "1")]
    seat: u32,
    #[prost(uint32, tag = "2")]
    action: u32,
    #[prost(uint32, tag = "3")]
    source: u32,
    #[prost(uint64, tag = "4")]
    time_us: u64,
    #[prost(uint32, tag = "5")]
    bank_left_ms: u32,
    #[prost(bytes = "vec", optional, tag = "6")]
    annotations: Option<Vec<u8>>,
}

#[derive(Clone, PartialEq, Message)]
struct ExpressedForm {
    #[prost(uint32, tag = "1")]
    seat: u32,
    #[prost(bool, tag = "2")]
    record_only: bool,
    #[prost(bytes = "vec", tag = "3")]
    expression: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct MarkedForm {
    #[prost(string, tag = "1")]
    label: String,
    #[prost(uint64, tag = "2")]
    moment_us: u64,
}

#[derive(Clone, PartialEq, Message)]
struct ReportedForm {
    #[prost(string, tag = "1")]
    id: String,
    /// Without the picture of a question.
    #[prost(message, optional, tag = "2")]
    report: Option<v1::TableReport>,
}

/// The numbers of kinds, sources and reasons. A released number never changes.
pub(super) const KINDS: [(u32, ParticipantKind); 4] = [
    (1, ParticipantKind::Agent),
    (2, ParticipantKind::Human),
    (3, ParticipantKind::Robot),
    (4, ParticipantKind::Model),
];
const SOURCES: [(u32, Source); 7] = [
    (1, Source::Agent),
    (2, Source::Timeout),
    (3, Source::Invalid),
    (4, Source::Disconnected),
    (5, Source::Substitute),
    (6, Source::Recorded),
    (7, Source::Table),
];
const REASONS: [(u32, AbortReason); 5] = [
    (1, AbortReason::Closed),
    (2, AbortReason::Shutdown),
    (3, AbortReason::ParticipantsLost),
    (4, AbortReason::NeverStarted),
    (5, AbortReason::TooLong),
];

pub(super) fn number_of<T: PartialEq>(table: &[(u32, T)], value: &T) -> u32 {
    (table.iter().find(|(_, known)| known == value))
        .map(|(number, _)| *number)
        .expect("every value has a number")
}

pub(super) fn value_of<T: Copy>(
    table: &[(u32, T)],
    number: u32,
    what: &str,
) -> Result<T, Unreadable> {
    (table.iter().find(|(known, _)| *known == number))
        .map(|(_, value)| *value)
        .ok_or_else(|| Unreadable::new(format!("{number} is not a known {what}")))
}

/// Encodes entries, and leaves `entries` empty.
pub(crate) fn entries_to_bytes(entries: &mut Vec<Entry>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(entries.len() * TYPICAL_BYTES);
    put_entries(entries, &mut bytes);
    bytes
}

/// Adds entries to a blob of entries, and leaves `entries` empty.
pub(crate) fn put_entries(entries: &mut Vec<Entry>, out: &mut Vec<u8>) {
    for entry in entries.drain(..) {
        put_entry(&entry, out);
    }
}

/// Adds an entry to a blob of entries.
pub(crate) fn put_entry(entry: &Entry, out: &mut Vec<u8>) {
    let change = match &entry.change {
        Change::Seated { seat, participant } => ChangeForm::Seated(SeatedForm {
            seat: seat_number(*seat),
            name: participant.name.clone(),
            kind: number_of(&KINDS, &participant.kind),
            ticket: participant.ticket.bytes().to_vec(),
            name_fingerprint: participant.name_fingerprint.clone(),
        }),
        Change::Vacated(seat) => ChangeForm::Vacated(seat_number(*seat)),
        Change::Started { entropy } => ChangeForm::Started(StartedForm {
            entropy: entropy.clone(),
        }),
        Change::Disconnected { seat, with_node } => match with_node {
            false => ChangeForm::Disconnected(seat_number(*seat)),
            true => ChangeForm::DisconnectedWithNode(seat_number(*seat)),
        },
        Change::Returned(seat) => ChangeForm::Returned(seat_number(*seat)),
        Change::Substituted(seat) => ChangeForm::Substituted(seat_number(*seat)),
        Change::Retired(seat) => ChangeForm::Retired(seat_number(*seat)),
        Change::Hinted(seat) => ChangeForm::Hinted(seat_number(*seat)),
        Change::Attempted { seat, action } => ChangeForm::Attempted(AttemptedForm {
            seat: seat_number(*seat),
            action: *action,
        }),
        Change::Decided(decided) => ChangeForm::Decided(DecidedForm {
            seat: seat_number(decided.seat),
            action: decided.action.index().into(),
            source: number_of(&SOURCES, &decided.source),
            time_us: decided.time_us,
            bank_left_ms: decided.bank_left_ms,
            annotations: decided.annotations.as_deref().map(<[u8]>::to_vec),
        }),
        Change::Expressed {
            seat,
            record_only,
            expression,
        } => ChangeForm::Expressed(ExpressedForm {
            seat: seat_number(*seat),
            record_only: *record_only,
            expression: expression.to_vec(),
        }),
        Change::Marked(marked) => ChangeForm::Marked(MarkedForm {
            label: marked.label.clone(),
            moment_us: u64::try_from(marked.moment.as_micros()).unwrap_or(u64::MAX),
        }),
        Change::Aborted(reason) => ChangeForm::Aborted(number_of(&REASONS, reason)),
        Change::ServerRestarted => ChangeForm::ServerRestarted(true),
        Change::EndConfirmed => ChangeForm::EndConfirmed(true),
        Change::Reported(reported) => ChangeForm::Reported(ReportedForm {
            id: reported.id.clone(),
            report: Some(convert::report_to_proto(reported, Deck::LARGEST)),
        }),
    };
    EntryForm {
        at_us: u64::try_from(entry.at.as_micros()).unwrap_or(u64::MAX),
        change: Some(change),
    }
    .encode_length_delimited(out)
    .expect("a vector grows as needed");
}

/// Appends the entries of a blob to `entries`.
///
/// # Errors
/// The first invalid entry.
pub(crate) fn read_entries(mut bytes: &[u8], entries: &mut Vec<Entry>) -> Result<(), Unreadable> {
    while !bytes.is_empty() {
        let form = EntryForm::decode_length_delimited(&mut bytes)?;
        let change = form
            .change
            .ok_or_else(|| Unreadable::new("an entry has an unknown kind"))?;
        entries.push(Entry {
            at: Duration::from_micros(form.at_us),
            change: change_from(change)?,
        });
    }
    Ok(())
}

/// Whether stored annotations say that the participant's fallback decided.
fn are_by_fallback(annotations: &[u8]) -> bool {
    v1::Annotations::decode(annotations).is_ok_and(|it| is_by_fallback(&it))
}

fn change_from(form: ChangeForm) -> Result<Change, Unreadable> {
    Ok(match form {
        ChangeForm::Seated(form) => Change::Seated {
            seat: seat(form.seat)?,
            participant: Box::new(SeatedParticipant {
                name: form.name,
                name_fingerprint: form.name_fingerprint,
                kind: value_of(&KINDS, form.kind, "kind of participant")?,
                ticket: SecretHash::from_bytes(array(&form.ticket, "a ticket's hash")?),
            }),
        },
        ChangeForm::Vacated(number) => Change::Vacated(seat(number)?),
        ChangeForm::Started(form) => Change::Started {
            entropy: form.entropy,
        },
        ChangeForm::Disconnected(number) => Change::Disconnected {
            seat: seat(number)?,
            with_node: false,
        },
        ChangeForm::DisconnectedWithNode(number) => Change::Disconnected {
            seat: seat(number)?,
            with_node: true,
        },
        ChangeForm::Returned(number) => Change::Returned(seat(number)?),
        ChangeForm::Substituted(number) => Change::Substituted(seat(number)?),
        ChangeForm::Retired(number) => Change::Retired(seat(number)?),
        ChangeForm::Hinted(number) => Change::Hinted(seat(number)?),
        ChangeForm::Attempted(form) => Change::Attempted {
            seat: seat(form.seat)?,
            action: form.action,
        },
        ChangeForm::Decided(form) => Change::Decided(Decided {
            seat: seat(form.seat)?,
            action: action(form.action)?,
            source: value_of(&SOURCES, form.source, "source of a decision")?,
            time_us: form.time_us,
            bank_left_ms: form.bank_left_ms,
            by_fallback: form.annotations.as_deref().is_some_and(are_by_fallback),
            annotations: form.annotations.map(Vec::into_boxed_slice),
        }),
        ChangeForm::Expressed(form) => Change::Expressed {
            seat: seat(form.seat)?,
            record_only: form.record_only,
            expression: form.expression.into_boxed_slice(),
        },
        ChangeForm::Marked(form) => Change::Marked(Box::new(Marked {
            label: form.label,
            moment: Duration::from_micros(form.moment_us),
        })),
        ChangeForm::Aborted(number) => {
            Change::Aborted(value_of(&REASONS, number, "reason of an abort")?)
        }
        ChangeForm::ServerRestarted(_) => Change::ServerRestarted,
        ChangeForm::EndConfirmed(_) => Change::EndConfirmed,
        ChangeForm::Reported(form) => {
            let report = form.report.unwrap_or_default();
            let reported = convert::reported_from_proto(&form.id, &report, Deck::LARGEST);
            Change::Reported(Box::new(
                reported.map_err(|problem| Unreadable::new(problem.to_string()))?,
            ))
        }
    })
}

fn seat(number: u32) -> Result<Seat, Unreadable> {
    usize::try_from(number)
        .ok()
        .filter(|index| *index < chefshat_engine::MAX_SEATS)
        .map(Seat::new)
        .ok_or_else(|| Unreadable::new(format!("{number} is not a seat")))
}
