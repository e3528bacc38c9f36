//! Addresses on other sites, in which something of the participant is filled in.

use crate::checks::{Checked, characters, refuse};

/// Maximum length of an address, in characters.
const MAX_ADDRESS: usize = 2000;

/// An address must begin with https:// and a host, and have no other placeholder.
pub(crate) fn check(field: &str, url: &str, placeholder: &str) -> Checked {
    characters(field, url, 1..=MAX_ADDRESS)?;
    let host = url.strip_prefix("https://").unwrap_or_default();
    if host.is_empty() || host.starts_with(['/', '?', '#', '{']) {
        return refuse(field, "an address must begin with https:// and a host");
    }
    let is_allowed = |letter: char| letter.is_ascii_graphic() && !"\"<>\\^`|".contains(letter);
    if !url.chars().all(is_allowed) {
        return refuse(
            field,
            "an address has no spaces, quotes or letters beyond ASCII",
        );
    }
    if url.replace(placeholder, "").contains(['{', '}']) {
        return refuse(field, format!("only {placeholder} can be filled in"));
    }
    Ok(())
}

/// The address with a text in place of each placeholder.
pub(crate) fn filled_in(url: &str, placeholder: &str, text: &str) -> String {
    url.replace(placeholder, &percent_encoded(text))
}

/// Everything but letters and digits, so that the text cannot add to the address.
fn percent_encoded(text: &str) -> String {
    let encoded = text.bytes().map(|byte| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    });
    encoded.collect()
}
