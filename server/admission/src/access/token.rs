//! The text of a token: `chefshat_ID_SECRET`. The id is public and names the token in lists and
//! logs; the secret is 32 random bytes, of which the server keeps only a hash.

use std::fmt;
use std::str::FromStr;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use chefshat_room::ids::{SecretHash, random_bytes};

/// How every token starts, so that people and secret scanners recognise one.
const PREFIX: &str = "chefshat_";

/// The public part of a token: 4 bytes, written as 8 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TokenId(pub [u8; 4]);

impl FromStr for TokenId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut bytes = [0; 4];
        hex::decode_to_slice(text, &mut bytes)
            .map_err(|_| "the id of a token has 8 hexadecimal digits".to_owned())?;
        Ok(Self(bytes))
    }
}

impl fmt::Display for TokenId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(&hex::encode(self.0))
    }
}

impl fmt::Debug for TokenId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// A token with its secret.
#[derive(Clone, PartialEq, Eq)]
pub struct AccessToken {
    /// Its public part.
    pub id: TokenId,
    secret: [u8; 32],
}

impl AccessToken {
    /// A new token with this id.
    pub fn random(id: TokenId) -> Self {
        let secret = random_bytes();
        Self { id, secret }
    }

    /// Parses a token; `None` if the text is not one.
    pub fn parse(text: &str) -> Option<Self> {
        let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
        let secret = URL_SAFE_NO_PAD.decode(secret).ok()?;
        Some(Self {
            id: id.parse().ok()?,
            secret: secret.try_into().ok()?,
        })
    }

    /// The text, for the person or program that it is for.
    pub fn to_text(&self) -> String {
        format!(
            "{PREFIX}{}_{}",
            self.id,
            URL_SAFE_NO_PAD.encode(self.secret)
        )
    }

    /// The hash to store.
    pub fn hash(&self) -> SecretHash {
        SecretHash::of(&self.secret)
    }
}

impl fmt::Debug for AccessToken {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "AccessToken({}, secret withheld)", self.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_parsed_back_and_nothing_else_is() {
        // The secret may contain the separator.
        for secret in [[0; 32], [0xff; 32], random_bytes()] {
            let token = AccessToken {
                id: TokenId([0, 0x1a, 0xff, 9]),
                secret,
            };
            let text = token.to_text();
            assert_eq!(text.len(), "chefshat_001aff09_".len() + 43);
            assert_eq!(AccessToken::parse(&text), Some(token));
            for wrong in [&text[1..], &text[..text.len() - 1], &format!("{text}A"), ""] {
                assert_eq!(AccessToken::parse(wrong), None, "{wrong}");
            }
        }
    }

    #[test]
    fn debug_output_withholds_the_secret() {
        let token = AccessToken::random(TokenId([1; 4]));
        assert_eq!(
            format!("{token:?}"),
            "AccessToken(01010101, secret withheld)"
        );
    }
}
