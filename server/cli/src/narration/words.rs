//! Words that a participant says, as the protocol carries them: an expression with the label "say"
//! and a data URL (RFC 2397). The page and the robots send and read the same.

use chefshat_client::v1;
use percent_encoding::{NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// Label of an expression with words.
pub const SAY: &str = "say";
/// What precedes the words.
const PREFIX: &str = "data:,";
/// Maximum bytes of `media` in the protocol.
const MAX_MEDIA: usize = 256;

/// Whether words can be said whole.
pub fn fits(words: &str) -> bool {
    encoded(words).len() <= MAX_MEDIA
}

fn encoded(words: &str) -> String {
    format!("{PREFIX}{}", utf8_percent_encode(words, NON_ALPHANUMERIC))
}

/// An expression that says these words.
pub fn said(words: &str) -> v1::Expression {
    v1::Expression {
        label: SAY.to_owned(),
        media: to_data_url(words),
        source: v1::ExpressionSource::SelfReport.into(),
        ..v1::Expression::default()
    }
}

/// The words in `media`; `None` if it refers to something else.
pub fn from_data_url(media: &str) -> Option<String> {
    let words = percent_decode_str(media.strip_prefix(PREFIX)?);
    Some(words.decode_utf8_lossy().into_owned())
}

/// `media` with these words. Words that do not fit are cut off, and end with an ellipsis.
pub fn to_data_url(words: &str) -> String {
    let mut media = encoded(words);
    let mut cut = words.to_owned();
    while media.len() > MAX_MEDIA {
        cut.pop();
        media = encoded(&format!("{}…", cut.trim_end()));
    }
    media
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_arrive_as_they_were_sent() {
        for words in ["", "Good luck", "100 % più: forte?", "\"quoted\"\n"] {
            assert_eq!(from_data_url(&to_data_url(words)).as_deref(), Some(words));
        }
        assert_eq!(to_data_url("a b"), "data:,a%20b");
        let long = to_data_url(&"è ".repeat(99));
        assert!(
            long.len() <= MAX_MEDIA && long.ends_with("%E2%80%A6"),
            "{long}"
        );
        assert_eq!(from_data_url("https://example.org/a.wav"), None);
    }
}
