//! Whom a game waits for, in words. The server says it when it changes; in between, the caller's clock
//! counts.

use chefshat_client::v1;

use super::view::GameView;

/// Time after which it is worth saying that the game waits for a seat that is connected.
const PATIENCE_MS: u64 = 5_000;

/// Milliseconds left for a decision that was requested `gone_ms` ago, and then in the time bank.
pub fn left_ms(request: &v1::DecisionRequest, gone_ms: u64) -> (u64, u64) {
    let (time, bank) = (request.time_left_ms, request.bank_left_ms);
    let (time, bank) = (u64::from(time), u64::from(bank));
    let beyond = gone_ms.saturating_sub(time);
    (time.saturating_sub(gone_ms), bank.saturating_sub(beyond))
}

/// A seat whose decision is open.
#[derive(Debug, Clone)]
pub struct AwaitedSeat {
    seat: u32,
    /// It is not connected.
    away: bool,
    /// Since its decision was opened, when the message arrived.
    waited_ms: u64,
    /// Until the server decides for it, when the message arrived. `None` if nobody may know.
    left_ms: Option<u64>,
    /// Arrival of the message, by the caller's clock.
    since_ms: u64,
}

impl AwaitedSeat {
    /// The seat of a message that arrived at `now_ms`; `None` if nobody is awaited.
    pub fn new(awaited: &v1::Awaited, now_ms: u64) -> Option<Self> {
        Some(Self {
            seat: awaited.seat?,
            away: awaited.away,
            waited_ms: awaited.waited_ms.into(),
            left_ms: awaited.left_ms.map(u64::from),
            since_ms: now_ms,
        })
    }

    /// Whether it is not connected.
    pub fn is_away(&self) -> bool {
        self.away
    }

    /// The sentence at `now_ms`: the time left for a seat that is away, the time passed for one that
    /// is connected. `None` while that is not worth saying.
    pub fn words(&self, table: &GameView, now_ms: u64) -> Option<String> {
        let passed = now_ms.saturating_sub(self.since_ms);
        let name = table.name(self.seat);
        if self.away {
            let left = |ms: u64| ms.saturating_sub(passed).div_ceil(1000);
            let left = (self.left_ms).map_or_else(String::new, |ms| format!(": {} s", left(ms)));
            return Some(format!("Waiting for {name} (away){left}"));
        }
        let waited = self.waited_ms + passed;
        (waited >= PATIENCE_MS).then(|| format!("Waiting for {name} for {} s", waited / 1000))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(awaited: v1::Awaited, now_ms: u64) -> Option<String> {
        AwaitedSeat::new(&awaited, 1_000).and_then(|it| it.words(&GameView::default(), now_ms))
    }

    #[test]
    fn a_seat_that_is_away_counts_down_and_one_that_is_here_counts_up() {
        let away = v1::Awaited {
            seat: Some(2),
            away: true,
            waited_ms: 100,
            left_ms: Some(12_000),
        };
        for (now_ms, seconds) in [(1_000, 12), (1_001, 12), (2_000, 11), (99_000, 0)] {
            let expected = format!("Waiting for seat 3 (away): {seconds} s");
            assert_eq!(words(away, now_ms), Some(expected));
        }
        let unknown = v1::Awaited {
            left_ms: None,
            ..away
        };
        let expected = Some("Waiting for seat 3 (away)".to_owned());
        assert_eq!(words(unknown, 2_000), expected);
        let here = v1::Awaited {
            away: false,
            ..away
        };
        assert_eq!(words(here, 5_899), None);
        let expected = Some("Waiting for seat 3 for 5 s".to_owned());
        assert_eq!(words(here, 5_900), expected);
        assert_eq!(words(v1::Awaited::default(), 9_000), None);
    }
}
