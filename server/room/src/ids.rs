//! Identifiers and secrets: typed ids, join codes, tickets, owner tokens. Secrets come from
//! the operating system's generator, are stored as hashes and compared in constant time.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;

use rand::TryRng as _;
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

/// Letters of a join code: no vowels, so that no words form, and no letters that look alike.
const CODE_LETTERS: &[u8; 27] = b"23456789BCDFGHJKMNPQRSTVWXZ";
/// Letters in a join code.
pub const CODE_LENGTH: usize = 8;

/// Random bytes from the operating system.
///
/// # Panics
/// If the operating system provides no randomness: without it no deal is fair.
pub fn random_bytes<const N: usize>() -> [u8; N] {
    let mut bytes = [0; N];
    rand::rngs::SysRng
        .try_fill_bytes(&mut bytes)
        .expect("the operating system provides random bytes");
    bytes
}

/// A kind of id: a room.
#[derive(Debug)]
pub enum Room {}
/// A kind of id: a game.
#[derive(Debug)]
pub enum Game {}
/// A kind of id: a series of games with the same deals.
#[derive(Debug)]
pub enum Series {}
/// A kind of id: a tournament.
#[derive(Debug)]
pub enum Tournament {}
/// A kind of id: a study.
#[derive(Debug)]
pub enum Study {}
/// A kind of id: a room, tournament or study, where it is not known or does not matter which.
#[derive(Debug)]
pub enum Unit {}

/// Rooms, tournaments and studies, which have owners and tokens.
pub trait IsUnit {}

impl IsUnit for Room {}
impl IsUnit for Tournament {}
impl IsUnit for Study {}

/// Identifies a `T`: 16 bytes, written as 32 hexadecimal digits. An id of one kind is not taken for
/// one of another:
///
/// ```compile_fail,E0308
/// use chefshat_room::ids::{GameId, RoomId};
///
/// fn close(room: RoomId) {}
/// close(GameId::random());
/// ```
///
/// Only the id of a room, tournament or study becomes that of a unit, never the other way round: what
/// finds the unit has its own id.
///
/// ```
/// use chefshat_room::ids::{RoomId, UnitId};
///
/// fn stop(unit: UnitId) {}
/// stop(RoomId::random().unit());
/// ```
pub struct Id<T> {
    bytes: [u8; 16],
    kind: PhantomData<fn() -> T>,
}

/// The id of a room.
pub type RoomId = Id<Room>;
/// The id of a game.
pub type GameId = Id<Game>;
/// The id of a series of games with the same deals.
pub type SeriesId = Id<Series>;
/// The id of a tournament.
pub type TournamentId = Id<Tournament>;
/// The id of a study.
pub type StudyId = Id<Study>;
/// The id of a room, tournament or study.
pub type UnitId = Id<Unit>;

impl<T> Id<T> {
    /// The id of these bytes.
    pub const fn from_bytes(bytes: [u8; 16]) -> Self {
        let kind = PhantomData;
        Self { bytes, kind }
    }

    /// A new random id.
    pub fn random() -> Self {
        Self::from_bytes(random_bytes())
    }

    /// Reads 32 hexadecimal digits.
    pub fn parse(text: &str) -> Option<Self> {
        let mut bytes = [0; 16];
        hex::decode_to_slice(text, &mut bytes).ok()?;
        Some(Self::from_bytes(bytes))
    }

    /// The bytes to store.
    pub const fn bytes(&self) -> &[u8; 16] {
        &self.bytes
    }
}

impl<T: IsUnit> Id<T> {
    /// Forgets the kind of a unit.
    pub const fn unit(self) -> UnitId {
        Id::from_bytes(self.bytes)
    }
}

impl<T: IsUnit> From<Id<T>> for UnitId {
    fn from(id: Id<T>) -> Self {
        id.unit()
    }
}

// Derived, these would ask the same of `T`.
impl<T> Clone for Id<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Id<T> {}

impl<T> PartialEq for Id<T> {
    fn eq(&self, other: &Self) -> bool {
        self.bytes == other.bytes
    }
}

impl<T> Eq for Id<T> {}

impl<T> PartialOrd for Id<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Id<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bytes.cmp(&other.bytes)
    }
}

impl<T> Hash for Id<T> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.bytes.hash(state);
    }
}

impl<T> fmt::Display for Id<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&hex::encode(self.bytes))
    }
}

impl<T> fmt::Debug for Id<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// The hash of a secret; stores contain only hashes.
#[derive(Clone, Copy, Debug)]
pub struct SecretHash([u8; 32]);

impl SecretHash {
    /// The hash of a secret.
    pub fn of(secret: &[u8]) -> Self {
        Self(Sha256::digest(secret).into())
    }

    /// A stored hash.
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// The bytes to store.
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Whether this is the hash of `secret`, in constant time.
    pub fn matches(&self, secret: &[u8]) -> bool {
        self.is(&Self::of(secret))
    }

    /// Whether two hashes are the same, in constant time.
    pub fn is(&self, other: &Self) -> bool {
        self.0.ct_eq(&other.0).into()
    }
}

/// A secret that belongs to a room, tournament or study, such as a ticket or an owner token: its id
/// and 256 random bits, written as 96 hexadecimal digits, so that no command line mistakes it for an
/// option.
pub struct Token<T> {
    /// What it belongs to.
    pub subject: Id<T>,
    /// The secret.
    pub secret: [u8; 32],
}

/// A token of a room.
pub type RoomToken = Token<Room>;
/// A token of a tournament.
pub type TournamentToken = Token<Tournament>;
/// A token of a study.
pub type StudyToken = Token<Study>;
/// A token of a room, tournament or study.
pub type UnitToken = Token<Unit>;

impl<T> Token<T> {
    /// A new token.
    pub fn random(subject: Id<T>) -> Self {
        Self {
            subject,
            secret: random_bytes(),
        }
    }

    /// The ticket for a request with an id chosen by the client: the same for every repetition.
    /// Only the server knows `key`.
    pub fn of_request(subject: Id<T>, key: &SecretHash, request_id: &[u8; 32]) -> Self {
        let parts = [key.bytes().as_slice(), subject.bytes(), request_id];
        Self {
            subject,
            secret: digest(b"chefshat.v1 ticket", &parts),
        }
    }

    /// Parses a token; `None` if the text is not one. Its kind is what its bearer says it is.
    pub fn parse(word: &str) -> Option<Self> {
        let mut bytes = [0; 48];
        hex::decode_to_slice(word, &mut bytes).ok()?;
        let (subject, secret) = bytes.split_at(16);
        Some(Self {
            subject: Id::from_bytes(subject.try_into().ok()?),
            secret: secret.try_into().ok()?,
        })
    }

    /// The token as text, for the client.
    pub fn to_text(&self) -> String {
        hex::encode([self.subject.bytes().as_slice(), &self.secret].concat())
    }

    /// The hash to store.
    pub fn hash(&self) -> SecretHash {
        SecretHash::of(&self.secret)
    }
}

impl RoomToken {
    /// The owner token of a tournament's room, the same whenever it is computed. Only the server
    /// and the tournament's owner know `key`, the hash of the tournament's owner token.
    pub fn of_tournament_room(room: RoomId, key: &SecretHash) -> Self {
        Self {
            subject: room,
            secret: digest(b"chefshat.v1 tournament room", &[key.bytes(), room.bytes()]),
        }
    }

    /// The ticket of the physical table of a room, which follows from the owner token.
    pub fn of_table(owner: &Self) -> Self {
        Self {
            subject: owner.subject,
            secret: digest(b"chefshat.v1 table", &[&owner.secret]),
        }
    }
}

impl<T> Clone for Token<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Token<T> {}

impl<T> PartialEq for Token<T> {
    fn eq(&self, other: &Self) -> bool {
        (self.subject, self.secret) == (other.subject, other.secret)
    }
}

impl<T> Eq for Token<T> {}

impl<T> fmt::Debug for Token<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Token({}, secret withheld)", self.subject)
    }
}

/// Identifies a request to create something, so that it can be repeated: its id, 32 random bytes
/// chosen by the client, and a digest of its content.
#[derive(Clone, Copy)]
pub struct RequestKey {
    id: [u8; 32],
    content: [u8; 32],
}

/// The id of a request as it counts for a caller with this token: another token with the same id
/// makes another request, and nobody who lacks the hash can compute what is created for it.
pub fn request_id_of(id: &[u8; 32], token: &SecretHash) -> [u8; 32] {
    digest(b"chefshat.v1 request", &[token.bytes(), id])
}

impl RequestKey {
    /// The key of a request with this id and encoded content.
    pub fn new(id: [u8; 32], content: &[u8]) -> Self {
        let content = digest(b"chefshat.v1 content", &[content]);
        Self { id, content }
    }

    /// The id of the created object, which depends only on the request's id.
    pub fn created_id<T>(&self) -> Id<T> {
        let hash = digest(b"chefshat.v1 created", &[&self.id]);
        Id::from_bytes(std::array::from_fn(|index| hash[index]))
    }

    /// The owner token of the created object. It depends on the content too, so a request with
    /// other content gets another token.
    pub fn owner<T>(&self) -> Token<T> {
        Token {
            subject: self.created_id(),
            secret: digest(b"chefshat.v1 owner", &[&self.id, &self.content]),
        }
    }
}

impl fmt::Debug for RequestKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("RequestKey(withheld)")
    }
}

fn digest(purpose: &[u8], parts: &[&[u8]]) -> [u8; 32] {
    let mut hash = Sha256::new_with_prefix(purpose);
    for part in parts {
        hash.update(part);
    }
    hash.finalize().into()
}

/// A new join code: eight letters, about 38 bits.
pub fn join_code() -> String {
    // Bytes from the largest multiple of 27 on are skipped, so that all letters are equally likely.
    let mut code = String::with_capacity(CODE_LENGTH);
    while code.len() < CODE_LENGTH {
        let [byte] = random_bytes::<1>();
        if byte < 243 {
            code.push(char::from(CODE_LETTERS[usize::from(byte % 27)]));
        }
    }
    code
}

/// The normal form of a join code: without spaces and dashes, in capitals.
pub fn normal_code(code: &str) -> String {
    code.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|letter| letter.to_ascii_uppercase())
        .take(64)
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::ids::*;

    #[test]
    fn tokens_and_ids_are_parsed_back() {
        let id = RoomId::random();
        assert_eq!(RoomId::parse(&id.to_string()), Some(id));
        assert_eq!(RoomId::parse("12"), None);
        let token = Token::random(id);
        assert_eq!(Token::parse(&token.to_text()), Some(token));
        assert_eq!(RoomToken::parse(&token.to_text()[1..]), None);
        assert!(token.hash().matches(&token.secret));
        assert!(!token.hash().matches(&Token::random(id).secret));
        assert!(!format!("{token:?}").contains(&token.to_text()));
    }

    #[test]
    fn a_repeated_request_gets_the_same_secrets() {
        let (room, key) = (RoomId::random(), SecretHash::of(b"key"));
        let ticket = Token::of_request(room, &key, &[1; 32]);
        assert_eq!(ticket, Token::of_request(room, &key, &[1; 32]));
        assert_ne!(ticket, Token::of_request(room, &key, &[2; 32]));
        assert_ne!(
            ticket,
            Token::of_request(room, &SecretHash::of(b"other"), &[1; 32])
        );
        let hosted = Token::of_tournament_room(room, &key);
        assert_eq!(hosted, Token::of_tournament_room(room, &key));
        assert_ne!(hosted, Token::of_tournament_room(Id::random(), &key));
        let request = RequestKey::new([1; 32], b"content");
        let owner = RequestKey::owner::<Room>;
        let table = Token::of_table(&owner(&request));
        assert_eq!(table, Token::of_table(&owner(&request)));
        assert!(table.subject == request.created_id() && table != owner(&request));
        assert_eq!(
            owner(&request),
            owner(&RequestKey::new([1; 32], b"content"))
        );
        let other = RequestKey::new([1; 32], b"other content");
        assert_eq!(request.created_id::<Room>(), other.created_id());
        assert_ne!(owner(&request), owner(&other));
    }

    #[test]
    fn join_codes_use_their_letters_and_ignore_case() {
        let code = join_code();
        assert_eq!(code.len(), CODE_LENGTH);
        assert!(code.bytes().all(|letter| CODE_LETTERS.contains(&letter)));
        assert_eq!(normal_code(&format!(" {}-", code.to_lowercase())), code);
    }
}
