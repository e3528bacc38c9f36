//! Random edits of a valid input, for fuzz tests of decoders: what they give is almost valid, so it
//! reaches code that random bytes never would.

use bolero::TypeGenerator;

/// Edits, applied in order. Positions and lengths are taken modulo the length of the input, so that
/// every value is an edit of every input.
#[derive(Debug, Clone, TypeGenerator)]
pub struct Edits(#[generator(bolero::produce_with::<Vec<Edit>>().len(1..6usize))] Vec<Edit>);

#[derive(Debug, Clone, TypeGenerator)]
enum Edit {
    /// Replaces a byte.
    Replace { at: u32, byte: u8 },
    /// Changes a byte slightly: numbers go out of range, letters become others.
    Nudge { at: u32, by: i8 },
    /// Inserts bytes.
    Insert {
        at: u32,
        #[generator(bolero::produce_with::<Vec<u8>>().len(0..12usize))]
        bytes: Vec<u8>,
    },
    /// Inserts a text that has a meaning to some decoder.
    InsertText { at: u32, text: u8 },
    /// Removes bytes.
    Remove { at: u32, length: u8 },
    /// Copies a part to another place.
    Copy { from: u32, length: u16, to: u32 },
    /// Removes a line.
    RemoveLine { at: u32 },
    /// Repeats a line.
    RepeatLine { at: u32 },
    /// Cuts the input off.
    Cut { at: u32 },
}

/// Texts that have a meaning in JSON, in transcripts or as numbers.
const TEXTS: [&str; 16] = [
    "0",
    "-1",
    "1e999",
    "18446744073709551616",
    "4294967295",
    "null",
    "NaN",
    "\"",
    "{}",
    "[]",
    "{",
    "\n",
    "\u{feff}",
    "J",
    "G",
    "pass",
];

impl Edits {
    /// The edited input.
    pub fn apply(&self, input: &[u8]) -> Vec<u8> {
        let mut bytes = input.to_vec();
        for edit in &self.0 {
            edit.apply(&mut bytes);
        }
        bytes
    }
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        // One more than the last index: where a part can be inserted.
        let place = |at: u32, bytes: &[u8]| at as usize % (bytes.len() + 1);
        match self {
            Self::Replace { at, byte } => {
                if let Some(old) = byte_at(*at, bytes) {
                    *old = *byte;
                }
            }
            Self::Nudge { at, by } => {
                if let Some(old) = byte_at(*at, bytes) {
                    *old = old.wrapping_add_signed(*by);
                }
            }
            Self::Insert { at, bytes: new } => {
                let at = place(*at, bytes);
                bytes.splice(at..at, new.iter().copied());
            }
            Self::InsertText { at, text } => {
                let at = place(*at, bytes);
                let text = TEXTS[usize::from(*text) % TEXTS.len()];
                bytes.splice(at..at, text.bytes());
            }
            Self::Remove { at, length } => {
                let at = place(*at, bytes);
                let end = (at + usize::from(*length)).min(bytes.len());
                bytes.drain(at..end);
            }
            Self::Copy { from, length, to } => {
                let from = place(*from, bytes);
                let end = (from + usize::from(*length)).min(bytes.len());
                let part = bytes[from..end].to_vec();
                let to = place(*to, bytes);
                bytes.splice(to..to, part);
            }
            Self::RemoveLine { at } => {
                let (start, end) = line_around(place(*at, bytes), bytes);
                bytes.drain(start..end);
            }
            Self::RepeatLine { at } => {
                let (start, end) = line_around(place(*at, bytes), bytes);
                let line = bytes[start..end].to_vec();
                bytes.splice(end..end, line);
            }
            Self::Cut { at } => bytes.truncate(place(*at, bytes)),
        }
    }
}

fn byte_at(at: u32, bytes: &mut [u8]) -> Option<&mut u8> {
    let index = (at as usize).checked_rem(bytes.len())?;
    bytes.get_mut(index)
}

/// Start and end of the line around an index, its line break included.
fn line_around(at: usize, bytes: &[u8]) -> (usize, usize) {
    let is_break = |byte: &u8| *byte == b'\n';
    let start = (bytes[..at].iter().rposition(is_break)).map_or(0, |before| before + 1);
    let end = (bytes[at..].iter().position(is_break)).map_or(bytes.len(), |after| at + after + 1);
    (start, end)
}
