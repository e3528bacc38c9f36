//! The secrets that a caller shows: owner tokens and tickets. They show rooms, tournaments and
//! records that are not public.

use std::fmt;
use std::sync::Arc;

use chefshat_room::ids::{SecretHash, UnitId, UnitToken};

/// The name of the request header that shows a secret. It may be repeated.
pub const SECRET_HEADER: &str = "chefshat-secret";
/// Most secrets of a request.
pub const MAX_SECRETS: usize = 16;

/// Why the secrets of a request are refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SecretsRefused {
    /// There are too many.
    #[error("a request shows at most {MAX_SECRETS} secrets; send only those of what it is about")]
    TooMany,
    /// One is neither an owner token nor a ticket.
    #[error(
        "`{SECRET_HEADER}` must be an owner token or a ticket, 96 hexadecimal digits (a join code is not a secret): check it, or join again"
    )]
    Malformed,
}

/// What a caller is to a room, a tournament or a recorded game.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Relation {
    /// It has shown no secret.
    Stranger,
    /// It has shown a ticket.
    Participant,
    /// It has shown the owner token.
    Owner,
}

/// The secrets of a caller.
#[derive(Clone, Default)]
pub struct Secrets(Option<Arc<[UnitToken]>>);

impl Secrets {
    /// Reads the values of the header, each of them one secret or several with commas in between,
    /// as proxies join repeated headers.
    ///
    /// # Errors
    /// There are too many, or one is malformed.
    pub fn parse<'a>(values: impl Iterator<Item = &'a [u8]>) -> Result<Self, SecretsRefused> {
        let mut tokens = Vec::new();
        for word in values.flat_map(|value| value.split(|byte| *byte == b',')) {
            if tokens.len() == MAX_SECRETS {
                return Err(SecretsRefused::TooMany);
            }
            let word = std::str::from_utf8(word.trim_ascii()).ok();
            let token = word.and_then(UnitToken::parse);
            tokens.push(token.ok_or(SecretsRefused::Malformed)?);
        }
        Ok(Self::of(tokens))
    }

    fn of(tokens: Vec<UnitToken>) -> Self {
        Self((!tokens.is_empty()).then(|| tokens.into()))
    }

    /// These secrets and one that a request contains, unless it is malformed.
    pub fn with(&self, secret: &str) -> Self {
        let all = self.all().iter().copied().chain(UnitToken::parse(secret));
        Self::of(all.collect())
    }

    /// The secrets of a room, tournament or study.
    pub fn of_id(&self, id: impl Into<UnitId>) -> impl Iterator<Item = &UnitToken> {
        let id = id.into();
        self.all().iter().filter(move |token| token.subject == id)
    }

    /// Whether one of them is said to be of this room or tournament.
    pub fn mention(&self, id: impl Into<UnitId>) -> bool {
        self.of_id(id).next().is_some()
    }

    /// What the secrets of a room or tournament make of their caller, if its owner token and its
    /// tickets have these hashes. In constant time for each.
    pub fn relation(
        &self,
        id: impl Into<UnitId>,
        owner: &SecretHash,
        tickets: impl Iterator<Item = SecretHash> + Clone,
    ) -> Relation {
        let relations = self.of_id(id).map(|token| {
            let hash = token.hash();
            if owner.is(&hash) {
                Relation::Owner
            } else if tickets.clone().any(|ticket| ticket.is(&hash)) {
                Relation::Participant
            } else {
                Relation::Stranger
            }
        });
        relations.max().unwrap_or(Relation::Stranger)
    }

    fn all(&self) -> &[UnitToken] {
        self.0.as_deref().unwrap_or_default()
    }
}

impl fmt::Debug for Secrets {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} secrets, withheld", self.all().len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_are_read_from_every_value() {
        let [room, other] = [1, 2].map(|id| UnitId::from_bytes([id; 16]));
        let tokens = [
            UnitToken::random(room),
            UnitToken::random(room),
            UnitToken::random(other),
        ];
        let [first, second, third] = tokens.map(|token| token.to_text());
        let values = [first.clone(), format!("{second} , {third}")];
        let values = || values.iter().map(String::as_bytes);
        let secrets = Secrets::parse(values()).expect("three secrets");
        assert_eq!(secrets.of_id(room).count(), 2);
        assert!(secrets.mention(other) && !secrets.mention(UnitId::from_bytes([3; 16])));
        assert!(!format!("{secrets:?}").contains(&first));
        let many = std::iter::repeat_n(first.as_bytes(), MAX_SECRETS);
        assert!(Secrets::parse(many.clone()).is_ok());
        let refused = Secrets::parse(many.chain([third.as_bytes()])).map(|_| ());
        assert_eq!(refused, Err(SecretsRefused::TooMany));
        for wrong in ["", "BCDF2345", &first[1..], "ä"] {
            let refused = Secrets::parse([wrong.as_bytes()].into_iter()).map(|_| ());
            assert_eq!(refused, Err(SecretsRefused::Malformed), "{wrong}");
        }
    }

    #[test]
    fn the_best_secret_of_a_room_counts() {
        let [room, other] = [1, 2].map(|id| UnitId::from_bytes([id; 16]));
        let (owner, ticket) = (UnitToken::random(room), UnitToken::random(room));
        let relation = |tokens: Vec<UnitToken>| {
            let tickets = [ticket.hash()].into_iter();
            Secrets::of(tokens).relation(room, &owner.hash(), tickets)
        };
        let elsewhere = |token: UnitToken| UnitToken {
            subject: other,
            ..token
        };
        assert_eq!(relation(vec![]), Relation::Stranger);
        assert_eq!(relation(vec![UnitToken::random(room)]), Relation::Stranger);
        assert_eq!(relation(vec![ticket]), Relation::Participant);
        assert_eq!(relation(vec![ticket, owner]), Relation::Owner);
        assert_eq!(relation(vec![elsewhere(owner)]), Relation::Stranger);
        let shown = Secrets::default().with(&owner.to_text()).with("");
        assert_eq!(shown.of_id(room).count(), 1);
    }
}
