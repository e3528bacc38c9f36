//! The text that is signed: the canonical lines of a record without its signature, and their hash.

use chefshat_proto::v1::{self, record_line::Line};
use sha2::{Digest as _, Sha256};

/// Precedes the hash in what is signed, so that a signature cannot be taken for one of another kind.
const DOMAIN: &[u8] = b"chefshat.v1 record";

/// The signature in a footer.
pub(super) fn signature_of(line: &v1::RecordLine) -> Option<&v1::RecordSignature> {
    match &line.line {
        Some(Line::Footer(footer)) => footer.signature.as_ref(),
        _ => None,
    }
}

/// The hash of the text of a record's lines: what is signed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TextHash(pub(super) [u8; 32]);

impl TextHash {
    /// The bytes of the hash.
    pub fn bytes(self) -> [u8; 32] {
        self.0
    }

    /// The hash of a record in its canonical text.
    pub(super) fn of(lines: &[v1::RecordLine]) -> Self {
        (lines.iter()).fold(Self::default(), |hash, line| hash.and_line(line))
    }

    /// Adds the next line of a record in its canonical text.
    pub(super) fn and_line(self, line: &v1::RecordLine) -> Self {
        let mut text = Vec::new();
        write_text(line, &mut text);
        self.and(&text)
    }

    /// Adds a line as it stands in a file. The footer has no map, so that its text without the
    /// signature is the canonical one.
    pub(crate) fn and_read(self, line: &v1::RecordLine, text: &[u8]) -> Self {
        match signature_of(line) {
            None => self.and(text),
            Some(_) => self.and_line(line),
        }
    }

    /// Adds the text of a line.
    pub(super) fn and(self, text: &[u8]) -> Self {
        let hash = Sha256::new().chain_update(self.0).chain_update(text);
        Self(hash.finalize().into())
    }

    /// What is signed.
    pub(super) fn message(self) -> Vec<u8> {
        [DOMAIN, &self.0].concat()
    }
}

/// Writes the text of a line that is signed: canonical, and without a signature.
pub(super) fn write_text(line: &v1::RecordLine, text: &mut Vec<u8>) {
    let unsigned = signature_of(line).map(|_| without_signature(line));
    serde_json::to_writer(text, unsigned.as_ref().unwrap_or(line))
        .expect("a line of a record has a JSON form");
}

fn without_signature(line: &v1::RecordLine) -> v1::RecordLine {
    let mut line = line.clone();
    if let Some(Line::Footer(footer)) = &mut line.line {
        footer.signature = None;
    }
    line
}
