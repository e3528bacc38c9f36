//! Numbers in words: grouped digits, counts with their noun, places.

/// A number with grouped thousands: `1,234,567`.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `1 turn`, `2 turns`, `1,000 turns`.
pub(super) fn counted(count: u64, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{} {what}{plural}", grouped(count))
}

/// A number followed by its unit, such as `90d`, and the value of the unit; `None` for other texts.
pub(super) fn with_unit(text: &str, units: &[(char, u64)]) -> Option<(u64, u64)> {
    let letter = text.chars().next_back()?;
    let (_, unit) = units.iter().find(|(known, _)| *known == letter)?;
    let number = text.strip_suffix(letter)?.parse().ok()?;
    Some((number, *unit))
}

/// A place: `1st`, `2nd`, … `11th`, … `21st`.
pub(super) fn ordinal(place: u32) -> String {
    let ending = match (place % 100, place % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{place}{ending}")
}

#[cfg(test)]
mod tests {
    use crate::numbers::*;

    #[test]
    fn ordinals_have_english_suffixes() {
        let table = [
            (1, "1st"),
            (2, "2nd"),
            (3, "3rd"),
            (4, "4th"),
            (10, "10th"),
            (11, "11th"),
            (12, "12th"),
            (13, "13th"),
            (20, "20th"),
            (21, "21st"),
            (22, "22nd"),
            (23, "23rd"),
            (24, "24th"),
            (101, "101st"),
            (111, "111th"),
            (112, "112th"),
            (123, "123rd"),
        ];
        for (place, words) in table {
            assert_eq!(ordinal(place), words);
        }
    }
}
