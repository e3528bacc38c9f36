//! Tests of the core of a room under a simulated clock.

mod absences;
mod clocks;
mod gateways;
mod markers;
mod physical;
mod revival;
mod searches;
mod seats;
mod silent;
mod strange;

use std::time::Duration;

use chefshat_engine::Seat;

use super::{Answer, ConnectionId, Core, State, Verdict};
use crate::journal::{Change, Fill, ParticipantKind, Source};
use crate::log::RoomEvent;
use crate::policy::Policy;
use crate::testing::{OPEN, Table, ms, one_shift, participant};
