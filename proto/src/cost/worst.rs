//! Messages that cost the most for their length: for tests, attacks and fuzzing.

use std::collections::BTreeSet;

use prost::encoding::{WireType, encode_key, encode_varint};

use super::{Cost, Field, Kind, Shape};

/// Deepest nesting of what is filled.
const MAX_PATH: usize = 8;
/// The number of a field that no message has.
const UNKNOWN: u32 = 1_999;

/// A way to fill a message: the same few bytes again and again, in a field that may be deep inside.
#[derive(Debug, Clone)]
pub struct Filling {
    /// What is filled with what.
    pub name: String,
    /// The numbers of the fields around it, from the outside.
    path: Vec<u32>,
    unit: Unit,
}

#[derive(Debug, Clone)]
enum Unit {
    /// Whole fields.
    Fields(Vec<u8>),
    /// The content of one packed field.
    Packed(u32, Vec<u8>),
    /// Entries of a map, each with a key of its own.
    Entries(u32),
}

impl Filling {
    /// All ways to fill a message: each list wherever it is, with empty items, items that have one
    /// item each, and numbers; maps; texts; one message field again and again; unknown fields.
    pub fn all(shape: &'static Shape) -> Vec<Self> {
        let mut fillings = Vec::new();
        add(shape, &mut Vec::new(), &mut fillings, &mut BTreeSet::new());
        fillings
    }

    /// The message with this number of units.
    pub fn message(&self, units: usize) -> Vec<u8> {
        let mut message = match &self.unit {
            Unit::Fields(unit) => unit.repeat(units),
            Unit::Packed(number, unit) => delimited(*number, &unit.repeat(units)),
            Unit::Entries(number) => (0..units).fold(Vec::new(), |mut message, entry| {
                let digit = |shift: u32| b'0' + (entry >> shift & 63) as u8;
                let key = [digit(12), digit(6), digit(0)];
                message.extend(delimited(*number, &delimited(1, &key)));
                message
            }),
        };
        for number in self.path.iter().rev() {
            message = delimited(*number, &message);
        }
        message
    }

    /// The longest such message of at most this many bytes.
    pub fn longest(&self, bytes: usize) -> Vec<u8> {
        let mut units = self.units(bytes);
        loop {
            let message = self.message(units);
            let excess = message.len().saturating_sub(bytes);
            if excess == 0 || units == 0 {
                return message;
            }
            units -= self.units(excess).clamp(1, units);
        }
    }

    /// The longest such message of at most this many bytes that costs no more than `most`.
    pub fn largest(&self, shape: &Shape, bytes: usize, most: Cost) -> Vec<u8> {
        let fits = |message: &[u8]| message.len() <= bytes && shape.cost(message, most).is_ok();
        let (mut fitting, mut beyond) = (0, self.units(bytes) + 1);
        while fitting + 1 < beyond {
            let middle = fitting + (beyond - fitting) / 2;
            match fits(&self.message(middle)) {
                true => fitting = middle,
                false => beyond = middle,
            }
        }
        self.message(fitting)
    }

    /// How many units take this many bytes, at most.
    fn units(&self, bytes: usize) -> usize {
        let unit = match &self.unit {
            Unit::Fields(unit) | Unit::Packed(_, unit) => unit.len(),
            Unit::Entries(_) => self.message(2).len() - self.message(1).len(),
        };
        bytes / unit.max(1)
    }
}

fn add(
    shape: &'static Shape,
    path: &mut Vec<u32>,
    fillings: &mut Vec<Filling>,
    within: &mut BTreeSet<&'static str>,
) {
    let mut filling = |name: String, unit| {
        fillings.push(Filling {
            name: format!("{} {path:?} {name}", shape.name),
            path: path.clone(),
            unit,
        });
    };
    for field in shape.fields {
        let number = field.number;
        match (&field.kind, field.list) {
            (Kind::Number { width, .. }, true) => {
                let one = vec![0; (*width).max(1)];
                filling(format!("numbers {number}"), Unit::Packed(number, one));
            }
            (Kind::Number { .. }, false) => {}
            (Kind::Entry(_), _) => filling(format!("entries {number}"), Unit::Entries(number)),
            (Kind::Text, _) => {
                for text in ["", "a"] {
                    let unit = delimited(number, text.as_bytes());
                    filling(format!("texts {number} {text:?}"), Unit::Fields(unit));
                }
            }
            (Kind::Message(inner), _) => {
                let unit = delimited(number, &[]);
                filling(format!("empty {number}"), Unit::Fields(unit));
                let items: Vec<_> =
                    (inner.fields.iter().filter_map(|field| item(field, 0))).collect();
                for item in &items {
                    let unit = delimited(number, item);
                    filling(format!("items {number} of {item:?}"), Unit::Fields(unit));
                }
                let unit = delimited(number, &items.concat());
                filling(format!("full {number}"), Unit::Fields(unit));
            }
        }
    }
    if path.is_empty() {
        let mut unknown = Vec::new();
        encode_key(UNKNOWN, WireType::Varint, &mut unknown);
        unknown.push(0);
        filling("unknown numbers".to_owned(), Unit::Fields(unknown));
        let unknown = delimited(UNKNOWN, &[]);
        filling("unknown texts".to_owned(), Unit::Fields(unknown));
    }
    if path.len() == MAX_PATH || !within.insert(shape.name) {
        return;
    }
    for field in shape.fields {
        if let Kind::Message(inner) = field.kind {
            path.push(field.number);
            add(inner, path, fillings, within);
            path.pop();
        }
    }
    within.remove(shape.name);
}

/// The smallest item of a field that takes memory, with an item in each of its own lists.
fn item(field: &Field, depth: usize) -> Option<Vec<u8>> {
    match field.kind {
        Kind::Number { width, .. } if field.list => {
            Some(delimited(field.number, &vec![0; width.max(1)]))
        }
        Kind::Number { .. } => None,
        Kind::Text => Some(delimited(field.number, b"a")),
        Kind::Entry(_) => Some(delimited(field.number, &delimited(1, b"a"))),
        Kind::Message(inner) => {
            let items = (inner.fields.iter()).filter_map(|field| match depth < 2 {
                true => item(field, depth + 1),
                false => None,
            });
            let items: Vec<_> = items.collect();
            Some(delimited(field.number, &items.concat()))
        }
    }
}

fn delimited(number: u32, content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode_key(number, WireType::LengthDelimited, &mut bytes);
    encode_varint(content.len() as u64, &mut bytes);
    bytes.extend(content);
    bytes
}
