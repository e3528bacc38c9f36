//! Lists that are given out page by page: how much of one page is asked for, and where it begins.

use chefshat_record::convert::FieldProblem;
use tonic::Status;

use super::status::field;

/// Entries of a page where a request does not say.
const STANDARD_PAGE: u32 = 50;
/// Most entries of a page.
const MAX_PAGE: u32 = 100;

/// How many entries a page is to have.
pub(super) fn page_size(asked: u32) -> usize {
    let size = match asked {
        0 => STANDARD_PAGE,
        size => size.min(MAX_PAGE),
    };
    usize::try_from(size).unwrap_or(usize::MAX)
}

/// The number of the last entry of the page before; `None` for the first page.
pub(super) fn last_shown(page_token: &str) -> Result<Option<u64>, Status> {
    if page_token.is_empty() {
        return Ok(None);
    }
    page_token.parse().map(Some).map_err(|_| {
        let problem = FieldProblem::new("page_token", "not a token of this server");
        field("PAGE_TOKEN_REFUSED", &problem)
    })
}
