//! Pictures of games: the table at one moment, a film of a game, the action table of a decision.
//!
//! A [`Film`] is a record as [`Scene`]s for one viewer; a [`Painter`] draws a scene as SVG and SVG
//! as pixels; a [`GifWriter`] encodes pixels as a GIF. [`Scene::of`] also accepts a game in
//! progress. Files, threads and video encoders are left to the caller.

mod card;
mod chronicle;
mod figure;
mod figure_svg;
mod film;
mod gif;
mod paint;
mod scene;
mod table;

pub use card::Card;
pub use chronicle::{Chronicle, LogEntry, Participant, ParticipantKind, Presence};
pub use figure::{Figure, State};
pub use film::{Film, FilmError, Frame, Perspective, When, figure_at, frame_at};
pub use gif::{GifError, GifWriter, Palette};
pub use paint::{MAX_WIDTH, MIN_WIDTH, PaintError, Painter, Pixels};
pub use scene::{Hand, Now, Scene, SeatScene};
