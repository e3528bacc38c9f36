//! Repeats requests whose response was lost, or whose room or tournament is just changing servers.
//! They change nothing, or their id tells the server that they are the same. `GetServerInfo` is not
//! repeated: it tells at once whether the server answers. The Python SDK repeats the same calls.

use std::time::Duration;

use rand::TryRng as _;
use tonic::{Response, Status};

use crate::Error;
use crate::error::may_retry;

/// Maximum number of attempts if the connection is lost.
const ATTEMPTS: u32 = 5;
/// Maximum number of attempts while the server of a room or tournament cannot be reached: another
/// one takes over within ten seconds.
const OWNER_ATTEMPTS: u32 = 20;
/// Pause after the first attempt; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// Reason of a server that cannot reach the one that runs a room or tournament.
const OWNER_UNREACHABLE: &str = "OWNER_UNREACHABLE";

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

/// Sends a request, and again if the connection is lost before its response arrives, or the server of
/// its room or tournament cannot be reached.
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
        let attempts = match error.reason() {
            None if may_retry(error.code()) => ATTEMPTS,
            Some(OWNER_UNREACHABLE) => OWNER_ATTEMPTS,
            // The server has refused it.
            _ => 1,
        };
        if attempt >= attempts {
            return Err(error);
        }
        let pause = FIRST_PAUSE * 2_u32.pow(attempt - 1);
        tokio::time::sleep(pause.min(LONGEST_PAUSE)).await;
        attempt += 1;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use tonic::Code;
    use tonic_types::{ErrorDetails, StatusExt as _};

    use super::*;

    #[test]
    fn every_call_that_only_reads_is_repeated() {
        let sources = [
            include_str!("client.rs"),
            include_str!("tournaments.rs"),
            include_str!("tournaments/by_hand.rs"),
            include_str!("table.rs"),
        ];
        let lines: Vec<&str> = sources.iter().flat_map(|source| source.lines()).collect();
        let mut repeated = Vec::new();
        for (index, line) in lines.iter().enumerate() {
            let names = [".get_", ".list_"].map(|start| line.split_once(start));
            if names.iter().all(Option::is_none) || !line.contains(".await") {
                continue;
            }
            match lines[index - 2].trim_end().ends_with("repeated(|| {") {
                true => repeated.push(*line),
                false => assert!(line.contains(".get_server_info("), "{line}"),
            }
        }
        assert_eq!(repeated.len(), 11, "{repeated:#?}");
    }

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

    #[tokio::test(start_paused = true)]
    async fn a_room_that_changes_servers_is_awaited_but_not_for_ever() {
        let sent = AtomicU32::new(0);
        let changes_servers_until = |attempt: u32| {
            sent.store(0, Ordering::Relaxed);
            let sent = &sent;
            move || {
                let unreachable = || {
                    let details = ErrorDetails::with_error_info(OWNER_UNREACHABLE, "chefshat", []);
                    Status::with_error_details(Code::Unavailable, "try again", details)
                };
                let number = sent.fetch_add(1, Ordering::Relaxed);
                std::future::ready(match number < attempt {
                    true => Err(unreachable()),
                    false => Ok(Response::new(number)),
                })
            }
        };
        let began = tokio::time::Instant::now();
        let found = repeated(changes_servers_until(OWNER_ATTEMPTS - 1)).await;
        assert_eq!(found.expect("the last attempt"), OWNER_ATTEMPTS - 1);
        assert!(began.elapsed() > Duration::from_secs(10), "a takeover");
        let never = repeated(changes_servers_until(u32::MAX)).await;
        assert_eq!(
            never.expect_err("given up").reason(),
            Some(OWNER_UNREACHABLE)
        );
        assert_eq!(sent.load(Ordering::Relaxed), OWNER_ATTEMPTS);
    }
}
