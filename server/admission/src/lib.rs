//! Who may do what, and how much: tokens, roles, the calls with what their messages cost, shares, rates
//! and memory.

pub mod access;
pub mod limits;
