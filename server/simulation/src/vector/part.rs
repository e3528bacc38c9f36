//! What happens in some of the games within a step. `slot` adds to it, `blocks` puts parts together.

use chefshat_agents::Network;
use chefshat_engine::{Mask, Seat};

use super::columns::{Batch, Totals};
use super::setup::VectorSetup;

/// Multiplications of a network that take about as long as a decision of another agent.
const MULTIPLICATIONS: u64 = 1024;

/// What a decision of a network takes from the budget, besides 1.
pub(super) fn cost_of(network: &Network) -> u64 {
    network.multiplications() / MULTIPLICATIONS
}

/// An open decision of the client.
#[derive(Debug)]
pub(super) struct OpenRow {
    pub(super) game: u32,
    pub(super) seat: Seat,
    pub(super) legal: Mask,
}

/// What happened in some games within a step.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) batch: Batch,
    /// Counts of this step.
    pub(super) totals: Totals,
    /// Decisions and attempts that built-in agents may still make. Those of networks take more of it
    /// ([`cost_of`]).
    pub(super) budget: u64,
    /// The rows of the batch.
    pub(super) open: Vec<OpenRow>,
}

impl Part {
    /// Of no game so far, with capacity for this number of rows.
    pub(super) fn new(setup: &VectorSetup, rows: usize) -> Part {
        Part {
            batch: Batch::new(setup, rows),
            totals: Totals::default(),
            budget: 0,
            open: Vec::with_capacity(rows),
        }
    }

    /// Takes over what happened in the games that follow.
    pub(super) fn append(&mut self, next: &mut Part) {
        self.batch.append(&mut next.batch);
        self.totals.add(&std::mem::take(&mut next.totals));
        self.open.append(&mut next.open);
    }
}
