//! Batches as numpy arrays. A table is one array of bytes with its columns one after the other,
//! numbers of eight and four bytes first so that all are aligned. Python creates a column as a view
//! of it when it is first used.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use chefshat_simulation::vector::{Batch as Columns, ObservationColumns, VectorSetup};
use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The record of a game that ended.
#[derive(Debug)]
pub(crate) struct Record {
    pub(crate) game: u32,
    pub(crate) index: u64,
    /// Serialized `RecordLine`s.
    pub(crate) lines: Vec<Vec<u8>>,
}

/// The open decisions, and what happened since the previous batch.
#[pyclass(module = "chefshat_native", frozen)]
#[derive(Debug)]
pub(crate) struct Batch {
    /// Number of the batch, from 1.
    #[pyo3(get)]
    step: u64,
    /// Number of open decisions.
    #[pyo3(get)]
    rows: u32,
    /// Whether all games are over and none follows.
    #[pyo3(get)]
    done: bool,
    statistics: bool,
    columns: Mutex<Columns>,
    records: Vec<Record>,
}

/// A table: the number of its rows, its columns one after the other, and where each begins.
type Table<'py> = (u32, Bound<'py, PyArray1<u8>>, BTreeMap<&'static str, usize>);

#[pymethods]
impl Batch {
    /// Hands over the open decisions. Every table is handed over once.
    fn decisions<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let mut all = self.columns();
        let seen = std::mem::take(&mut all.observations);
        let mut columns = vec![
            ("games", std::mem::take(&mut all.games)),
            ("attempts", std::mem::take(&mut all.attempts)),
            ("rewards", std::mem::take(&mut all.rewards)),
        ];
        let small = vec![
            ("seats", std::mem::take(&mut all.seats)),
            ("kinds", std::mem::take(&mut all.kinds)),
            ("mask_bits", std::mem::take(&mut all.masks)),
        ];
        observed(&mut columns, small, seen);
        table(py, all.rows, columns)
    }

    /// Hands over the episodes that have ended.
    fn endings<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let ended = std::mem::take(&mut self.columns().endings);
        let mut columns = vec![
            ("indices", ended.indices),
            ("games", ended.games),
            ("rewards", ended.rewards),
        ];
        let small = vec![
            ("seats", ended.seats),
            ("ends", ended.ends),
            ("game_over", ended.game_over),
            ("places_taken", ended.places_taken),
        ];
        observed(&mut columns, small, ended.observations);
        table(py, ended.rows, columns)
    }

    /// Hands over the games that have begun.
    fn beginnings<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let begun = std::mem::take(&mut self.columns().beginnings);
        let columns = vec![
            ("indices", begun.indices),
            ("games", begun.games),
            ("seeds", begun.seeds),
        ];
        table(py, begun.rows, columns)
    }

    /// Hands over the Shifts that have ended, if statistics are enabled.
    fn shifts<'py>(&self, py: Python<'py>) -> PyResult<Option<Table<'py>>> {
        if !self.statistics {
            return Ok(None);
        }
        let shifts = std::mem::take(&mut self.columns().shifts);
        let columns = vec![
            ("indices", shifts.indices),
            ("games", shifts.games),
            ("shifts", shifts.shifts),
            ("pizzas", shifts.pizzas),
            ("laps", shifts.laps),
            ("turns", shifts.turns),
            ("points", shifts.points),
            ("valid", shifts.valid),
            ("wrong", shifts.wrong),
            ("passes", shifts.passes),
            ("reward_sums", shifts.reward_sums),
            ("performance", shifts.performance),
            ("starters", shifts.starters),
            ("special_actions", shifts.special_actions),
            ("adjudicated", shifts.adjudicated),
            ("game_winners", shifts.game_winners),
            ("places", shifts.places),
        ];
        table(py, shifts.rows, columns).map(Some)
    }

    /// Decisions of the client and of all seats, invalid attempts of the client, Shifts and games,
    /// since the beginning.
    fn totals(&self) -> (u64, u64, u64, u64, u64) {
        let totals = self.columns().totals;
        (
            totals.client_decisions,
            totals.decisions,
            totals.invalid_attempts,
            totals.shifts,
            totals.games,
        )
    }

    /// The records of games that have ended: game, index and serialized `RecordLine`s of each.
    fn records<'py>(&self, py: Python<'py>) -> Vec<(u32, u64, Vec<Bound<'py, PyBytes>>)> {
        let lines = |record: &Record| {
            let lines = record.lines.iter();
            lines.map(|line| PyBytes::new(py, line)).collect()
        };
        let records = self.records.iter();
        records
            .map(|record| (record.game, record.index, lines(record)))
            .collect()
    }
}

impl Batch {
    pub(crate) fn new(columns: Columns, records: Vec<Record>, setup: &VectorSetup) -> Self {
        Self {
            step: columns.step,
            rows: columns.rows,
            done: columns.done,
            statistics: setup.statistics(),
            columns: Mutex::new(columns),
            records,
        }
    }

    fn columns(&self) -> MutexGuard<'_, Columns> {
        self.columns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Adds the columns of observations, and after them the caller's of one byte.
fn observed(
    columns: &mut Vec<(&'static str, Vec<u8>)>,
    small: Vec<(&'static str, Vec<u8>)>,
    seen: ObservationColumns,
) {
    columns.extend([
        ("shifts", seen.shifts),
        ("pizzas", seen.pizzas),
        ("points", seen.points),
        ("history_counts", seen.history_counts),
        ("history", seen.history),
    ]);
    columns.extend(small);
    columns.extend([
        ("hands", seen.hands),
        ("golden", seen.golden),
        ("boards", seen.boards),
        ("cards_left", seen.cards_left),
        ("passed", seen.passed),
        ("places", seen.places),
        ("roles", seen.roles),
        ("played", seen.played),
        ("gave", seen.gave),
        ("received", seen.received),
    ]);
}

fn table<'py>(
    py: Python<'py>,
    rows: u32,
    columns: Vec<(&'static str, Vec<u8>)>,
) -> PyResult<Table<'py>> {
    let size = columns.iter().map(|(_, column)| column.len()).sum();
    let mut bytes = Vec::with_capacity(size);
    let mut offsets = BTreeMap::new();
    for (name, column) in columns {
        offsets.insert(name, bytes.len());
        bytes.extend(column);
    }
    let bytes = PyArray1::from_vec(py, bytes);
    // Columns are views of it, and as read-only as those of a message.
    bytes.try_readwrite()?.make_nonwriteable();
    Ok((rows, bytes, offsets))
}
