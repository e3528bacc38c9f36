//! The texts that versions before 0.3.0 may have signed: they wrote the entries of
//! `Annotations.extra`, the only map of a record, in an order that differed each time. All orders are
//! tried as long as there are few of them: short games, or few annotations with two keys.

use chefshat_proto::v1::{self, record_line::Line};

use super::text::{TextHash, write_text};

/// The most texts that are tried for one record, each by the verification of a signature.
const MAX_TEXTS: u64 = 4_096;
/// The most bytes that are hashed for all of them.
const MAX_BYTES: u64 = 64 * 1024 * 1024;

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// No map has two entries: there is only one text.
    NoMaps,
    /// One of the texts fits.
    Fits,
    /// None of them does: the record was changed.
    None,
    /// There are too many to try.
    TooMany,
}

/// A line that may have been written in several orders.
struct Part {
    /// The text of the line in each order.
    texts: Vec<Vec<u8>>,
    /// The texts of the lines that follow, up to the next such line.
    after: Vec<Vec<u8>>,
}

impl Part {
    /// Bytes that are hashed for the part once.
    fn bytes(&self) -> u64 {
        let bytes = |texts: &[Vec<u8>]| texts.iter().map(Vec::len).sum::<usize>() as u64;
        bytes(&self.texts[..1]).saturating_add(bytes(&self.after))
    }
}

/// Looks for the text of a record whose hash `fits`.
pub(super) fn find(lines: &[v1::RecordLine], fits: impl Fn(TextHash) -> bool) -> Found {
    let maps: Vec<usize> = lines
        .iter()
        .filter_map(entries_of)
        .map(|it| it.len())
        .collect();
    if maps.is_empty() {
        return Found::NoMaps;
    }
    let orders = |entries: usize| (1..=entries as u64).fold(1, u64::saturating_mul);
    if maps.into_iter().map(orders).fold(1, u64::saturating_mul) > MAX_TEXTS {
        return Found::TooMany;
    }
    let (mut before, mut parts) = (TextHash::default(), Vec::<Part>::new());
    let mut held = 0_u64;
    for line in lines {
        let mut text = Vec::new();
        write_text(line, &mut text);
        if entries_of(line).is_some() || !parts.is_empty() {
            let times = entries_of(line).map_or(1, |it| orders(it.len()));
            held = held.saturating_add(times.saturating_mul(text.len() as u64));
        }
        // Before they take memory: each of them would be hashed at least once.
        if held > MAX_BYTES {
            return Found::TooMany;
        }
        match (entries_of(line), parts.last_mut()) {
            (Some(entries), _) => parts.push(Part {
                texts: in_all_orders(&text, entries),
                after: Vec::new(),
            }),
            (None, Some(part)) => part.after.push(text),
            (None, None) => before = before.and(&text),
        }
    }
    let (mut times, mut bytes) = (1_u64, 0_u64);
    for part in &parts {
        times = times.saturating_mul(part.texts.len() as u64);
        bytes = bytes.saturating_add(times.saturating_mul(part.bytes()));
    }
    if bytes > MAX_BYTES {
        return Found::TooMany;
    }
    match any_fits(before, &parts, &fits) {
        true => Found::Fits,
        false => Found::None,
    }
}

/// The map of a line, if it has two entries or more.
fn entries_of(line: &v1::RecordLine) -> Option<&std::collections::BTreeMap<String, String>> {
    match &line.line {
        Some(Line::Decision(decision)) => {
            let extra = &decision.annotations.as_ref()?.extra;
            (extra.len() > 1).then_some(extra)
        }
        _ => None,
    }
}

/// Tries each order of the first part with all orders of the later ones. There are at most as many
/// parts as the most texts have doublings, which bounds the depth.
fn any_fits(before: TextHash, parts: &[Part], fits: &impl Fn(TextHash) -> bool) -> bool {
    let Some((part, later)) = parts.split_first() else {
        return fits(before);
    };
    part.texts.iter().any(|text| {
        let hash = (part.after.iter()).fold(before.and(text), |hash, line| hash.and(line));
        any_fits(hash, later, fits)
    })
}

/// The text of a line with the entries of its map in each order.
fn in_all_orders(
    text: &[u8],
    entries: &std::collections::BTreeMap<String, String>,
) -> Vec<Vec<u8>> {
    let json = |text: &str| serde_json::to_string(text).expect("a text has a JSON form");
    let mut entries: Vec<String> = (entries.iter())
        .map(|(key, value)| format!("{}:{}", json(key), json(value)))
        .collect();
    // Nothing else in the line has these bytes: within a text, quotes are escaped.
    let map = format!("\"extra\":{{{}}}", entries.join(","));
    let at = (text
        .windows(map.len())
        .position(|part| part == map.as_bytes()))
    .expect("the line has its map");
    let (head, tail) = (&text[..at], &text[at + map.len()..]);
    let mut texts = Vec::new();
    permute(&mut entries, 0, &mut |entries| {
        let map = format!("\"extra\":{{{}}}", entries.join(","));
        texts.push([head, map.as_bytes(), tail].concat());
    });
    texts
}

/// Calls `visit` with each order of the entries from `first` on.
fn permute(entries: &mut Vec<String>, first: usize, visit: &mut impl FnMut(&[String])) {
    if first + 1 >= entries.len() {
        return visit(entries);
    }
    for other in first..entries.len() {
        entries.swap(first, other);
        permute(entries, first + 1, visit);
        entries.swap(first, other);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    fn annotated(keys: usize) -> v1::RecordLine {
        let entry = |key: usize| (format!("k{key}"), "\"extra\":{\"k0\":".to_owned());
        let annotations = v1::Annotations {
            extra: (0..keys).map(entry).collect(),
            ..v1::Annotations::default()
        };
        let decision = v1::DecisionRecord {
            annotations: Some(annotations),
            ..v1::DecisionRecord::default()
        };
        v1::RecordLine {
            line: Some(Line::Decision(decision)),
        }
    }

    #[test]
    fn every_order_is_tried_once_up_to_a_bound() {
        for (keys, found, texts) in [
            (&[0, 1][..], Found::NoMaps, 0),
            (&[1, 2, 0, 3], Found::None, 12),
            (&[2; 12], Found::None, 4_096),
            (&[2; 13], Found::TooMany, 0),
            (&[7], Found::TooMany, 0),
            (&[100_000], Found::TooMany, 0),
        ] {
            let lines: Vec<_> = keys.iter().map(|keys| annotated(*keys)).collect();
            let tried = Cell::new(0);
            let mut hashes = std::collections::BTreeSet::new();
            let hashes = std::cell::RefCell::new(&mut hashes);
            let none = |hash: TextHash| {
                tried.set(tried.get() + 1);
                hashes.borrow_mut().insert(hash.0);
                false
            };
            assert_eq!(find(&lines, none), found, "{keys:?}");
            assert_eq!((tried.get(), hashes.borrow().len()), (texts, texts));
            if texts > 0 {
                // The last one is found as the others are.
                let last = *hashes.borrow().last().expect("some");
                assert_eq!(find(&lines, |hash| hash.0 == last), Found::Fits);
            }
        }
    }
}
