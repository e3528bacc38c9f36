//! How long the client of a call waits for its answer, if it says so (`grpc-timeout`), here and at
//! the node that a call is forwarded to.

use std::time::Duration;

use http::HeaderMap;
use tokio::time::Instant;

/// The header, written as the gRPC protocol over HTTP/2 says.
const TIMEOUT: &str = "grpc-timeout";

/// How long the client of a call with these headers waits for its answer.
fn client_timeout(headers: &HeaderMap) -> Option<Duration> {
    let text = headers.get(TIMEOUT)?.to_str().ok()?;
    let (number, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    // At most 8 digits, so that no product overflows.
    let number: u32 = number.parse().ok().filter(|_| number.len() <= 8)?;
    let unit = match unit {
        "H" => Duration::from_secs(3_600),
        "M" => Duration::from_secs(60),
        "S" => Duration::from_secs(1),
        "m" => Duration::from_millis(1),
        "u" => Duration::from_micros(1),
        "n" => Duration::from_nanos(1),
        _ => return None,
    };
    Some(unit.saturating_mul(number))
}

/// When the client of a call that has just arrived with these headers stops waiting.
pub(super) fn deadline(headers: &HeaderMap) -> Option<Instant> {
    client_timeout(headers).and_then(|timeout| Instant::now().checked_add(timeout))
}

/// The headers of a request for other nodes. What has passed of its client's time until one is asked
/// is taken off.
#[derive(Debug, Clone)]
pub(super) struct Passed {
    headers: HeaderMap,
    /// When the client stops waiting.
    ends: Option<Instant>,
}

impl Passed {
    /// Of a request that has just arrived with these headers.
    pub(super) fn new(headers: HeaderMap) -> Self {
        let ends = deadline(&headers);
        Self { headers, ends }
    }

    /// As they arrived.
    pub(super) fn as_arrived(&self) -> &HeaderMap {
        &self.headers
    }

    /// For a request that is sent now.
    pub(super) fn now(&self) -> HeaderMap {
        let mut headers = self.headers.clone();
        if let Some(ends) = self.ends {
            let mut left = tonic::Request::new(());
            left.set_timeout(ends.saturating_duration_since(Instant::now()));
            let left: &HeaderMap = left.metadata().as_ref();
            headers.extend(left.clone());
        }
        headers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(timeout: &'static str) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(TIMEOUT, timeout.parse().expect("a value"));
        headers
    }

    #[test]
    fn the_timeout_of_a_client_is_read_in_every_unit() {
        for (text, time) in [
            ("2H", Some(Duration::from_secs(7_200))),
            ("3M", Some(Duration::from_secs(180))),
            ("4S", Some(Duration::from_secs(4))),
            ("1500m", Some(Duration::from_millis(1_500))),
            ("99999999u", Some(Duration::from_micros(99_999_999))),
            ("7n", Some(Duration::from_nanos(7))),
            ("999999999S", None),
            ("-1S", None),
            ("S", None),
            ("5", None),
            ("5x", None),
        ] {
            assert_eq!(client_timeout(&headers(text)), time, "{text}");
        }
        assert_eq!(client_timeout(&HeaderMap::new()), None);
    }

    #[tokio::test(start_paused = true)]
    async fn the_time_that_has_passed_is_taken_off() {
        let seconds = Duration::from_secs;
        for (text, left) in [
            ("9S", seconds(2)),
            ("2H", seconds(7_193)),
            ("4S", seconds(0)),
        ] {
            let passed = Passed::new(headers(text));
            tokio::time::advance(seconds(7)).await;
            assert_eq!(client_timeout(&passed.now()), Some(left), "{text}");
            assert_eq!(passed.now().get_all(TIMEOUT).iter().count(), 1);
            assert_eq!(passed.as_arrived()[TIMEOUT], text);
        }
        assert!(Passed::new(HeaderMap::new()).now().is_empty());
        // What nobody understands is passed on as it is.
        assert_eq!(Passed::new(headers("soon")).now()[TIMEOUT], "soon");
    }
}
