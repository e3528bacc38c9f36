//! Tournaments: getting in, who plays whom, who is waited for, what counts. Ratings and confidence have their own tests.

mod calls;
mod course;
mod deals;
mod entry;
mod knockout;
mod offline;
mod round_robin;
mod standings;
mod support;
mod swiss;
