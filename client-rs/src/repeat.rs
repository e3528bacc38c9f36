//! Repeats requests whose response was lost, whose room or tournament is just changing servers, or
//! whose server is stopping, until it is back. They change nothing, or their id tells the server that
//! they are the same. `GetServerInfo` is not repeated: it tells at once whether the server answers.
//! The Python SDK repeats the same calls.

use std::collections::BTreeMap;
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
/// Maximum number of attempts while the server stops, and then is away: its running games may end
/// first, and then it starts again. Two minutes.
const RESTART_ATTEMPTS: u32 = 125;
/// Pause after the first attempt; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// Reason of a server that cannot reach the one that runs a room or tournament.
const OWNER_UNREACHABLE: &str = "OWNER_UNREACHABLE";
/// Reason of a server that has just joined others and is not reached by them yet.
const NODE_NOT_REACHED: &str = "NODE_NOT_REACHED";
/// Reason of a server that is stopping.
const SHUTTING_DOWN: &str = "SHUTTING_DOWN";

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

/// Sends a request, and again if the connection is lost before its response arrives, the server of
/// its room or tournament cannot be reached, or the server is stopping or is not reached by others yet.
/// For a request that changes nothing, or whose id tells the server that it is the same.
///
/// # Errors
/// The last failure.
pub async fn repeated<T, F>(send: impl Fn() -> F) -> Result<T, Error>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    // Counted by reason, as each has its own limit.
    let mut failures = BTreeMap::new();
    let mut lost = (None, ATTEMPTS);
    loop {
        let error = match send().await {
            Ok(response) => return Ok(response.into_inner()),
            Err(status) => Error::from(status),
        };
        let (reason, attempts) = match error.reason() {
            None if may_retry(error.code()) => lost,
            Some(OWNER_UNREACHABLE) => (Some(OWNER_UNREACHABLE), OWNER_ATTEMPTS),
            Some(NODE_NOT_REACHED) => (Some(NODE_NOT_REACHED), OWNER_ATTEMPTS),
            Some(SHUTTING_DOWN) => {
                lost = (Some(SHUTTING_DOWN), RESTART_ATTEMPTS);
                lost
            }
            // The server has refused it.
            _ => return Err(error),
        };
        let failed = failures.entry(reason).or_insert(0);
        *failed += 1;
        if *failed >= attempts {
            return Err(error);
        }
        let pause = FIRST_PAUSE * 2_u32.pow((*failed - 1).min(8));
        tokio::time::sleep(pause.min(LONGEST_PAUSE)).await;
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
        let mut repeated = 0;
        for source in sources {
            let source: String = source.split_whitespace().collect();
            let calls = [".get_", ".list_"].map(|name| source.match_indices(name));
            for (at, _) in calls.into_iter().flatten() {
                let (before, call) = source.split_at(at);
                let services = ["service.clone()", "service(self)"].into_iter();
                let service = services.filter_map(|it| before.strip_suffix(it)).next();
                match service.is_some_and(|before| before.ends_with("repeated(||async{")) {
                    true => repeated += 1,
                    false => assert!(call.starts_with(".get_server_info("), "{call}"),
                }
            }
        }
        assert_eq!(repeated, 11);
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

    /// Answers of a server: a refusal with this reason, a lost connection without one, or success.
    fn answers(
        reasons: impl Fn(u32) -> Option<&'static str>,
        until: u32,
    ) -> impl Fn() -> std::future::Ready<Result<Response<u32>, Status>> {
        let sent = AtomicU32::new(0);
        move || {
            let number = sent.fetch_add(1, Ordering::Relaxed);
            std::future::ready(match (number < until, reasons(number)) {
                (false, _) => Ok(Response::new(number)),
                (true, None) => Err(Status::unavailable("connection lost")),
                (true, Some(reason)) => {
                    let details = ErrorDetails::with_error_info(reason, "chefshat", []);
                    let code = Code::Unavailable;
                    Err(Status::with_error_details(code, "try again", details))
                }
            })
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_room_that_changes_servers_is_awaited_but_not_for_ever() {
        let unreachable = |_| Some(OWNER_UNREACHABLE);
        let began = tokio::time::Instant::now();
        let found = repeated(answers(unreachable, OWNER_ATTEMPTS - 1)).await;
        assert_eq!(found.expect("the last attempt"), OWNER_ATTEMPTS - 1);
        assert!(began.elapsed() > Duration::from_secs(10), "a takeover");
        let joins = repeated(answers(|_| Some(NODE_NOT_REACHED), OWNER_ATTEMPTS - 1)).await;
        assert_eq!(joins.expect("the last attempt"), OWNER_ATTEMPTS - 1);
        let never = repeated(answers(unreachable, OWNER_ATTEMPTS)).await;
        let never = never.expect_err("given up");
        assert_eq!(never.reason(), Some(OWNER_UNREACHABLE));
    }

    #[tokio::test(start_paused = true)]
    async fn a_server_that_stops_and_starts_again_is_awaited_but_not_for_ever() {
        // First it answers that it stops, then it is away.
        let stops = |attempt| (attempt < 40).then_some(SHUTTING_DOWN);
        let found = repeated(answers(stops, 60)).await;
        assert_eq!(found.expect("it is back"), 60);
        let never = repeated(answers(stops, RESTART_ATTEMPTS)).await;
        never.expect_err("given up");
    }

    #[tokio::test(start_paused = true)]
    async fn each_reason_has_its_own_attempts() {
        // A server that is back, and that others do not reach yet.
        let back = |attempt| {
            Some(if attempt < 30 {
                SHUTTING_DOWN
            } else {
                NODE_NOT_REACHED
            })
        };
        let found = repeated(answers(back, 32)).await;
        assert_eq!(found.expect("it is reached"), 32);
        // A room that changes servers, and one lost connection.
        let moving = |attempt| (attempt != 6).then_some(OWNER_UNREACHABLE);
        let found = repeated(answers(moving, 8)).await;
        assert_eq!(found.expect("it has moved"), 8);
    }
}
