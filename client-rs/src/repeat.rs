//! Repeats requests whose response was lost. Their id tells the server that they are the same.

use std::time::Duration;

use rand::TryRng as _;
use tonic::{Response, Status};

use crate::Error;
use crate::error::may_retry;

/// Maximum number of attempts.
const ATTEMPTS: u32 = 5;
/// Pause after the first attempt; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Gives a request an id unless the caller has.
///
/// # Panics
/// If the operating system has no random bytes.
pub(crate) fn identify(request_id: &mut Vec<u8>) {
    if request_id.is_empty() {
        let mut bytes = [0; 32];
        rand::rngs::SysRng
            .try_fill_bytes(&mut bytes)
            .expect("the operating system gives random bytes");
        *request_id = bytes.to_vec();
    }
}

/// Sends a request, and again if the connection is lost before its response arrives.
pub(crate) async fn repeated<T, F>(send: impl Fn() -> F) -> Result<T, Error>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let mut attempt = 1;
    loop {
        let error = match send().await {
            Ok(response) => return Ok(response.into_inner()),
            Err(status) => Error::from(status),
        };
        // An error with a reason is an answer of the server.
        if attempt == ATTEMPTS || error.reason().is_some() || !may_retry(error.code()) {
            return Err(error);
        }
        tokio::time::sleep(FIRST_PAUSE * 2_u32.pow(attempt - 1)).await;
        attempt += 1;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[tokio::test]
    async fn a_lost_connection_is_tried_again_and_a_refusal_is_not() {
        let sent = AtomicU32::new(0);
        let lost_twice = || {
            std::future::ready(match sent.fetch_add(1, Ordering::Relaxed) {
                0 | 1 => Err(Status::unavailable("connection lost")),
                number => Ok(Response::new(number)),
            })
        };
        assert_eq!(repeated(lost_twice).await.expect("the third one"), 2);
        let sent = AtomicU32::new(0);
        let refused = || {
            sent.fetch_add(1, Ordering::Relaxed);
            let refusal = Status::failed_precondition("the room is full");
            std::future::ready(Err::<Response<()>, _>(refusal))
        };
        repeated(refused).await.expect_err("refused");
        assert_eq!(sent.load(Ordering::Relaxed), 1);
    }
}
