//! Lists that a server sends in pages.

use std::process::ExitCode;

use chefshat_client::Error;
use serde::Serialize;

use super::{CommandError, say};

/// Page size of the lists that `print` prints.
pub(super) const PAGE: u32 = 100;

/// Calls `each` with every item. `fetch` requests the page with a token and returns its items and
/// the token of the next page.
pub(super) async fn for_each<T>(
    mut fetch: impl AsyncFnMut(String) -> Result<(Vec<T>, String), Error>,
    mut each: impl FnMut(T) -> Result<(), CommandError>,
) -> Result<(), CommandError> {
    let mut token = String::new();
    loop {
        let (items, next) = fetch(token).await?;
        items.into_iter().try_for_each(&mut each)?;
        if next.is_empty() {
            return Ok(());
        }
        token = next;
    }
}

/// Prints each item on a line, as JSON or in words; `none` if there are no items.
pub(super) async fn print<T: Serialize>(
    fetch: impl AsyncFnMut(String) -> Result<(Vec<T>, String), Error>,
    json: bool,
    in_words: fn(&T) -> String,
    none: &str,
) -> Result<ExitCode, CommandError> {
    let mut is_empty = true;
    let print = |item| {
        is_empty = false;
        match json {
            true => say(serde_json::to_string(&item)?),
            false => say(in_words(&item)),
        }
    };
    for_each(fetch, print).await?;
    if is_empty && !json {
        say(none)?;
    }
    Ok(ExitCode::SUCCESS)
}
