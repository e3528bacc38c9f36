//! Signatures of records: the hash of a record's lines, the keys that sign it, and who signed it.
//! `RecordSignature` in `proto/chefshat/v1/record.proto` defines the form. `orders` finds the text
//! that older versions signed; `strict` refuses keys for which anybody can sign.

mod orders;
mod strict;
mod text;

use std::fmt;
use std::str::FromStr;

use chefshat_proto::v1::{self, record_line::Line};
use ring::signature::{Ed25519KeyPair, KeyPair as _};

pub use text::TextHash;
use text::signature_of;

/// Precedes a public key in text.
const PREFIX: &str = "ed25519:";
/// The version of the text that this version signs.
const TEXT_VERSION: u32 = 1;
/// The version whose maps had no order.
const UNORDERED: u32 = 0;

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
        self.sign_each(|add| lines.iter().for_each(add))
    }

    /// The signature of a record whose lines `lines` passes on one by one.
    pub fn sign_each(
        &self,
        lines: impl FnOnce(&mut dyn FnMut(&v1::RecordLine)),
    ) -> v1::RecordSignature {
        let mut hash = TextHash::default();
        lines(&mut |line| hash = hash.and_line(line));
        v1::RecordSignature {
            public_key: self.public().0.to_vec(),
            signature: (self.0.sign(&hash.message()).as_ref()).to_vec(),
            text_version: TEXT_VERSION,
        }
    }

    /// Signs a record in its footer.
    pub fn sign_in_place(&self, lines: &mut [v1::RecordLine]) {
        let signature = self.sign(lines);
        if let Some(Line::Footer(footer)) = lines.last_mut().and_then(|line| line.line.as_mut()) {
            footer.signature = Some(signature);
        }
    }

    /// Whether this key has signed a record. Only then it signs what is left after a part of the
    /// record was removed: a server vouches for nothing that it cannot check.
    pub fn has_signed(&self, lines: &[v1::RecordLine]) -> bool {
        let signature = lines.last().and_then(signature_of);
        let claimed = signature.is_some_and(|it| it.public_key == self.public().0);
        claimed && signer(lines) == Ok(Some(self.public()))
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
pub enum NotAKey {
    /// It has another form.
    #[error(
        "a public key is \"{PREFIX}\" and 64 hexadecimal digits, as `chefshat key show` prints it"
    )]
    Form,
    /// Anybody can sign for it.
    #[error("{0} is not the key of a server: {WEAK}")]
    Weak(PublicKey),
}

/// What is wrong with a key that `strict` refuses.
const WEAK: &str = "it is a point of small order or no point at all, for which anybody can sign";

impl FromStr for PublicKey {
    type Err = NotAKey;

    fn from_str(text: &str) -> Result<Self, NotAKey> {
        let mut bytes = [0; 32];
        let digits = text.strip_prefix(PREFIX).ok_or(NotAKey::Form)?;
        hex::decode_to_slice(digits, &mut bytes).map_err(|_| NotAKey::Form)?;
        match strict::is_point(&bytes) {
            true => Ok(Self(bytes)),
            false => Err(NotAKey::Weak(Self(bytes))),
        }
    }
}

/// What the signature of a record shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signed {
    /// The record has none.
    Not,
    /// This key signed it.
    By(PublicKey),
    /// A version before 0.3.0 signed it with this key, or somebody who says so. It wrote the entries
    /// of maps in any order, and there are too many orders to try. It proves nothing.
    Uncheckable(PublicKey),
}

impl Signed {
    /// The key that signed the record.
    pub fn by(self) -> Option<PublicKey> {
        match self {
            Self::By(key) => Some(key),
            Self::Not | Self::Uncheckable(_) => None,
        }
    }
}

/// The key that signed a record; `None` if it is unsigned, or if that cannot be checked any more.
///
/// # Errors
/// The signature does not fit the record.
pub fn signer(lines: &[v1::RecordLine]) -> Result<Option<PublicKey>, String> {
    check(lines, None).map(Signed::by)
}

/// Checks the signature of a record. `text`: the hash of the text of its file, if it is from one.
///
/// # Errors
/// The signature does not fit the record.
pub fn check(lines: &[v1::RecordLine], text: Option<TextHash>) -> Result<Signed, String> {
    let Some(signature) = lines.iter().rev().find_map(signature_of) else {
        return Ok(Signed::Not);
    };
    let key: [u8; 32] = signature.public_key.as_slice().try_into().map_err(|_| {
        format!(
            "signature.publicKey has {} bytes and must have 32",
            signature.public_key.len()
        )
    })?;
    let key = PublicKey(key);
    if !strict::is_point(&key.0) {
        return Err(format!("signature.publicKey is {key}: {WEAK}"));
    }
    if signature.text_version > TEXT_VERSION {
        return Err(format!(
            "signature.textVersion is {}, which a later version of chefshat can check",
            signature.text_version
        ));
    }
    let fits = |hash: TextHash| strict::verify(&key.0, &hash.message(), &signature.signature);
    // What was signed is a text. A file that somebody formatted anew has it no longer.
    if text.is_some_and(fits) || fits(TextHash::of(lines)) {
        return Ok(Signed::By(key));
    }
    if signature.text_version == UNORDERED {
        match orders::find(lines, fits) {
            orders::Found::Fits => return Ok(Signed::By(key)),
            orders::Found::TooMany => return Ok(Signed::Uncheckable(key)),
            orders::Found::NoMaps | orders::Found::None => {}
        }
    }
    Err(format!(
        "signature is not one of {key} for this record: something was changed after signing"
    ))
}
