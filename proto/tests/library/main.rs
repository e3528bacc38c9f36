//! The code of this crate that is not generated. Its tests are here, so that the library is compiled
//! once.

#[cfg(feature = "services")]
mod codec;
mod timestamp;
