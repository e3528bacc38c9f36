//! Writes frames as an animation: painted on all cores, encoded in order as an animated GIF or, by
//! ffmpeg, as an MP4.

use std::io::{self, Read as _, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use chefshat_record::atomic_file::AtomicFile;
use chefshat_render::{Frame, GifWriter, Painter, Palette, Pixels};
use rayon::prelude::*;

use chefshat_cli::error::CommandError;
use chefshat_cli::progress;

/// Frames painted per batch: enough for all cores within bounded memory.
const AT_A_TIME: usize = 32;
/// Frames sampled for a GIF's palette.
const PALETTE_FRAMES: usize = 12;
/// Frames per second of an MP4; a decision lasts a whole number of them.
const PICTURES_A_SECOND: u32 = 10;
/// Maximum length of ffmpeg's error output in a message.
const MAX_COMPLAINT: u64 = 2000;

/// The frames of an animation with their durations.
pub(super) struct Reel<'a> {
    frames: Vec<(&'a Frame, Duration)>,
    width: u32,
    painter: Painter,
}

impl<'a> Reel<'a> {
    /// A film with its width in pixels.
    pub(super) fn new(frames: Vec<(&'a Frame, Duration)>, width: u32) -> Self {
        Self {
            frames,
            width,
            painter: Painter::new(),
        }
    }

    /// Number of frames.
    pub(super) fn len(&self) -> usize {
        self.frames.len()
    }

    /// Total duration.
    pub(super) fn time(&self) -> Duration {
        self.frames.iter().map(|(_, shown_for)| *shown_for).sum()
    }

    /// Writes a GIF; returns its size.
    pub(super) fn gif(&self, path: &Path) -> Result<(u32, u32), CommandError> {
        let mut file = AtomicFile::create(path)?;
        let sample = self.sample()?;
        let size = sample
            .first()
            .map(|picture| (picture.width(), picture.height()))
            .ok_or("there is nothing to show")?;
        let palette = Palette::of(&sample);
        drop(sample);
        let mut gif = GifWriter::new(&mut file, size.0, size.1, palette)?;
        self.show(|picture, shown_for| {
            let hundredths = (shown_for.as_secs_f64() * 100.0).round();
            Ok(gif.add(picture, (hundredths as u16).max(1))?)
        })?;
        gif.finish()?;
        file.finish()?;
        Ok(size)
    }

    /// Writes an MP4 with ffmpeg; returns its size.
    pub(super) fn mp4(&self, path: &Path, program: &Path) -> Result<(u32, u32), CommandError> {
        let (first, _) = self.frames.first().ok_or("there is nothing to show")?;
        let first = self.paint(first)?;
        let size = (first.width(), first.height());
        let file = AtomicFile::create(path)?;
        let mut ffmpeg = Ffmpeg::start(program, size, file.part())?;
        let shown = self.show(|picture, shown_for| {
            let times = shown_for.as_secs_f64() * f64::from(PICTURES_A_SECOND);
            for _ in 0..(times.round() as u64).max(1) {
                let written = ffmpeg.input.write_all(picture.data());
                // Not the broken pipe of the output, after which a command ends well.
                written.map_err(|error| format!("{}: {error}", program.display()))?;
            }
            Ok(())
        });
        // When ffmpeg stops early, its own message explains more than the broken pipe.
        ffmpeg.finish()?;
        shown?;
        file.finish()?;
        Ok((size.0.next_multiple_of(2), size.1.next_multiple_of(2)))
    }

    fn paint(&self, frame: &Frame) -> Result<Pixels, CommandError> {
        let svg = self.painter.table(&frame.scene);
        Ok(self.painter.pixels(&svg, self.width)?)
    }

    /// Some frames, spread over the animation.
    fn sample(&self) -> Result<Vec<Pixels>, CommandError> {
        let step = self.frames.len().div_ceil(PALETTE_FRAMES).max(1);
        let frames: Vec<_> = self.frames.iter().step_by(step).collect();
        frames
            .par_iter()
            .map(|(frame, _)| self.paint(frame))
            .collect()
    }

    /// Paints all frames and passes them on in order.
    fn show(
        &self,
        mut take: impl FnMut(&Pixels, Duration) -> Result<(), CommandError>,
    ) -> Result<(), CommandError> {
        let total = self.frames.len().try_into().unwrap_or(u64::MAX);
        let bar = progress::of_items(total, "frames");
        for frames in self.frames.chunks(AT_A_TIME) {
            let painted: Result<Vec<_>, _> = frames
                .par_iter()
                .map(|&(frame, shown_for)| Ok::<_, CommandError>((self.paint(frame)?, shown_for)))
                .collect();
            for (picture, shown_for) in painted? {
                take(&picture, shown_for)?;
                bar.inc(1);
            }
        }
        bar.finish_and_clear();
        Ok(())
    }
}

/// A running ffmpeg that reads frames.
struct Ffmpeg {
    child: Child,
    input: ChildStdin,
    complaints: JoinHandle<io::Result<String>>,
}

impl Ffmpeg {
    fn start(
        program: &Path,
        (width, height): (u32, u32),
        out: &Path,
    ) -> Result<Self, CommandError> {
        let rate = PICTURES_A_SECOND.to_string();
        let mut child = Command::new(program)
            .args(["-hide_banner", "-loglevel", "error", "-y"])
            .args(["-f", "rawvideo", "-pixel_format", "rgba"])
            .args(["-video_size", &format!("{width}x{height}")])
            .args(["-framerate", &rate, "-i", "-"])
            // Common players support no other form, and it requires even sides.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"])
            .args(["-c:v", "libx264", "-pix_fmt", "yuv420p"])
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(out)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => format!(
                    "{} was not found: install ffmpeg, or choose a name that ends in .gif",
                    program.display()
                ),
                _ => format!("{}: {error}", program.display()),
            })?;
        let input = child.stdin.take().ok_or("ffmpeg has no input")?;
        let errors = child.stderr.take().ok_or("ffmpeg has no errors")?;
        let complaints = std::thread::spawn(move || {
            let (mut text, mut rest) = (Vec::new(), errors);
            rest.by_ref().take(MAX_COMPLAINT).read_to_end(&mut text)?;
            // The rest is drained so that ffmpeg does not block.
            io::copy(&mut rest, &mut io::sink())?;
            Ok(String::from_utf8_lossy(&text).trim().to_owned())
        });
        Ok(Self {
            child,
            input,
            complaints,
        })
    }

    fn finish(self) -> Result<(), CommandError> {
        let Self {
            mut child,
            input,
            complaints,
        } = self;
        drop(input);
        let status = child.wait()?;
        let said = match complaints.join() {
            Ok(said) => said.unwrap_or_default(),
            Err(_) => String::new(),
        };
        if status.success() {
            Ok(())
        } else {
            Err(format!("ffmpeg failed ({status}): {said}").into())
        }
    }
}
