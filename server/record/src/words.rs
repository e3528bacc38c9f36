//! Words of a game that texts, pictures and language models share: why the server decided, places,
//! and what a participant says. Sentences are elsewhere: their length and their signs differ.

use std::fmt::Display;

use chefshat_proto::v1;
use percent_encoding::{NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// Label of an expression with words.
pub const SAY: &str = "say";
/// What precedes the words.
const PREFIX: &str = "data:,";
/// Maximum bytes of `media` in the protocol.
const MAX_MEDIA: usize = 256;

/// Why the server decided for the seat, in a word; `None` if the seat, or a substitute whose
/// beginning has an event of its own, decided.
pub fn reason(source: v1::DecisionSource) -> Option<&'static str> {
    match source {
        v1::DecisionSource::Timeout => Some("too late"),
        v1::DecisionSource::Invalid => Some("invalid"),
        v1::DecisionSource::Disconnected => Some("absent"),
        v1::DecisionSource::Agent
        | v1::DecisionSource::Substitute
        | v1::DecisionSource::Recorded
        | v1::DecisionSource::Table
        | v1::DecisionSource::Unspecified => None,
    }
}

/// Whether a character is invisible, so that texts that differ in it look alike: joiners, direction
/// marks, separators of lines, fillers, variation selectors, tags. Those are Unicode's
/// `Default_Ignorable_Code_Point`, marks of annotations and the blank Braille pattern.
pub fn is_invisible(letter: char) -> bool {
    matches!(letter,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}'
        | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}'
        | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}'
        | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}')
}

/// Whether a text has characters that are not seen: control characters and invisible ones. The sign
/// that a symbol is a picture (U+FE0F), which keyboards add to some, counts as seen after one.
pub fn has_invisible(text: &str) -> bool {
    let mut before = None;
    text.chars().any(|letter| {
        let is_symbol = |it: char| !it.is_ascii() && !it.is_alphanumeric() && !is_invisible(it);
        let is_sign = letter == '\u{fe0f}' && before.is_some_and(is_symbol);
        before = Some(letter);
        letter.is_control() || is_invisible(letter) && !is_sign
    })
}

/// A place: `1st`, `2nd`, … `11th`, … `21st`.
pub fn ordinal(place: u32) -> String {
    let ending = match (place % 100, place % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{place}{ending}")
}

/// A whole number with grouped thousands: `1,234,567`.
pub fn grouped(number: impl Display) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A text of unknown origin without control characters, which a terminal would obey.
pub fn printable(text: &str) -> String {
    text.replace(char::is_control, "\u{fffd}")
}

/// Whether words can be said whole.
pub fn fits(words: &str) -> bool {
    encoded(words).len() <= MAX_MEDIA
}

fn encoded(words: &str) -> String {
    format!("{PREFIX}{}", utf8_percent_encode(words, NON_ALPHANUMERIC))
}

/// An expression that says these words: with the label "say" and a data URL (RFC 2397). The page and
/// the robots send and read the same.
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
    // All is encoded again for each character that is too many, and each takes a byte at least.
    let mut cut: String = words.chars().take(MAX_MEDIA).collect();
    let mut media = encoded(&cut);
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
    fn ordinals_have_english_suffixes() {
        let table = [
            (1, "1st"),
            (2, "2nd"),
            (3, "3rd"),
            (4, "4th"),
            (10, "10th"),
            (11, "11th"),
            (12, "12th"),
            (13, "13th"),
            (20, "20th"),
            (21, "21st"),
            (22, "22nd"),
            (23, "23rd"),
            (24, "24th"),
            (101, "101st"),
            (111, "111th"),
            (112, "112th"),
            (123, "123rd"),
        ];
        for (place, words) in table {
            assert_eq!(ordinal(place), words);
        }
    }

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
        // As the same words without what is far too long, and at once.
        let endless = "è ".repeat(1_000_000);
        assert_eq!(to_data_url(&endless), long);
        assert_eq!(from_data_url("https://example.org/a.wav"), None);
    }
}
