//! The terminal client of `chefshat play` and `chefshat watch`, and what both share: the table
//! (`view`), cards, story and theme as widgets, and the terminal itself (`screen`). The state they
//! draw is that of `narration`; what a person may do is decided in `play` and `watch`.

pub(crate) mod cards;
pub(crate) mod log;
pub(crate) mod play;
pub(crate) mod screen;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
pub(crate) mod theme;
pub(crate) mod view;
pub(crate) mod watch;
