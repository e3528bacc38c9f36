//! What tournaments and studies have in common. A unit is a value that changes by the entries of its
//! journal, and one task (`actor`) that commits entries before it publishes them or acts on them.
//! Others reach it through its handle (`unit`), which the `registry` of all units of a kind finds.
//! Rooms for its games are created in one way (`games`); what else the entries of a unit bring about
//! is in its own module.
//!
//! A room is not such a unit: its task decides on answers in microseconds (`room/`).

mod actor;
mod games;
mod registry;
mod table;
mod unit;

#[cfg(test)]
pub(crate) use games::ROOMS_AT_ONCE;
pub use registry::Registry;
pub(crate) use registry::owner_of;
pub(crate) use unit::New;
pub use unit::{Folded, Handle, Journaled, Stopped, Unit, UnitHeader};
