//! Pictures of games: the table at a moment, a film of a game, the look-up table of a decision.
//!
//! A record becomes a [`Film`] of [`Scene`]s, each as one viewer sees it; a [`Painter`] draws a scene as SVG and SVG as pixels; a
//! [`GifWriter`] puts pixels in a row. A scene is a value made of a game and what is known beside it ([`Scene::of`]), so that a game that
//! is still being played can be drawn as well. Files, threads and film programs are left to whoever uses this.

mod chronicle;
mod figure;
mod figure_svg;
mod film;
mod gif;
mod paint;
mod scene;
mod table;

pub use chronicle::{Chronicle, Happening, Participant, Presence, Sort};
pub use figure::{Figure, State};
pub use film::{Eyes, Film, FilmError, Frame, When, figure_at};
pub use gif::{GifError, GifWriter, Palette};
pub use paint::{MAX_WIDTH, MIN_WIDTH, PaintError, Painter, Pixels};
pub use scene::{Card, Hand, Now, Scene, SeatScene};
