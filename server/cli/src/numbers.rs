//! Numbers in words: grouped digits, counts with their noun, places, and times with a unit.

use std::time::Duration;

pub use chefshat_record::words::{grouped, ordinal};

/// `1 turn`, `2 turns`, `1,000 turns`, `2 studies`.
pub fn counted(count: u64, what: &str) -> String {
    let number = grouped(count);
    match (count, what.strip_suffix("study")) {
        (1, _) => format!("{number} {what}"),
        (_, Some(before)) => format!("{number} {before}studies"),
        (_, None) => format!("{number} {what}s"),
    }
}

/// A difference with its sign: `+0.125`, `−0.125`.
pub fn signed(number: f64) -> String {
    // Avoids a signed zero.
    let number = if number == 0.0 { 0.0 } else { number };
    format!("{number:+.3}").replace('-', "−")
}

/// Parses a time such as 90d.
pub fn duration(text: &str) -> Result<Duration, String> {
    let units = [('s', 1), ('m', 60), ('h', 3_600), ('d', 86_400)];
    let parsed = units.iter().find_map(|(unit, seconds)| {
        let number: u32 = text.strip_suffix(*unit)?.parse().ok()?;
        (number > 0).then(|| Duration::from_secs(u64::from(number) * seconds))
    });
    parsed
        .ok_or_else(|| "use a number above 0 with s, m, h or d, such as 90m, 12h or 30d".to_owned())
}

/// A seat as people count it, from 1. The protocol and JSON count from 0.
pub fn seat_number(seat: u32) -> u32 {
    seat.saturating_add(1)
}

#[cfg(test)]
mod tests {
    use crate::numbers::*;

    #[test]
    fn what_is_counted_has_its_number() {
        for (count, what, expected) in [
            (0, "turn", "0 turns"),
            (1, "turn", "1 turn"),
            (1_000, "day", "1,000 days"),
            (1, "study", "1 study"),
            (2, "study", "2 studies"),
        ] {
            assert_eq!(counted(count, what), expected);
        }
    }

    #[test]
    fn times_have_a_unit() {
        let table = [
            ("45s", 45),
            ("90m", 5_400),
            ("12h", 43_200),
            ("30d", 2_592_000),
        ];
        for (text, seconds) in table {
            assert_eq!(duration(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for wrong in [
            "",
            "d",
            "90",
            "0s",
            "0d",
            "-1d",
            "1.5h",
            "1w",
            "9é",
            "99999999999d",
        ] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }
}
