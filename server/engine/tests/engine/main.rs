//! The tests of the rule engine, one binary. Each module below is a subject; what several of them need is in `support`.

mod support;
mod vectors;
