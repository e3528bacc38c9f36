//! Pictures in texts. Their files are kept elsewhere.

use crate::checks::{Checked, identifier, is_of_identifier, refuse, within};

/// Maximum number of pictures of a study.
pub(crate) const MAX_PICTURES: usize = 16;
/// Largest file of a picture, in bytes.
const MAX_BYTES: usize = 262_144;
/// Most bytes of all pictures of a study together.
pub(crate) const MAX_BYTES_IN_ALL: usize = 524_288;

/// A picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Its name in texts.
    pub name: String,
    /// Length of its file, in bytes, at most 262144.
    pub bytes: usize,
    /// What its file is; `None` if that is none of the formats that every browser shows.
    pub format: Option<PictureFormat>,
}

/// The format of a picture, as its file begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG.
    Jpeg,
    /// Graphics Interchange Format.
    Gif,
    /// WebP.
    WebP,
}

impl Picture {
    /// The picture of a file.
    pub fn new(name: String, file: &[u8]) -> Self {
        Self {
            name,
            bytes: file.len(),
            format: PictureFormat::of(file),
        }
    }

    pub(crate) fn check(&self, field: &str) -> Checked {
        let name = format!("{field}.name");
        identifier(&name, &self.name)?;
        // Exported data have it as the name of a file.
        if self.name.starts_with('.') || self.name.chars().any(|it| it.is_ascii_uppercase()) {
            return refuse(name, "use lower-case letters, and no dot at the beginning");
        }
        let data = format!("{field}.data");
        within(&data, self.bytes, 1..=MAX_BYTES)?;
        match self.format {
            Some(_) => Ok(()),
            None => refuse(data, "it is not a PNG, JPEG, GIF or WebP file"),
        }
    }
}

impl PictureFormat {
    /// The format of a file.
    fn of(file: &[u8]) -> Option<Self> {
        match file {
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'G', b'I', b'F', b'8', ..] => Some(Self::Gif),
            [
                b'R',
                b'I',
                b'F',
                b'F',
                _,
                _,
                _,
                _,
                b'W',
                b'E',
                b'B',
                b'P',
                ..,
            ] => Some(Self::WebP),
            _ => None,
        }
    }
}

/// Whether a text has the whole name, not only within a longer one.
pub(crate) fn names(text: &str, name: &str) -> bool {
    text.match_indices(name).any(|(start, _)| {
        let (before, after) = (
            text[..start].chars().next_back(),
            text[start + name.len()..].chars().next(),
        );
        ![before, after].into_iter().flatten().any(is_of_identifier)
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Settings, Study, testing};

    #[test]
    fn pictures_are_refused_by_what_is_wrong_with_them() {
        let picture = |name: &str, bytes| Picture {
            name: name.to_owned(),
            bytes,
            format: Some(PictureFormat::Png),
        };
        let hand = picture("hand.png", MAX_BYTES);
        let unknown = Picture::new("hand.svg".to_owned(), b"<svg/>");
        for (pictures, field) in [
            (vec![picture("two hands", 1)], "pictures[0].name"),
            (vec![picture("Hand", 1)], "pictures[0].name"),
            (vec![picture("..", 1)], "pictures[0].name"),
            (vec![hand.clone(), hand.clone()], "pictures[1].name"),
            (vec![picture("hand", 0)], "pictures[0].data"),
            (vec![picture("hand", MAX_BYTES + 1)], "pictures[0].data"),
            (vec![unknown], "pictures[0].data"),
            (
                ["a", "b", "c"].map(|name| picture(name, MAX_BYTES)).into(),
                "pictures",
            ),
            (vec![hand.clone(); MAX_PICTURES + 1], "pictures"),
        ] {
            let settings = Settings {
                pictures,
                ..testing::settings()
            };
            let refused = Study::new(Arc::new(settings)).expect_err(field);
            assert_eq!(refused.field, field, "{refused}");
        }
        let settings = Settings {
            pictures: vec![hand, picture("2_hands.png", MAX_BYTES)],
            ..testing::settings()
        };
        Study::new(Arc::new(settings)).expect("they are as large as pictures may be");
    }

    #[test]
    fn a_text_names_a_picture_by_its_whole_name() {
        for (text, expected) in [
            ("![one](1.png)", true),
            ("![it][p]\n\n[p]: 1.png", true),
            ("![eleven](11.png) ![more](1.png.gif)", false),
            ("![eleven](11.png) ![one](1.png)", true),
            ("", false),
        ] {
            assert_eq!(names(text, "1.png"), expected, "{text}");
        }
    }

    #[test]
    fn files_are_known_by_how_they_begin() {
        for (file, expected) in [
            (&b"\x89PNG\r\n\x1a\n"[..], Some(PictureFormat::Png)),
            (b"\xff\xd8\xff\xe0", Some(PictureFormat::Jpeg)),
            (b"GIF89a", Some(PictureFormat::Gif)),
            (b"RIFF\x10\0\0\0WEBPVP8 ", Some(PictureFormat::WebP)),
            (b"RIFF\x10\0\0\0WAVEfmt ", None),
            (b"<svg xmlns='http://www.w3.org/2000/svg'>", None),
            (b"", None),
        ] {
            assert_eq!(Picture::new("p".to_owned(), file).format, expected);
        }
    }
}
