//! Links of participants: the study, the participant's number, and a code that only the server can
//! compute. Number 0 is in the open link of a study. Sessions have the number of the session as well.
//! Nothing is stored for them.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;

const STUDY_BYTES: usize = 12;
const NUMBER_BYTES: usize = 2;
const CODE_BYTES: usize = 8;
const LINK_BYTES: usize = STUDY_BYTES + NUMBER_BYTES + CODE_BYTES;
/// The number in an open link: participants have numbers from 1.
const OPEN: u32 = 0;
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

    /// The open link of a study, by which people join.
    pub fn open(key: &[u8; 32], study: [u8; STUDY_BYTES]) -> Self {
        Self::new(key, study, OPEN)
    }

    /// Whether it is the open link of its study, if the study made it.
    pub fn is_open(&self) -> bool {
        u32::from(self.number) == OPEN
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

const SESSION_CODE_BYTES: usize = 16;
const SESSION_BYTES: usize = STUDY_BYTES + 2 * NUMBER_BYTES + SESSION_CODE_BYTES;
const SESSION_PURPOSE: &[u8] = b"chefshat.v1 study session";

/// The secret of a session of a participant.
#[derive(Clone, Copy)]
pub struct SessionSecret {
    study: [u8; STUDY_BYTES],
    number: u16,
    session: u16,
    code: [u8; SESSION_CODE_BYTES],
}

impl SessionSecret {
    /// The secret of a session of a participant. Only the server knows `key`, which belongs to the
    /// study.
    ///
    /// # Panics
    /// If a number is above that of the participants that a study, or of the sessions that a
    /// participant can have.
    pub fn new(key: &[u8; 32], study: [u8; STUDY_BYTES], number: u32, session: u32) -> Self {
        let number = u16::try_from(number).expect("a study has at most 10000 participants");
        let session = u16::try_from(session).expect("a participant has at most 1000 sessions");
        let code = session_mac(key, study, number, session).finalize();
        let code = code.into_bytes();
        Self {
            study,
            number,
            session,
            code: std::array::from_fn(|index| code[index]),
        }
    }

    /// Reads a secret, which may be forged; `None` if the text is not one.
    pub fn parse(text: &str) -> Option<Self> {
        let mut bytes = [0; SESSION_BYTES];
        let length = URL_SAFE_NO_PAD.decode_slice(text, &mut bytes).ok()?;
        if length != SESSION_BYTES {
            return None;
        }
        let (study, rest) = bytes.split_at(STUDY_BYTES);
        let (number, rest) = rest.split_at(NUMBER_BYTES);
        let (session, code) = rest.split_at(NUMBER_BYTES);
        Some(Self {
            study: study.try_into().ok()?,
            number: u16::from_be_bytes(number.try_into().ok()?),
            session: u16::from_be_bytes(session.try_into().ok()?),
            code: code.try_into().ok()?,
        })
    }

    /// The secret as text, of 43 characters.
    pub fn to_text(&self) -> String {
        let (number, session) = (self.number.to_be_bytes(), self.session.to_be_bytes());
        URL_SAFE_NO_PAD.encode([&self.study[..], &number, &session, &self.code].concat())
    }

    /// The first 12 bytes of the study's id; the others are 0.
    pub fn study(&self) -> [u8; STUDY_BYTES] {
        self.study
    }

    /// The numbers of the participant and of its session, if the secret was made with the study's
    /// key. Takes the same time for every wrong code.
    pub fn verify(&self, key: &[u8; 32]) -> Option<(u32, u32)> {
        let mac = session_mac(key, self.study, self.number, self.session);
        mac.verify_truncated_left(&self.code).ok()?;
        Some((self.number.into(), self.session.into()))
    }
}

impl fmt::Debug for SessionSecret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (number, session) = (self.number, self.session);
        write!(
            formatter,
            "SessionSecret({number}, {session}, code withheld)"
        )
    }
}

fn session_mac(
    key: &[u8; 32],
    study: [u8; STUDY_BYTES],
    number: u16,
    session: u16,
) -> Hmac<Sha256> {
    let mac = Hmac::<Sha256>::new_from_slice(key).expect("HMAC takes keys of any length");
    mac.chain_update(SESSION_PURPOSE)
        .chain_update(study)
        .chain_update(number.to_be_bytes())
        .chain_update(session.to_be_bytes())
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
    fn a_session_is_read_back_and_is_not_another_one() {
        let secret = SessionSecret::new(&KEY, [7; 12], 10_000, 1000);
        let text = secret.to_text();
        let read = SessionSecret::parse(&text).unwrap();
        assert_eq!(read.study(), [7; 12]);
        assert_eq!(read.verify(&KEY), Some((10_000, 1000)));
        assert_eq!(read.verify(&[4; 32]), None);
        for place in 0..text.len() {
            let mut changed = text.clone();
            let other = if &text[place..=place] == "A" {
                "B"
            } else {
                "A"
            };
            changed.replace_range(place..=place, other);
            let read = SessionSecret::parse(&changed);
            assert_eq!(
                read.and_then(|secret| secret.verify(&KEY)),
                None,
                "{changed}"
            );
        }
        // A link is not a session.
        let link = ParticipantLink::new(&KEY, [7; 12], 1).to_text();
        assert!(SessionSecret::parse(&link).is_none());
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
