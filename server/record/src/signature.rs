//! Signatures of records: the hash of a record's lines, the keys that sign it, and who signed it.
//! `RecordSignature` in `proto/chefshat/v1/record.proto` defines the form.

use std::fmt;
use std::str::FromStr;

use chefshat_proto::v1::{self, record_line::Line};
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair as _, UnparsedPublicKey};
use sha2::{Digest as _, Sha256};

/// Precedes the hash in what is signed, so that a signature cannot be taken for one of another kind.
const DOMAIN: &[u8] = b"chefshat.v1 record";
/// Precedes a public key in text.
const PREFIX: &str = "ed25519:";

/// A key that signs records.
pub struct SigningKey(Ed25519KeyPair);

impl SigningKey {
    /// The key of a secret seed.
    pub fn from_seed(seed: &[u8; 32]) -> Self {
        Self(Ed25519KeyPair::from_seed_unchecked(seed).expect("every 32 bytes are a seed"))
    }

    /// Its public key.
    pub fn public(&self) -> PublicKey {
        let bytes = self.0.public_key().as_ref();
        PublicKey(bytes.try_into().expect("an Ed25519 key has 32 bytes"))
    }

    /// The signature of a record. A signature that its footer already has does not count.
    pub fn sign(&self, lines: &[v1::RecordLine]) -> v1::RecordSignature {
        v1::RecordSignature {
            public_key: self.public().0.to_vec(),
            signature: self.0.sign(&message(lines)).as_ref().to_vec(),
        }
    }
}

impl fmt::Debug for SigningKey {
    /// Omits the secret.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "SigningKey({})", self.public())
    }
}

/// The public key of a server. Its text is `ed25519:` and 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PublicKey(pub [u8; 32]);

impl fmt::Display for PublicKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{PREFIX}{}", hex::encode(self.0))
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// A text that is not a public key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a public key is \"{PREFIX}\" and 64 hexadecimal digits, as `chefshat key show` prints it")]
pub struct NotAKey;

impl FromStr for PublicKey {
    type Err = NotAKey;

    fn from_str(text: &str) -> Result<Self, NotAKey> {
        let mut bytes = [0; 32];
        let digits = text.strip_prefix(PREFIX).ok_or(NotAKey)?;
        hex::decode_to_slice(digits, &mut bytes).map_err(|_| NotAKey)?;
        Ok(Self(bytes))
    }
}

/// The key that signed a record; `None` if it is unsigned.
///
/// # Errors
/// The signature does not fit the record.
pub fn signer(lines: &[v1::RecordLine]) -> Result<Option<PublicKey>, String> {
    let Some(signature) = lines.iter().rev().find_map(signature_of) else {
        return Ok(None);
    };
    let key: [u8; 32] = signature.public_key.as_slice().try_into().map_err(|_| {
        format!(
            "signature.publicKey has {} bytes and must have 32",
            signature.public_key.len()
        )
    })?;
    UnparsedPublicKey::new(&ED25519, &key)
        .verify(&message(lines), &signature.signature)
        .map_err(|_| {
            format!(
                "signature is not one of {} for this record: something was changed after signing",
                PublicKey(key)
            )
        })?;
    Ok(Some(PublicKey(key)))
}

/// The signature in a footer.
fn signature_of(line: &v1::RecordLine) -> Option<&v1::RecordSignature> {
    match &line.line {
        Some(Line::Footer(footer)) => footer.signature.as_ref(),
        _ => None,
    }
}

/// What is signed.
fn message(lines: &[v1::RecordLine]) -> Vec<u8> {
    let mut hash = [0; 32];
    let mut text = Vec::new();
    for line in lines {
        text.clear();
        let unsigned = signature_of(line).map(|_| without_signature(line));
        serde_json::to_writer(&mut text, unsigned.as_ref().unwrap_or(line))
            .expect("a line of a record has a JSON form");
        hash = Sha256::new()
            .chain_update(hash)
            .chain_update(&text)
            .finalize()
            .into();
    }
    [DOMAIN, &hash].concat()
}

fn without_signature(line: &v1::RecordLine) -> v1::RecordLine {
    let mut line = line.clone();
    if let Some(Line::Footer(footer)) = &mut line.line {
        footer.signature = None;
    }
    line
}
