//! What a participant's device is, as its page describes it, and which one a study needs.

use crate::checks::{Checked, refuse, within};

/// Largest width and height, in CSS pixels, and most pixels in a hundred of them.
const MAX_LENGTH: u32 = 65_535;
/// Longest name of a time zone, in characters.
const MAX_TIME_ZONE: usize = 64;
/// The largest width that a page may need, in CSS pixels.
const MAX_NEEDED_WIDTH: u16 = 3840;

/// A device, in the form in which it is stored.
#[derive(Clone, PartialEq, Eq, prost::Message)]
pub struct Device {
    /// Width of the page, in CSS pixels, 1..=65535.
    #[prost(uint32, tag = "1")]
    pub width: u32,
    /// Height of the page, in CSS pixels, 1..=65535.
    #[prost(uint32, tag = "2")]
    pub height: u32,
    /// Pixels of the display in a hundred CSS pixels, 1..=65535.
    #[prost(uint32, tag = "3")]
    pub pixels: u32,
    /// Number of its most exact [`Pointer`]; 0 if it is not known.
    #[prost(uint32, tag = "4")]
    pub pointer: u32,
    /// Its time zone, 1..=64 letters, digits, `_`, `-`, `+` or `/`.
    #[prost(string, tag = "5")]
    pub time_zone: String,
}

/// A pointer, as the media features of CSS have it, by its number in stored devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pointer {
    /// There is none.
    None = 1,
    /// Such as a finger.
    Coarse = 2,
    /// Such as a mouse.
    Fine = 3,
}

impl Device {
    /// Its most exact pointer; `None` if it is not known.
    pub fn pointer(&self) -> Option<Pointer> {
        let mut pointers = [Pointer::None, Pointer::Coarse, Pointer::Fine].into_iter();
        pointers.find(|it| *it as u32 == self.pointer)
    }

    /// Whether everything is within its range.
    pub fn is_valid(&self) -> bool {
        let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || b"_-+/".contains(&byte);
        let lengths = [self.width, self.height, self.pixels];
        (lengths.iter().all(|it| (1..=MAX_LENGTH).contains(it)))
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

/// The device that participants need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RequiredDevice {
    /// Its most exact pointer: fine for a computer, coarse for a phone or tablet; `None`: any.
    pub pointer: Option<Pointer>,
    /// Least width of the page, in CSS pixels, at most 3840; 0: any.
    pub min_width: u16,
}

impl RequiredDevice {
    pub(crate) fn check(self, field: &str) -> Checked {
        if self.pointer == Some(Pointer::None) {
            return refuse(format!("{field}.pointer"), "choose FINE or COARSE");
        }
        let least = format!("{field}.min_width");
        within(&least, self.min_width, 0..=MAX_NEEDED_WIDTH)
    }

    /// Whether a device is one that is needed. One whose pointer is not known has none.
    pub(crate) fn is_met_by(self, device: &Device) -> bool {
        let has_pointer = self.pointer.is_none() || self.pointer == device.pointer();
        has_pointer && device.width >= self.min_width.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_has_the_pointer_and_the_width_that_are_needed() {
        let required = |pointer, min_width| RequiredDevice { pointer, min_width };
        let computer = required(Some(Pointer::Fine), 1024);
        let touch = required(Some(Pointer::Coarse), 0);
        let wide = required(None, 600);
        let device = |pointer: Option<Pointer>, width| Device {
            width,
            height: 800,
            pixels: 100,
            pointer: pointer.map_or(0, |it| it as u32),
            time_zone: "Europe/Rome".to_owned(),
        };
        for (pointer, width, met_by) in [
            (Some(Pointer::Fine), 1024, [true, false, true]),
            (Some(Pointer::Fine), 1023, [false, false, true]),
            (Some(Pointer::Coarse), 390, [false, true, false]),
            (Some(Pointer::Coarse), 1366, [false, true, true]),
            (Some(Pointer::None), 1366, [false, false, true]),
            (None, 1366, [false, false, true]),
        ] {
            let device = device(pointer, width);
            let met = [computer, touch, wide].map(|it| it.is_met_by(&device));
            assert_eq!(met, met_by, "{device:?}");
        }
        assert!(required(None, 3840).check("device").is_ok());
        let refused = |device: RequiredDevice| device.check("device").unwrap_err().field;
        assert_eq!(refused(required(None, 3841)), "device.min_width");
        assert_eq!(refused(required(Some(Pointer::None), 0)), "device.pointer");
    }
}
