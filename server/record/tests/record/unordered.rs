//! Signatures of records whose annotations have several keys: those of versions that wrote them in no
//! order, and those of this one.

use std::path::{Path, PathBuf};

use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::jsonl::{self, Record};
use chefshat_record::replay::{Replayed, walk_file};
use chefshat_record::signature::{PublicKey, Signed, SigningKey, check};
use chefshat_record::testing::{footer, header};
use prost::Message as _;
use ring::signature::Ed25519KeyPair;
use serde_json::Value;
use sha2::{Digest as _, Sha256};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/unordered")
}

/// What stands in `known.json` under a name.
fn known(name: &str) -> String {
    let text = std::fs::read_to_string(folder().join("known.json")).expect("the fixture");
    let known: Value = serde_json::from_str(&text).expect("JSON");
    known[name].as_str().expect("a text").to_owned()
}

fn path_of(name: &str) -> PathBuf {
    folder().join(format!("records/{}.jsonl", known(name)))
}

fn record(name: &str) -> Record {
    jsonl::read_record(&path_of(name)).expect("a record")
}

fn verified(record: &Record) -> Replayed {
    walk_file(record, |_| {}).expect("it replays")
}

fn annotations(lines: &mut [v1::RecordLine]) -> Vec<&mut v1::Annotations> {
    let decisions = lines.iter_mut().filter_map(|line| match &mut line.line {
        Some(Line::Decision(decision)) => decision.annotations.as_mut(),
        _ => None,
    });
    decisions.collect()
}

#[test]
fn records_signed_without_an_order_are_shown_to_be_honest_or_uncheckable() {
    let key: PublicKey = known("key").parse().expect("a key");
    for (name, signed_by, uncheckable) in [
        ("ordinary", Some(key), None),
        ("small", Some(key), None),
        ("large", None, Some(key)),
    ] {
        let replayed = verified(&record(name));
        assert_eq!(replayed.signed_by, signed_by, "{name}");
        assert_eq!(replayed.uncheckable, uncheckable, "{name}");
    }
}

#[test]
fn a_forgery_is_never_signed_and_a_later_signature_never_uncheckable() {
    let forge = |record: &mut Record| header(&mut record.lines).room_name = "forged".into();
    // Without maps there is one text.
    let mut ordinary = record("ordinary");
    forge(&mut ordinary);
    assert!(check(&ordinary.lines, None).is_err());
    // With few of them all texts are tried.
    let mut small = record("small");
    forge(&mut small);
    assert!(check(&small.lines, None).is_err());
    // With many, nobody can say.
    let mut large = record("large");
    forge(&mut large);
    let key = known("key").parse().expect("a key");
    assert_eq!(check(&large.lines, None), Ok(Signed::Uncheckable(key)));
    // It says so of signatures of its time alone.
    let set_version = |lines: &mut [v1::RecordLine], version| {
        let signature = footer(lines).signature.as_mut().expect("signed");
        signature.text_version = version;
    };
    set_version(&mut large.lines, 1);
    assert!(check(&large.lines, None).is_err());
    set_version(&mut large.lines, 2);
    let later = check(&large.lines, None).expect_err("unknown");
    assert!(later.contains("a later version"), "{later}");
}

#[test]
fn what_is_signed_is_the_text_of_the_file() {
    // The keys of each decision in the order that is not theirs, as a version before may have
    // written and signed them; too many to try.
    let mut unsigned = record("large");
    footer(&mut unsigned.lines).signature = None;
    let mut text = String::new();
    let mut digest = [0_u8; 32];
    let count = unsigned.lines.len();
    let key = Ed25519KeyPair::from_seed_unchecked(&[5; 32]).expect("a seed");
    for (index, line) in unsigned.lines.iter().enumerate() {
        let mut of_line = serde_json::to_string(line).expect("JSON");
        if let Some(Line::Decision(decision)) = &line.line
            && let Some(annotations) = &decision.annotations
        {
            let sorted = serde_json::to_string(&annotations.extra).expect("JSON");
            let entries: Vec<String> = (annotations.extra.iter().rev())
                .map(|entry| {
                    let json = |text: &String| serde_json::to_string(text).expect("JSON");
                    format!("{}:{}", json(entry.0), json(entry.1))
                })
                .collect();
            of_line = of_line.replace(&sorted, &format!("{{{}}}", entries.join(",")));
        }
        let hash = Sha256::new().chain_update(digest).chain_update(&of_line);
        digest = hash.finalize().into();
        if index + 1 < count {
            text.push_str(&of_line);
            text.push('\n');
        }
    }
    let signature = key.sign(&[b"chefshat.v1 record".as_slice(), &digest].concat());
    let public = SigningKey::from_seed(&[5; 32]).public();
    let mut signed = unsigned.clone();
    footer(&mut signed.lines).signature = Some(v1::RecordSignature {
        public_key: public.0.to_vec(),
        signature: signature.as_ref().to_vec(),
        text_version: 0,
    });
    let last = signed.lines.last().expect("a footer");
    text.push_str(&serde_json::to_string(last).expect("JSON"));
    text.push('\n');
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("signed.jsonl");
    std::fs::write(&path, &text).expect("written");
    let read = jsonl::read_record(&path).expect("read");
    assert_eq!(verified(&read).signed_by, Some(public));
    // Read without its text, it shows nothing; a copy keeps it.
    assert_eq!(check(&read.lines, None), Ok(Signed::Uncheckable(public)));
    let copy = folder.path().join("copies/copy.jsonl");
    jsonl::copy(&path, &copy).expect("copied");
    assert_eq!(std::fs::read_to_string(copy).expect("a file"), text);
}

#[test]
fn many_keys_survive_every_form() {
    let key = SigningKey::from_seed(&[7; 32]);
    let mut record = record("small");
    for annotations in annotations(&mut record.lines) {
        for number in 0..40 {
            let key = format!("{}", number * 37 % 40);
            annotations.extra.insert(key, "\"extra\":{\"a\":".into());
        }
    }
    key.sign_in_place(&mut record.lines);
    assert!(key.has_signed(&record.lines));
    // Sent and received, twice.
    let bytes: Vec<Vec<u8>> = record
        .lines
        .iter()
        .map(|line| line.encode_to_vec())
        .collect();
    let received: Vec<v1::RecordLine> = (bytes.iter())
        .map(|bytes| v1::RecordLine::decode(bytes.as_slice()).expect("a line"))
        .collect();
    let again: Vec<Vec<u8>> = received.iter().map(|line| line.encode_to_vec()).collect();
    assert_eq!(bytes, again);
    assert!(key.has_signed(&received));
    // Written and read.
    let folder = tempfile::tempdir().expect("a folder");
    let paths = ["one.jsonl", "two.jsonl"].map(|name| folder.path().join(name));
    jsonl::write(&paths[0], &record.lines).expect("written");
    let read = jsonl::read_record(&paths[0]).expect("read");
    assert_eq!(verified(&read).signed_by, Some(key.public()));
    jsonl::write(&paths[1], &received).expect("written");
    let [one, two] = paths.map(|path| std::fs::read(path).expect("a file"));
    assert_eq!(one, two);
}
