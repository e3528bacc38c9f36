//! What a participant's device is, as its page describes it.

/// Longest name of a time zone, in characters.
const MAX_TIME_ZONE: usize = 64;

/// A device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Device {
    /// Width of the page, in CSS pixels, from 1.
    pub width: u16,
    /// Height of the page, in CSS pixels, from 1.
    pub height: u16,
    /// Pixels of the display in a hundred CSS pixels, from 1.
    pub pixels: u16,
    /// Its most exact pointer; `None` if it is not known.
    pub pointer: Option<Pointer>,
    /// Its time zone, 1..=64 letters, digits, `_`, `-`, `+` or `/`.
    pub time_zone: String,
}

/// A pointer, as the media features of CSS have it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pointer {
    /// There is none.
    None,
    /// Such as a finger.
    Coarse,
    /// Such as a mouse.
    Fine,
}

impl Device {
    /// Whether everything is within its range.
    pub fn is_valid(&self) -> bool {
        let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || b"_-+/".contains(&byte);
        self.width > 0
            && self.height > 0
            && self.pixels > 0
            && (1..=MAX_TIME_ZONE).contains(&self.time_zone.len())
            && self.time_zone.bytes().all(is_letter)
    }
}

/// A session that a participant opened on a device that is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceSession {
    /// When it was opened, in milliseconds since the Unix epoch.
    pub at_ms: u64,
    /// The device.
    pub device: Device,
}
