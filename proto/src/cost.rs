//! What a message costs its receiver, counted in its encoded bytes before they are decoded. An empty
//! submessage takes 2 bytes and can decode into hundreds: a receiver that decodes first has already
//! paid. [`Shape`] holds what decoding depends on: which fields are lists and how large the decoded
//! messages are. `tests/generated/shapes.rs` generates one for each message.

mod worst;

use std::any::Any;

use prost::DecodeError;
use prost::encoding::{WireType, decode_key, decode_varint};

pub use worst::Filling;

/// The shapes of all messages, and the calls with their requests.
pub mod shapes {
    use super::{Field, Kind, Method, Shape};

    include!("../generated/shapes.rs");
}

/// Deepest nesting of messages that is counted. No message of the protocol needs half as much.
pub const MAX_DEPTH: u32 = 32;

/// Items for which a list has space after the first one is added.
const FIRST_ITEMS: usize = 4;
/// Items for which each further one may add space: capacities double, and the list before is still
/// there while the next one is filled.
const NEXT_ITEMS: usize = 3;
/// Bytes of a map with one entry.
const FIRST_ENTRY: usize = 640;
/// Bytes that each further entry of a map may add, beside its texts.
const NEXT_ENTRY: usize = 144;
/// Bytes that an allocation takes beside its content.
const ALLOCATION: usize = 24;

/// What decoding a message depends on.
#[derive(Debug)]
pub struct Shape {
    /// Its full name.
    pub name: &'static str,
    /// Bytes of the decoded message without what it points to.
    pub size: usize,
    /// Its fields.
    pub fields: &'static [Field],
}

/// A field of a message.
#[derive(Debug)]
pub struct Field {
    /// Its number.
    pub number: u32,
    /// Whether it is repeated.
    pub list: bool,
    /// Its type.
    pub kind: Kind,
}

/// The type of a field.
#[derive(Debug)]
pub enum Kind {
    /// A number of `size` bytes once it is decoded; encoded it has `width` bytes, or 0 for a varint.
    Number {
        /// Bytes as decoded.
        size: usize,
        /// Bytes as encoded.
        width: usize,
    },
    /// A string or bytes.
    Text,
    /// A message.
    Message(&'static Shape),
    /// An entry of a map.
    Entry(&'static Shape),
}

/// Decodes a message of some type.
pub type Decode = fn(&[u8]) -> Result<Box<dyn Any + Send>, DecodeError>;

/// A call.
#[derive(Debug)]
pub struct Method {
    /// Its path, as in HTTP.
    pub path: &'static str,
    /// The shape of its requests.
    pub request: &'static Shape,
    /// Decodes a request.
    pub decode: Decode,
}

impl Method {
    /// The call with this path.
    pub fn find(path: &str) -> Option<&'static Self> {
        shapes::METHODS.iter().find(|method| method.path == path)
    }
}

/// What a message costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    /// Submessages, texts in lists and entries of maps.
    pub elements: usize,
    /// Bytes that the decoded message takes at most, while it is decoded too.
    pub memory: usize,
}

impl Cost {
    /// More than any message costs.
    pub const MAX: Self = Self {
        elements: usize::MAX,
        memory: usize::MAX,
    };
}

/// Why a message is not decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Excess {
    /// It has too many elements.
    #[error("too many elements")]
    Elements,
    /// It would take too much memory.
    #[error("too much memory")]
    Memory,
    /// Its messages are nested too deeply.
    #[error("nested too deeply")]
    Depth,
    /// It cannot be read.
    #[error("not a message")]
    Malformed,
}

impl Shape {
    /// Counts what an encoded message of this shape costs, and stops at `most`.
    ///
    /// # Errors
    /// It costs more, or cannot be read.
    pub fn cost(&self, bytes: &[u8], most: Cost) -> Result<Cost, Excess> {
        let mut count = Count {
            cost: Cost::default(),
            most,
        };
        count.memory(self.size)?;
        count.message(self, bytes, 0)?;
        Ok(count.cost)
    }
}

struct Count {
    cost: Cost,
    most: Cost,
}

impl Count {
    fn message(&mut self, shape: &Shape, mut bytes: &[u8], depth: u32) -> Result<(), Excess> {
        if depth > MAX_DEPTH {
            return Err(Excess::Depth);
        }
        let mut last = 0;
        while !bytes.is_empty() {
            let (number, wire_type) = decode_key(&mut bytes).map_err(|_| Excess::Malformed)?;
            let field = shape.fields.iter().find(|field| field.number == number);
            // Overestimates lists whose items are mixed with other fields.
            let first = std::mem::replace(&mut last, number) != number;
            let width = match wire_type {
                WireType::Varint => {
                    decode_varint(&mut bytes).map_err(|_| Excess::Malformed)?;
                    0
                }
                WireType::ThirtyTwoBit => 4,
                WireType::SixtyFourBit => 8,
                WireType::LengthDelimited => {
                    let length = decode_varint(&mut bytes).map_err(|_| Excess::Malformed)?;
                    let length = usize::try_from(length).map_err(|_| Excess::Malformed)?;
                    let value = take(&mut bytes, length)?;
                    if let Some(field) = field {
                        self.delimited(field, value, first, depth)?;
                    }
                    continue;
                }
                WireType::StartGroup | WireType::EndGroup => return Err(Excess::Malformed),
            };
            take(&mut bytes, width)?;
            if let Some(Field {
                list: true,
                kind: Kind::Number { size, .. },
                ..
            }) = field
            {
                self.items(first, 1, *size)?;
            }
        }
        Ok(())
    }

    fn delimited(
        &mut self,
        field: &Field,
        value: &[u8],
        first: bool,
        depth: u32,
    ) -> Result<(), Excess> {
        match field.kind {
            Kind::Number { size, width } if field.list => {
                let count = match width {
                    0 => value.iter().filter(|byte| **byte < 0x80).count(),
                    width => value.len() / width,
                };
                self.items(first, count, size)
            }
            // The decoder refuses it.
            Kind::Number { .. } => Ok(()),
            Kind::Text => {
                if field.list {
                    self.element()?;
                    self.items(first, 1, size_of::<String>())?;
                }
                self.text(value.len())
            }
            Kind::Message(shape) => {
                self.element()?;
                match field.list {
                    true => self.items(first, 1, shape.size)?,
                    // It may have a box of its own.
                    false => self.memory(shape.size + ALLOCATION)?,
                }
                self.message(shape, value, depth + 1)
            }
            Kind::Entry(shape) => {
                self.element()?;
                self.memory(if first { FIRST_ENTRY } else { NEXT_ENTRY })?;
                self.message(shape, value, depth + 1)
            }
        }
    }

    /// Counts items of a list.
    fn items(&mut self, first: bool, count: usize, size: usize) -> Result<(), Excess> {
        let extra = if first { FIRST_ITEMS - NEXT_ITEMS } else { 0 };
        let allocation = if first { ALLOCATION } else { 0 };
        let spaces = NEXT_ITEMS.saturating_mul(count).saturating_add(extra);
        self.memory(spaces.saturating_mul(size).saturating_add(allocation))
    }

    fn text(&mut self, length: usize) -> Result<(), Excess> {
        match length {
            0 => Ok(()),
            length => self.memory(length.max(8) + ALLOCATION),
        }
    }

    fn element(&mut self) -> Result<(), Excess> {
        self.cost.elements += 1;
        match self.cost.elements > self.most.elements {
            true => Err(Excess::Elements),
            false => Ok(()),
        }
    }

    fn memory(&mut self, bytes: usize) -> Result<(), Excess> {
        self.cost.memory = self.cost.memory.saturating_add(bytes);
        match self.cost.memory > self.most.memory {
            true => Err(Excess::Memory),
            false => Ok(()),
        }
    }
}

fn take<'a>(bytes: &mut &'a [u8], length: usize) -> Result<&'a [u8], Excess> {
    let (taken, rest) = bytes.split_at_checked(length).ok_or(Excess::Malformed)?;
    *bytes = rest;
    Ok(taken)
}
