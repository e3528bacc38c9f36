//! Every map of the protocol is written in the order of its keys, and so always in the same bytes and
//! text: records are signed as they are written.

use std::collections::BTreeSet;

use chefshat_proto::v1;
use prost::Message;
use prost_types::FileDescriptorSet;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The generated code.
const GENERATED: [&str; 2] = [
    include_str!("../generated/chefshat.v1.rs"),
    include_str!("../generated/chefshat.v1.serde.rs"),
];

/// A map, and the check of its message.
type Row = (&'static str, fn());

/// Every map of the protocol, as message and field.
const MAPS: [Row; 4] = [
    ("Annotations.extra", || {
        check(|keys| v1::Annotations {
            extra: keys.map(|key| (key.clone(), key)).collect(),
            ..v1::Annotations::default()
        });
    }),
    ("GetServerInfoResponse.limits", || {
        check(|keys| v1::GetServerInfoResponse {
            limits: keys.map(|key| (key, 1)).collect(),
            ..v1::GetServerInfoResponse::default()
        });
    }),
    ("Refused.metadata", || {
        check(|keys| v1::Refused {
            metadata: keys.map(|key| (key.clone(), key)).collect(),
            ..v1::Refused::default()
        });
    }),
    ("StudyCondition.levels", || {
        check(|keys| v1::StudyCondition {
            levels: keys.map(|key| (key.clone(), key)).collect(),
            ..v1::StudyCondition::default()
        });
    }),
];

/// Keys in an order that is not theirs.
fn keys() -> Vec<String> {
    let key = |number: usize| format!("k{:02}", number * 37 % 64);
    (0..64).map(key).collect()
}

/// Checks a message that `with` makes of the keys of its map.
fn check<M>(with: fn(Box<dyn Iterator<Item = String>>) -> M)
where
    M: Message + Default + Serialize + DeserializeOwned,
{
    let mut sorted = keys();
    sorted.sort();
    let expected = with(Box::new(sorted.clone().into_iter()));
    let (bytes, text) = written(&expected);
    for shift in 0..64 {
        let mut shifted = keys();
        shifted.rotate_left(shift);
        let message = with(Box::new(shifted.into_iter()));
        assert_eq!(written(&message), (bytes.clone(), text.clone()));
        // As somebody receives it.
        let received = M::decode(bytes.as_slice()).expect("its own bytes");
        assert_eq!(written(&received), (bytes.clone(), text.clone()));
        let read: M = serde_json::from_str(&text).expect("its own text");
        assert_eq!(written(&read), (bytes.clone(), text.clone()));
    }
    let places: Vec<usize> = (sorted.iter())
        .map(|key| text.find(key.as_str()).expect("every key is written"))
        .collect();
    assert!(places.is_sorted(), "{text}");
}

fn written<M: Message + Serialize>(message: &M) -> (Vec<u8>, String) {
    let text = serde_json::to_string(message).expect("a message has a JSON form");
    (message.encode_to_vec(), text)
}

/// The fields of the protocol that are maps, by message and field.
fn maps() -> BTreeSet<String> {
    let set = FileDescriptorSet::decode(chefshat_proto::DESCRIPTORS).expect("descriptors");
    let own = (set.file.iter()).filter(|file| file.package().starts_with("chefshat"));
    let messages = own.flat_map(|file| &file.message_type);
    let fields = messages.flat_map(|message| {
        let is_entry = |name: &str| {
            (message.nested_type.iter()).any(|nested| {
                let options = nested.options.as_ref();
                options.is_some_and(|it| it.map_entry()) && name.ends_with(nested.name())
            })
        };
        let maps = message
            .field
            .iter()
            .filter(move |it| is_entry(it.type_name()));
        maps.map(|field| format!("{}.{}", message.name(), field.name()))
    });
    fields.collect()
}

#[test]
fn every_map_is_written_in_the_order_of_its_keys() {
    let tested: BTreeSet<String> = MAPS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(tested, maps(), "add a row for each map");
    for (_, check) in MAPS {
        check();
    }
}

#[test]
fn no_generated_type_has_an_order_of_its_own() {
    for code in GENERATED {
        assert!(!code.contains("HashMap"));
    }
    assert!(GENERATED[0].contains("btree_map"), "it has maps");
}
