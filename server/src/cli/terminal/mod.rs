//! What `chefshat play` and `chefshat watch` share: the table as its events tell it (`table`, `hand`), what happened in words (`story`), how both are
//! drawn (`look`, `cards`, `log`, `view`), and the terminal itself (`screen`). All but `screen` are values and functions of values; what a person
//! may do is decided in `play` and `watch`.

pub(super) mod cards;
pub(super) mod hand;
pub(super) mod log;
pub(super) mod look;
pub(super) mod screen;
mod story;
pub(super) mod table;
#[cfg(test)]
pub(super) mod testing;
#[cfg(test)]
mod tests;
pub(super) mod view;
