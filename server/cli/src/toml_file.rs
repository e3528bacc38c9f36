//! Files in TOML that people write.

use toml::Spanned;
use toml::de::DeTable;

/// Reads a text. An error has its line, from 1.
///
/// # Errors
/// It is not TOML.
pub fn parse(text: &str) -> Result<Spanned<DeTable<'_>>, (usize, String)> {
    DeTable::parse(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        (line(text, at), error.message().to_owned())
    })
}

/// An error of [`parse`] in words.
pub fn in_words((line, problem): (usize, String)) -> String {
    format!("line {line}: {problem}")
}

/// The line of a place in a text, from 1.
pub(crate) fn line(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}
