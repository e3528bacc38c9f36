//! What each version of the encoding has: a node of a cluster takes over what has its own version or an
//! older one, and would silently lose what it does not know. Nested forms are covered by the fixtures
//! of `sqlite`, whose bytes do not change.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use prost::Message as _;
use prost::encoding::{WireType, encode_key};
use prost_types::FileDescriptorSet;

use super::{FORM, entry, study, tournament};

/// The messages of the protocol that are stored as they are.
const STORED: [&str; 10] = [
    "Annotations",
    "Expression",
    "GameStart",
    "RoomPolicy",
    "RuleSet",
    "SeatConfig",
    "StudySettings",
    "StudyTrace",
    "TableReport",
    "TournamentSettings",
];
/// Numbers of fields that are tried.
const NUMBERS: std::ops::Range<u32> = 1..1_000;

/// The numbers of the kinds of entries that can be read.
fn kinds(is_known: fn(&[u8]) -> bool) -> String {
    let known = NUMBERS.filter(|number| {
        [WireType::Varint, WireType::LengthDelimited]
            .into_iter()
            .any(|wire_type| {
                let mut bytes = Vec::new();
                encode_key(*number, wire_type, &mut bytes);
                // The number 0, or nothing.
                bytes.push(0);
                is_known(&bytes)
            })
    });
    list(known)
}

fn list(numbers: impl IntoIterator<Item = impl ToString>) -> String {
    let numbers: Vec<_> = numbers.into_iter().map(|it| it.to_string()).collect();
    numbers.join(" ")
}

/// The numbers of the fields or values of what is stored, by the name of each message and enum.
fn stored_messages() -> BTreeMap<String, String> {
    let set = FileDescriptorSet::decode(chefshat_proto::DESCRIPTORS).expect("descriptors");
    let (mut messages, mut enums) = (BTreeMap::new(), BTreeMap::new());
    for file in &set.file {
        for message in &file.message_type {
            let nested = message.nested_type.iter();
            for message in nested.chain([message]) {
                messages.insert(message.name().to_owned(), message);
            }
        }
        for it in &file.enum_type {
            enums.insert(it.name().to_owned(), it);
        }
    }
    let mut stored = BTreeMap::new();
    let mut left: BTreeSet<String> = STORED.map(str::to_owned).into();
    while let Some(name) = left.pop_first() {
        let mut numbers = BTreeSet::new();
        if let Some(it) = enums.get(&name) {
            numbers.extend(it.value.iter().map(|value| value.number()));
        } else {
            let message = messages
                .get(&name)
                .unwrap_or_else(|| panic!("{name} exists"));
            for field in &message.field {
                numbers.insert(field.number());
                // Others, such as google.protobuf.Timestamp, do not change.
                let own = field.type_name().strip_prefix(".chefshat.v1.");
                let part = own.and_then(|own| own.rsplit('.').next());
                let new = part.filter(|part| !stored.contains_key(*part));
                left.extend(new.map(str::to_owned));
            }
        }
        stored.insert(name, list(numbers));
    }
    stored
}

#[test]
fn what_is_stored_is_what_its_version_says() {
    let mut text = format!("entries of games: {}\n", kinds(entry::is_known));
    for (what, is_known) in [
        (
            "entries of tournaments",
            tournament::is_known as fn(&[u8]) -> bool,
        ),
        ("changes of studies", study::is_known),
    ] {
        writeln!(text, "{what}: {}", kinds(is_known)).expect("memory");
    }
    for (name, numbers) in stored_messages() {
        writeln!(text, "{name}: {numbers}").expect("memory");
    }
    let file = format!("src/form/form{FORM}.txt");
    let known = Path::new(env!("CARGO_MANIFEST_DIR")).join(&file);
    let known = std::fs::read_to_string(known).unwrap_or_default();
    assert!(
        text == known,
        "if a version of the program that stores form {FORM} may be running somewhere, raise FORM, \
         and add fixtures of that form; then server/store/{file} should have:\n{text}"
    );
}
