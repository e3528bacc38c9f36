//! Animated GIFs with one palette, in which a frame contains only what has changed.

use std::collections::HashMap;
use std::io::Write;

use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use resvg::tiny_skia::Pixmap;

/// The most colours of a palette; one of GIF's 256 indices means transparent.
const MAX_COLOURS: usize = 255;
/// The index that leaves a pixel unchanged.
const UNCHANGED: u8 = 255;
/// Squared distance between palette colours in the first attempt to fill it.
const FAR_APART: u32 = 900;

/// A failure to write a GIF.
#[derive(Debug, thiserror::Error)]
pub enum GifError {
    /// GIF has 16 bits for each side.
    #[error("a GIF can be at most 65535 pixels wide and high")]
    TooLarge,
    /// A picture differs in size.
    #[error("all pictures of a GIF must have the same size")]
    OtherSize,
    /// The output failed.
    #[error("{0}")]
    Write(#[from] EncodingError),
}

type Colour = [u8; 3];

/// The colours of a film, from a sample of its pictures. Drawings have few colours, and blends at
/// edges are close to one of them.
#[derive(Debug, Clone)]
pub struct Palette {
    colours: Vec<Colour>,
}

impl Palette {
    /// The most frequent colours of the pictures, skipping those close to a more frequent one
    /// while there is room. Unlike a quantizer that averages, this keeps flat colours exact.
    pub fn of<'a>(pictures: impl IntoIterator<Item = &'a Pixmap>) -> Palette {
        let mut counts: HashMap<Colour, u64> = HashMap::new();
        for picture in pictures {
            for pixel in picture.pixels() {
                *counts
                    .entry([pixel.red(), pixel.green(), pixel.blue()])
                    .or_default() += 1;
            }
        }
        let mut counts: Vec<(Colour, u64)> = counts.into_iter().collect();
        counts.sort_unstable_by_key(|&(colour, count)| (std::cmp::Reverse(count), colour));
        let mut colours: Vec<Colour> = Vec::new();
        let mut apart = FAR_APART;
        while apart > 0 && colours.len() < MAX_COLOURS {
            for &(colour, _) in &counts {
                if colours.len() == MAX_COLOURS {
                    break;
                }
                if colours
                    .iter()
                    .all(|&other| distance(colour, other) >= apart)
                {
                    colours.push(colour);
                }
            }
            apart /= 2;
        }
        Palette { colours }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.colours.concat();
        // The transparent index needs a colour too.
        bytes.resize(3 * (MAX_COLOURS + 1), 0);
        bytes
    }

    fn nearest(&self, colour: Colour) -> u8 {
        let nearest = (0..)
            .zip(&self.colours)
            .min_by_key(|&(_, &other)| distance(colour, other));
        nearest.map_or(0, |(index, _)| index)
    }
}

fn distance(one: Colour, other: Colour) -> u32 {
    one.iter()
        .zip(other)
        .map(|(&a, b)| u32::from(a.abs_diff(b)).pow(2))
        .sum()
}

/// Writes a GIF picture by picture.
pub struct GifWriter<W: Write> {
    encoder: Encoder<W>,
    palette: Palette,
    size: (u16, u16),
    indices: HashMap<Colour, u8>,
    /// The previous picture, as palette indices.
    before: Vec<u8>,
    /// The last frame, unwritten because it may last longer.
    pending: Option<Frame<'static>>,
}

impl<W: Write> std::fmt::Debug for GifWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GifWriter")
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl<W: Write> GifWriter<W> {
    /// Starts a GIF that repeats forever.
    ///
    /// # Errors
    /// The size is too large, or the output fails.
    pub fn new(out: W, width: u32, height: u32, palette: Palette) -> Result<Self, GifError> {
        let side = |pixels| u16::try_from(pixels).map_err(|_| GifError::TooLarge);
        let size = (side(width)?, side(height)?);
        let mut encoder = Encoder::new(out, size.0, size.1, &palette.bytes())?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self {
            encoder,
            palette,
            size,
            indices: HashMap::new(),
            before: Vec::new(),
            pending: None,
        })
    }

    /// Adds a picture, shown for a number of hundredths of a second.
    ///
    /// # Errors
    /// The size differs, or the output fails.
    pub fn add(&mut self, picture: &Pixmap, hundredths: u16) -> Result<(), GifError> {
        let (width, height) = (usize::from(self.size.0), usize::from(self.size.1));
        if (picture.width(), picture.height()) != (self.size.0.into(), self.size.1.into()) {
            return Err(GifError::OtherSize);
        }
        let now = self.indices_of(picture);
        let Some(changed) = Rectangle::of_change(&self.before, &now, width, height) else {
            if let Some(pending) = &mut self.pending {
                pending.delay = pending.delay.saturating_add(hundredths);
            }
            return Ok(());
        };
        let part = |picture: &[u8], y: usize| {
            let row = y * width;
            picture[row + changed.left..row + changed.right].to_vec()
        };
        let mut buffer = Vec::with_capacity(changed.width() * changed.height());
        for y in changed.top..changed.bottom {
            let mut row = part(&now, y);
            if !self.before.is_empty() {
                for (number, before) in row.iter_mut().zip(part(&self.before, y)) {
                    if *number == before {
                        *number = UNCHANGED;
                    }
                }
            }
            buffer.append(&mut row);
        }
        let side = |pixels: usize| u16::try_from(pixels).expect("a part fits into the picture");
        let frame = Frame {
            delay: hundredths,
            dispose: DisposalMethod::Keep,
            transparent: Some(UNCHANGED),
            left: side(changed.left),
            top: side(changed.top),
            width: side(changed.width()),
            height: side(changed.height()),
            buffer: buffer.into(),
            ..Frame::default()
        };
        self.before = now;
        if let Some(done) = self.pending.replace(frame) {
            self.encoder.write_frame(&done)?;
        }
        Ok(())
    }

    /// Writes the last frame and returns the output.
    ///
    /// # Errors
    /// The output fails.
    pub fn finish(mut self) -> Result<W, GifError> {
        if let Some(last) = self.pending.take() {
            self.encoder.write_frame(&last)?;
        }
        Ok(self.encoder.into_inner()?)
    }

    fn indices_of(&mut self, picture: &Pixmap) -> Vec<u8> {
        let (palette, indices) = (&self.palette, &mut self.indices);
        picture
            .pixels()
            .iter()
            .map(|pixel| {
                let colour = [pixel.red(), pixel.green(), pixel.blue()];
                *indices
                    .entry(colour)
                    .or_insert_with(|| palette.nearest(colour))
            })
            .collect()
    }
}

/// A part of a picture; right and bottom are exclusive.
struct Rectangle {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
}

impl Rectangle {
    fn width(&self) -> usize {
        self.right - self.left
    }

    fn height(&self) -> usize {
        self.bottom - self.top
    }

    /// The bounding box of all changes; the complete picture if it is the first; `None` if nothing
    /// changed.
    fn of_change(before: &[u8], now: &[u8], width: usize, height: usize) -> Option<Rectangle> {
        if before.is_empty() {
            return Some(Rectangle {
                left: 0,
                top: 0,
                right: width,
                bottom: height,
            });
        }
        let rows = || before.chunks(width).zip(now.chunks(width));
        let changed = |(old, new): (&[u8], &[u8])| old != new;
        let top = rows().position(changed)?;
        let bottom = height - rows().rev().position(changed)?;
        let differs = |(old, new): (&u8, &u8)| old != new;
        let left = rows()
            .filter_map(|(old, new)| old.iter().zip(new).position(differs))
            .min()?;
        let right = rows()
            .filter_map(|(old, new)| old.iter().zip(new).rposition(differs))
            .max()?;
        Some(Rectangle {
            left,
            top,
            right: right + 1,
            bottom,
        })
    }
}
