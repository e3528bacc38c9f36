//! What `chefshat play` and `chefshat watch` share: the table as its events tell it (`table`, `hand`), what happened in words (`story`), how both are
//! drawn (`look`, `cards`, `log`, `view`), and the terminal itself (`screen`). All but `screen` are values and functions of values; what a person
//! may do is decided in `play` and `watch`.

pub(crate) mod cards;
pub(crate) mod hand;
pub(crate) mod log;
pub(crate) mod look;
pub(crate) mod play;
pub(crate) mod screen;
mod story;
pub(crate) mod table;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
pub(crate) mod view;
pub(crate) mod watch;
