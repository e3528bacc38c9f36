//! `chefshat render`: draws a record as a picture or an animation. `chefshat-render` draws the
//! frames; the module below writes them to a file.

mod reel;

use std::io::{self, Write as _};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::jsonl;
use chefshat_render::{Film, Frame, Painter, Perspective, When, figure_at, frame_at};
use clap::{Args, ValueEnum};
use serde_json::json;

use chefshat_cli::error::{CommandError, say};
use reel::Reel;

const HELP: &str = "\
The name of FILE selects the format: .png and .svg show one moment, .gif and .mp4 an animation (.mp4 needs ffmpeg). A moment is the \
number of a decision, counted from 1 over the game.

Examples:
  chefshat render game.jsonl --out end.png
  chefshat render game.jsonl --at 57 --seat 2 --out what-seat-2-saw.png
  chefshat render game.jsonl --shift 1 --out shift.gif --seconds-per-decision 0.5
  chefshat render game.jsonl --from 40 --to 60 --real-time --out moments.mp4
  chefshat render game.jsonl --at 57 --figure actions --out table.svg

docs/pictures.md shows examples.";

/// Default width of a picture, in pixels.
const PICTURE_WIDTH: u32 = 1280;
/// Default width of an animation, in pixels.
const FILM_WIDTH: u32 = 960;
/// Duration of the end of a Shift or game, in decisions.
const END_DECISIONS: f64 = 3.0;
/// Minimum duration of a decision in real time, in seconds: built-in agents take none.
const SHORTEST_SECONDS: f64 = 0.2;

/// Draw a record: a picture of a moment, an animation of a game, or the action table of a decision.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Render {
    /// The record (JSON Lines), or - for standard input.
    record: PathBuf,
    /// The file to write: .png, .svg, .gif or .mp4, or - for a PNG on standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What to draw.
    #[arg(long, value_enum, default_value_t = Drawn::Table)]
    figure: Drawn,
    /// Picture: the open decision, or `end`. Default: the end of the game, or of the Shift given by
    /// --shift.
    #[arg(long, value_name = "DECISION", value_parser = moment, conflicts_with_all = ["from", "to"])]
    at: Option<At>,
    /// Animation: first decision. Default: the first of the game.
    #[arg(long, value_name = "DECISION")]
    from: Option<u64>,
    /// Animation: last decision. Default: the last of the game.
    #[arg(long, value_name = "DECISION")]
    to: Option<u64>,
    /// Animation: only this Shift. Picture: its end.
    #[arg(long, value_name = "SHIFT", conflicts_with_all = ["from", "to", "at"])]
    shift: Option<u32>,
    /// Show only what this seat saw, counted from 0; other hands are face down.
    #[arg(long, value_name = "SEAT", conflicts_with = "spectator")]
    seat: Option<u32>,
    /// Show only what spectators saw: all hands are face down.
    #[arg(long)]
    spectator: bool,
    /// Animation: duration of each decision.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds)]
    seconds_per_decision: f64,
    /// Animation: show each decision for the time it took, divided by this factor.
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, default_missing_value = "1", value_parser = factor, conflicts_with = "seconds_per_decision")]
    real_time: Option<f64>,
    /// Animation in real time: maximum duration of a decision.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = seconds)]
    longest: f64,
    /// Width in pixels. Default: 1280 for a picture, 960 for an animation.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(width_range()))]
    width: Option<u32>,
    /// Program that encodes .mp4 files.
    #[arg(long, value_name = "PROGRAM", default_value = "ffmpeg")]
    ffmpeg: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Drawn {
    /// The table and its players.
    Table,
    /// The action table of the open decision: legal actions, and those this hand could take.
    Actions,
}

/// The moment of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum At {
    Decision(u64),
    End,
}

/// The kinds of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Png,
    Svg,
    Gif,
    Mp4,
}

fn width_range() -> RangeInclusive<i64> {
    use chefshat_render::{MAX_WIDTH, MIN_WIDTH};
    MIN_WIDTH.into()..=MAX_WIDTH.into()
}

fn moment(text: &str) -> Result<At, String> {
    match text {
        "end" => Ok(At::End),
        number => number
            .parse()
            .map(At::Decision)
            .map_err(|_| "use the number of a decision, from 1, or end".to_owned()),
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    positive(text, 600.0).ok_or_else(|| "use seconds above 0, at most 600".to_owned())
}

fn factor(text: &str) -> Result<f64, String> {
    positive(text, 1000.0).ok_or_else(|| "use a number above 0, at most 1000".to_owned())
}

/// Whether a path stands for standard input or output.
fn is_standard(path: &Path) -> bool {
    path == "-"
}

fn positive(text: &str, most: f64) -> Option<f64> {
    let number: f64 = text.parse().ok()?;
    (number > 0.0 && number <= most).then_some(number)
}

impl Kind {
    fn of(path: &Path) -> Result<Kind, CommandError> {
        if is_standard(path) {
            return Ok(Kind::Png);
        }
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.map(str::to_ascii_lowercase).as_deref() {
            Some("png") => Ok(Kind::Png),
            Some("svg") => Ok(Kind::Svg),
            Some("gif") => Ok(Kind::Gif),
            Some("mp4") => Ok(Kind::Mp4),
            _ => Err(format!(
                "--out {}: unknown kind of file; choose a name that ends in .png, .svg, .gif or .mp4",
                path.display()
            )
            .into()),
        }
    }

    fn is_film(self) -> bool {
        matches!(self, Kind::Gif | Kind::Mp4)
    }

    fn name(self) -> &'static str {
        match self {
            Kind::Png => "png",
            Kind::Svg => "svg",
            Kind::Gif => "gif",
            Kind::Mp4 => "mp4",
        }
    }
}

/// What was written.
struct Written {
    width: u32,
    height: u32,
    frames: usize,
    time: Duration,
}

impl Render {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let kind = Kind::of(&self.out)?;
        self.check(kind)?;
        let lines = match is_standard(&self.record) {
            true => jsonl::read_text(Path::new("standard input"), io::stdin().lock())?.lines,
            false => jsonl::read(&self.record)?,
        };
        let written = if kind.is_film() {
            self.film(&lines, kind)?
        } else {
            self.picture(&lines, kind)?
        };
        self.print(kind, &written)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Refuses flags that do not fit the kind of file.
    fn check(&self, kind: Kind) -> Result<(), CommandError> {
        let name = self.out.display();
        if kind.is_film() && self.at.is_some() {
            return Err(format!("--at selects one moment, but {name} is an animation: use --from and --to, or --shift").into());
        }
        if kind.is_film() && self.figure == Drawn::Actions {
            return Err(
                "--figure actions shows one moment: choose a name that ends in .png or .svg".into(),
            );
        }
        if !kind.is_film() && (self.from.is_some() || self.to.is_some()) {
            return Err(format!(
                "--from and --to select several moments, but {name} is a picture: use --at"
            )
            .into());
        }
        if self.figure == Drawn::Actions && !matches!(self.at, Some(At::Decision(_))) {
            return Err("--figure actions shows an open decision: select it with --at".into());
        }
        Ok(())
    }

    fn perspective(&self) -> Perspective {
        match self.seat {
            Some(seat) => Perspective::Seat(seat),
            None if self.spectator => Perspective::Spectator,
            None => Perspective::All,
        }
    }

    /// An error with the name of the record.
    fn of_record(&self, error: impl std::fmt::Display) -> CommandError {
        format!("{}: {error}", self.record.display()).into()
    }

    fn picture(&self, lines: &[v1::RecordLine], kind: Kind) -> Result<Written, CommandError> {
        let painter = Painter::new();
        let svg = match (self.figure, self.at) {
            (Drawn::Actions, Some(At::Decision(decision))) => {
                let figure = figure_at(lines, self.perspective(), decision);
                painter.figure(&figure.map_err(|error| self.of_record(error))?)
            }
            (_, at) => {
                let when = match (at, self.shift) {
                    (Some(At::Decision(decision)), _) => When::Decision(decision),
                    (_, Some(shift)) => When::ShiftEnd(shift),
                    _ => When::End,
                };
                let frame = frame_at(lines, self.perspective(), when);
                painter.table(&frame.map_err(|error| self.of_record(error))?.scene)
            }
        };
        let width = self.width.unwrap_or(PICTURE_WIDTH);
        let pixels = painter.pixels(&svg, width)?;
        let bytes = match kind {
            Kind::Svg => painter.outlined(&svg, width)?.into_bytes(),
            _ => painter.png(&pixels)?,
        };
        if is_standard(&self.out) {
            io::stdout().lock().write_all(&bytes)?;
        } else {
            let mut file = AtomicFile::create(&self.out)?;
            file.write_all(&bytes)?;
            file.finish()?;
        }
        Ok(Written {
            width: pixels.width(),
            height: pixels.height(),
            frames: 1,
            time: Duration::ZERO,
        })
    }

    fn film(&self, lines: &[v1::RecordLine], kind: Kind) -> Result<Written, CommandError> {
        let film = Film::new(lines, self.perspective()).map_err(|error| self.of_record(error))?;
        let frames = match self.shift {
            Some(shift) => film.shift(shift),
            None => {
                let (from, to) = (self.from.unwrap_or(1), self.to.unwrap_or(film.decisions()));
                if from > to {
                    return Err(format!("--from {from} is after --to {to}").into());
                }
                film.range(from..=to)
            }
        }
        .map_err(|error| self.of_record(error))?;
        let timed: Vec<(&Frame, Duration)> = frames
            .into_iter()
            .map(|frame| (frame, self.shown_for(frame)))
            .collect();
        let reel = Reel::new(timed, self.width.unwrap_or(FILM_WIDTH));
        let (width, height) = match kind {
            Kind::Mp4 => reel.mp4(&self.out, &self.ffmpeg)?,
            _ => reel.gif(&self.out)?,
        };
        Ok(Written {
            width,
            height,
            frames: reel.len(),
            time: reel.time(),
        })
    }

    /// The duration of a frame.
    fn shown_for(&self, frame: &Frame) -> Duration {
        let is_end = !matches!(frame.when, When::Decision(_));
        let seconds = match self.real_time {
            _ if is_end => END_DECISIONS * self.seconds_per_decision,
            None => self.seconds_per_decision,
            Some(factor) => {
                let took = frame.decision_time.as_secs_f64() / factor;
                took.max(SHORTEST_SECONDS).min(self.longest)
            }
        };
        Duration::from_secs_f64(seconds)
    }

    fn print(&self, kind: Kind, written: &Written) -> Result<(), CommandError> {
        // The picture has the standard output.
        if is_standard(&self.out) {
            return Ok(());
        }
        let bytes = std::fs::metadata(&self.out)?.len();
        let Written {
            width,
            height,
            frames,
            time,
        } = written;
        let seconds = time.as_secs_f64();
        if self.json {
            return say(json!({
                "file": self.out.display().to_string(),
                "kind": kind.name(),
                "width": width,
                "height": height,
                "frames": frames,
                "seconds": seconds,
                "bytes": bytes,
            }));
        }
        let name = self.out.display();
        if kind.is_film() {
            say(format_args!(
                "{name}: {frames} frames, {seconds:.1} s, {width} × {height}, {bytes} bytes"
            ))
        } else {
            say(format_args!("{name}: {width} × {height}, {bytes} bytes"))
        }
    }
}
