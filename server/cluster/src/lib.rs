//! Which node of a cluster owns a room or tournament. Several servers (*nodes*) share one database. What changes hands together is a
//! *unit*: a room that belongs to no tournament, or a tournament with all its rooms. Each unit is owned by at most one node, which
//! runs it. This crate decides and remembers; it has no IO, clock or threads. `Node` is what one server knows and wants, and
//! `Tables` is what the database must do, as a value: real ones are tested against it.
//!
//! Safety and liveness are separate. *Safety* is the epoch: each takeover raises it, and the database commits an entry only if
//! its writer has the present one. *Liveness* is the lease: a node that does not beat loses what it owns. A lease that is
//! wrong for any reason costs time, never a decision.

mod balance;
mod lease;
mod node;
mod tables;

pub use balance::{Load, place, surplus};
pub use lease::{Lease, LeaseTimes, WrongTimes};
pub use node::{BeatAnswer, ClaimAnswer, Input, Node, Output, Phase};
pub use tables::{Created, Row, Tables, Written};

/// Identifies a node: one run of a server. Numbers are given by the database and never used again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u64);

/// How often a unit has been taken over, from 1, when it is created.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Epoch(pub u64);

impl Epoch {
    /// The epoch of a new unit.
    pub const FIRST: Self = Self(1);

    /// The epoch after the next takeover.
    pub fn next(self) -> Self {
        Self(self.0 + 1)
    }
}
