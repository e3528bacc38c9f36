//! Links of participants: the study, the participant's number, and a code that only the server can
//! compute. Nothing is stored for a link.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;

const STUDY_BYTES: usize = 12;
const NUMBER_BYTES: usize = 2;
const CODE_BYTES: usize = 8;
const LINK_BYTES: usize = STUDY_BYTES + NUMBER_BYTES + CODE_BYTES;
/// Separates these codes from others of the same key.
const PURPOSE: &[u8] = b"chefshat.v1 study link";

/// A participant's link: 30 characters that need no escaping in an address.
#[derive(Clone, Copy)]
pub struct ParticipantLink {
    study: [u8; STUDY_BYTES],
    number: u16,
    code: [u8; CODE_BYTES],
}

impl ParticipantLink {
    /// The link of a participant. Only the server knows `key`, which belongs to the study.
    ///
    /// # Panics
    /// If the number is above that of the participants that a study can have.
    pub fn new(key: &[u8; 32], study: [u8; STUDY_BYTES], number: u32) -> Self {
        let number = u16::try_from(number).expect("a study has at most 10000 participants");
        let code = mac(key, study, number).finalize().into_bytes();
        Self {
            study,
            number,
            code: std::array::from_fn(|index| code[index]),
        }
    }

    /// Reads a link, which may be forged; `None` if the text is not one.
    pub fn parse(text: &str) -> Option<Self> {
        let mut bytes = [0; LINK_BYTES];
        let length = URL_SAFE_NO_PAD.decode_slice(text, &mut bytes).ok()?;
        if length != LINK_BYTES {
            return None;
        }
        let (study, rest) = bytes.split_at(STUDY_BYTES);
        let (number, code) = rest.split_at(NUMBER_BYTES);
        Some(Self {
            study: study.try_into().ok()?,
            number: u16::from_be_bytes(number.try_into().ok()?),
            code: code.try_into().ok()?,
        })
    }

    /// The link as text.
    pub fn to_text(&self) -> String {
        let number = self.number.to_be_bytes();
        URL_SAFE_NO_PAD.encode([&self.study[..], &number, &self.code].concat())
    }

    /// The first 12 bytes of the study's id; the others are 0.
    pub fn study(&self) -> [u8; STUDY_BYTES] {
        self.study
    }

    /// The participant's number, if the link was made with the study's key. Takes the same time for
    /// every wrong code.
    pub fn verify(&self, key: &[u8; 32]) -> Option<u32> {
        let mac = mac(key, self.study, self.number);
        mac.verify_truncated_left(&self.code).ok()?;
        Some(u32::from(self.number))
    }
}

impl fmt::Debug for ParticipantLink {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "ParticipantLink({}, code withheld)", self.number)
    }
}

fn mac(key: &[u8; 32], study: [u8; STUDY_BYTES], number: u16) -> Hmac<Sha256> {
    let mac = Hmac::<Sha256>::new_from_slice(key).expect("HMAC takes keys of any length");
    mac.chain_update(PURPOSE)
        .chain_update(study)
        .chain_update(number.to_be_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: [u8; 32] = [3; 32];

    #[test]
    fn a_link_is_read_back_and_needs_its_key() {
        let link = ParticipantLink::new(&KEY, [255; 12], 10_000);
        let text = link.to_text();
        assert_eq!(text.len(), 30);
        let is_url_safe = |letter: u8| letter.is_ascii_alphanumeric() || b"-_".contains(&letter);
        assert!(text.bytes().all(is_url_safe), "{text}");
        let read = ParticipantLink::parse(&text).unwrap();
        assert_eq!((read.study(), read.verify(&KEY)), ([255; 12], Some(10_000)));
        assert_eq!(read.verify(&[4; 32]), None);
        assert!(!format!("{read:?}").contains(&text[20..]));
    }

    #[test]
    fn every_other_text_is_refused() {
        let text = ParticipantLink::new(&KEY, [1; 12], 7).to_text();
        for place in 0..text.len() {
            for other in ["A", "b", "7", "_", "=", "/", " ", "é"] {
                let mut changed = text.clone();
                changed.replace_range(place..=place, other);
                let read = ParticipantLink::parse(&changed);
                let verified = read.and_then(|link| link.verify(&KEY));
                assert!(changed == text || verified.is_none(), "{changed}");
            }
        }
        for other in [
            "",
            &text[1..],
            &format!("{text}A"),
            &format!("{text}=="),
            &text.repeat(2),
        ] {
            assert!(ParticipantLink::parse(other).is_none(), "{other}");
        }
    }
}
