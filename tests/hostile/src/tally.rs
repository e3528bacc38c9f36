//! What an attack did and what it met.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// Counts of an attack.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    tried: AtomicU64,
    granted: AtomicU64,
    refused: AtomicU64,
    lost: AtomicU64,
    reasons: Mutex<BTreeMap<String, u64>>,
}

/// The counts at one moment.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub(crate) struct Counts {
    /// What the attack tried: calls, streams, connections or frames.
    pub(crate) tried: u64,
    /// What it was granted.
    pub(crate) granted: u64,
    /// What was refused with a status.
    pub(crate) refused: u64,
    /// What ended with the connection, without a status.
    pub(crate) lost: u64,
    /// Reasons of refusals, with their counts.
    pub(crate) reasons: BTreeMap<String, u64>,
}

impl Tally {
    /// Counts attempts.
    pub(crate) fn tried(&self, count: u64) {
        self.tried.fetch_add(count, Relaxed);
    }

    /// Counts what was granted.
    pub(crate) fn granted(&self, count: u64) {
        self.granted.fetch_add(count, Relaxed);
    }

    /// Counts what the connection took with it.
    pub(crate) fn lost(&self) {
        self.lost.fetch_add(1, Relaxed);
    }

    /// Counts the outcome of a call.
    pub(crate) fn outcome<T>(&self, outcome: &Result<T, Status>) {
        match outcome {
            Ok(_) => self.granted(1),
            // Statuses that tonic makes of a broken connection have no reason.
            Err(status) if is_from_server(status) => self.refusal(&reason(status)),
            Err(_) => self.lost(),
        }
    }

    /// Counts a refusal.
    pub(crate) fn refusal(&self, reason: &str) {
        self.refused.fetch_add(1, Relaxed);
        let mut reasons = self.reasons.lock().expect("nothing panics under this lock");
        *reasons.entry(reason.to_owned()).or_default() += 1;
    }

    /// The counts now.
    pub(crate) fn counts(&self) -> Counts {
        Counts {
            tried: self.tried.load(Relaxed),
            granted: self.granted.load(Relaxed),
            refused: self.refused.load(Relaxed),
            lost: self.lost.load(Relaxed),
            reasons: (self.reasons.lock().expect("nothing panics under this lock")).clone(),
        }
    }
}

fn is_from_server(status: &Status) -> bool {
    status.get_details_error_info().is_some() || status.code() == Code::ResourceExhausted
}

fn reason(status: &Status) -> String {
    (status.get_details_error_info()).map_or_else(|| status.code().to_string(), |info| info.reason)
}
