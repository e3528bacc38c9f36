//! Paging of lists: page sizes and tokens.

use tonic::Status;

use super::status::invalid;

/// Default page size.
const DEFAULT_PAGE_SIZE: u32 = 50;
/// Largest page size.
const MAX_PAGE_SIZE: u32 = 100;

/// The page size of a request.
pub(super) fn page_size(asked: u32) -> usize {
    size_within(asked, DEFAULT_PAGE_SIZE, MAX_PAGE_SIZE)
}

/// The number of entries of a request: `default` if it asks for none, and at most `most`.
pub(super) fn size_within(asked: u32, default: u32, most: u32) -> usize {
    let size = if asked == 0 { default } else { asked.min(most) };
    usize::try_from(size).unwrap_or(usize::MAX)
}

/// The number of the last entry of the previous page; `None` for the first page.
pub(super) fn last_shown(page_token: &str) -> Result<Option<u64>, Status> {
    if page_token.is_empty() {
        return Ok(None);
    }
    page_token.parse().map(Some).map_err(|_| token_refused())
}

/// A page token is not one of this server.
pub(super) fn token_refused() -> Status {
    let problem = "not a token of this server";
    invalid("PAGE_TOKEN_REFUSED", "page_token", problem)
}
