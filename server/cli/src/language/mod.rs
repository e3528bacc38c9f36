//! A table in words, for language models. docs/mcp.md describes the text form line by line.

pub(crate) mod cards;
pub(crate) mod events;
pub(crate) mod live;
#[cfg(test)]
mod tests;
pub(crate) mod text;
pub(crate) mod words;
