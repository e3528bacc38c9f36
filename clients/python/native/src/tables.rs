//! Batches as numpy arrays. A table is one array of bytes with its columns one after the other,
//! numbers of eight and four bytes first so that all are aligned. Python creates a column as a view
//! of it when it is first used.

use std::sync::{Mutex, MutexGuard, PoisonError};

use chefshat_agents::table_features;
use chefshat_engine::RuleSet;
use chefshat_simulation::vector::{Batch as Columns, ObservationColumns, VectorSetup, kind_number};
use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// Columns by name, in the order in which they are packed.
type Named<T> = Vec<(&'static str, T)>;

/// The number of a table's rows, and its columns one after the other.
type Table<'py> = (u32, Bound<'py, PyArray1<u8>>);

/// What an environment of one game shows of a row: the observation, the mask as numbers, the reward,
/// the seat, the kind of the decision and the invalid attempts.
type Situation<'py> = (
    Option<Bound<'py, PyArray1<f32>>>,
    Bound<'py, PyArray1<i8>>,
    f32,
    usize,
    u8,
    u32,
);

/// The record of a game that ended.
#[derive(Debug)]
pub(crate) struct Record {
    pub(crate) game: u32,
    pub(crate) index: u64,
    /// Serialized `RecordLine`s.
    pub(crate) lines: Vec<Vec<u8>>,
}

/// For each table the bytes of a row before each column: a column begins at as many for each row.
pub(crate) fn layouts<'py>(py: Python<'py>, setup: &VectorSetup) -> PyResult<Bound<'py, PyDict>> {
    let rules = setup.rules();
    let (cards, seats) = (usize::from(rules.faces()) + 1, rules.players());
    let mask = usize::from(rules.actions().size()).div_ceil(8);
    let widths = |name| match name {
        "indices" => 8,
        "games" | "attempts" | "rewards" | "shifts" | "pizzas" | "laps" | "turns" => 4,
        "points" | "valid" | "wrong" | "passes" | "reward_sums" | "performance" => 4 * seats,
        "cards_left" | "passed" | "places" | "roles" => seats,
        "hands" | "played" | "gave" | "received" => cards,
        "mask_bits" => mask,
        "boards" => 3,
        "all_hands" => setup.all_hands_width(),
        "history" => 2 * usize::from(setup.history()),
        "history_counts" => 4 * usize::from(setup.history().min(1)),
        "seeds" => 32,
        _ => 1,
    };
    let mut empty = Columns::default();
    let tables = [
        ("decisions", decisions(&mut empty)),
        ("endings", endings(&mut empty)),
        ("beginnings", beginnings(&mut empty)),
        ("shifts", shifts(&mut empty)),
    ];
    let layouts = PyDict::new(py);
    for (table, columns) in tables {
        let layout = PyDict::new(py);
        let mut before = 0;
        for (name, _) in columns {
            layout.set_item(name, before)?;
            before += widths(name);
        }
        layouts.set_item(table, layout)?;
    }
    Ok(layouts)
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
    /// Number of episodes that have ended.
    #[pyo3(get)]
    ended: u32,
    statistics: bool,
    rules: RuleSet,
    columns: Mutex<Columns>,
    records: Vec<Record>,
}

#[pymethods]
impl Batch {
    /// Hands over the open decisions. Every table is handed over once.
    fn decisions<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        packed(py, self.rows, decisions(&mut self.columns()))
    }

    /// The first open decision, or the end of the first episode if `ended`; `None` without rows, and
    /// once its table has been handed over. `form`: "table" or "classic" for that observation.
    #[pyo3(signature = (form, ended))]
    fn first<'py>(
        &self,
        py: Python<'py>,
        form: Option<&str>,
        ended: bool,
    ) -> PyResult<Option<Situation<'py>>> {
        let columns = self.columns();
        let seen = match ended {
            false => columns.situation(0, &self.rules),
            true => columns.endings.situation(0, &self.rules),
        };
        let Some(seen) = seen else {
            return Ok(None);
        };
        let observation = match form {
            None => None,
            Some("table") => Some(table_features(&seen.observation, &seen.legal)),
            Some("classic") => Some(seen.observation.classic_vector(&seen.legal)),
            Some(_) => return Err(PyValueError::new_err("a form is table or classic")),
        };
        let mut mask = vec![0; usize::from(self.rules.actions().size())];
        for action in seen.legal.iter() {
            mask[usize::from(action.index())] = 1;
        }
        Ok(Some((
            observation.map(|values| PyArray1::from_vec(py, values)),
            PyArray1::from_vec(py, mask),
            seen.reward,
            seen.observation.seat.unwrap_or_default().index(),
            seen.observation.kind.map_or(0, kind_number),
            seen.attempts,
        )))
    }

    /// Hands over the episodes that have ended.
    fn endings<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let mut columns = self.columns();
        packed(py, columns.endings.rows, endings(&mut columns))
    }

    /// Hands over the games that have begun.
    fn beginnings<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let mut columns = self.columns();
        packed(py, columns.beginnings.rows, beginnings(&mut columns))
    }

    /// Hands over the Shifts that have ended, if statistics are enabled.
    fn shifts<'py>(&self, py: Python<'py>) -> PyResult<Option<Table<'py>>> {
        let mut columns = self.columns();
        let table = |columns: &mut Columns| packed(py, columns.shifts.rows, shifts(columns));
        self.statistics.then(|| table(&mut columns)).transpose()
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
            ended: columns.endings.rows,
            rules: *setup.rules(),
            statistics: setup.statistics(),
            columns: Mutex::new(columns),
            records,
        }
    }

    fn columns(&self) -> MutexGuard<'_, Columns> {
        self.columns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Takes the open decisions.
fn decisions(batch: &mut Columns) -> Named<Vec<u8>> {
    let seen = std::mem::take(&mut batch.observations);
    let wide = vec![
        ("games", std::mem::take(&mut batch.games)),
        ("attempts", std::mem::take(&mut batch.attempts)),
        ("rewards", std::mem::take(&mut batch.rewards)),
    ];
    let narrow = vec![
        ("seats", std::mem::take(&mut batch.seats)),
        ("kinds", std::mem::take(&mut batch.kinds)),
        ("mask_bits", std::mem::take(&mut batch.masks)),
        ("all_hands", std::mem::take(&mut batch.all_hands)),
    ];
    observed(wide, narrow, seen)
}

/// Takes the episodes that have ended.
fn endings(batch: &mut Columns) -> Named<Vec<u8>> {
    let ended = std::mem::take(&mut batch.endings);
    let wide = vec![
        ("indices", ended.indices),
        ("games", ended.games),
        ("rewards", ended.rewards),
    ];
    let narrow = vec![
        ("seats", ended.seats),
        ("ends", ended.ends),
        ("game_over", ended.game_over),
        ("places_taken", ended.places_taken),
    ];
    observed(wide, narrow, ended.observations)
}

/// Takes the games that have begun.
fn beginnings(batch: &mut Columns) -> Named<Vec<u8>> {
    let begun = std::mem::take(&mut batch.beginnings);
    vec![
        ("indices", begun.indices),
        ("games", begun.games),
        ("seeds", begun.seeds),
    ]
}

/// Takes the Shifts that have ended.
fn shifts(batch: &mut Columns) -> Named<Vec<u8>> {
    let shifts = std::mem::take(&mut batch.shifts);
    vec![
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
    ]
}

/// Columns of situations: of four and more bytes, and of one byte, among them those observed.
fn observed(
    mut wide: Named<Vec<u8>>,
    narrow: Named<Vec<u8>>,
    seen: ObservationColumns,
) -> Named<Vec<u8>> {
    wide.extend([
        ("shifts", seen.shifts),
        ("pizzas", seen.pizzas),
        ("points", seen.points),
        ("history_counts", seen.history_counts),
        ("history", seen.history),
    ]);
    wide.extend(narrow);
    wide.extend([
        ("hands", seen.hands),
        ("golden", seen.golden),
        ("boards", seen.boards),
        ("board_owners", seen.board_owners),
        ("cards_left", seen.cards_left),
        ("passed", seen.passed),
        ("places", seen.places),
        ("roles", seen.roles),
        ("played", seen.played),
        ("gave", seen.gave),
        ("received", seen.received),
    ]);
    wide
}

fn packed<'py>(py: Python<'py>, rows: u32, columns: Named<Vec<u8>>) -> PyResult<Table<'py>> {
    let size = columns.iter().map(|(_, column)| column.len()).sum();
    let mut bytes = Vec::with_capacity(size);
    for (_, column) in columns {
        bytes.extend(column);
    }
    let bytes = PyArray1::from_vec(py, bytes);
    // Columns are views of it, and as read-only as those of a message.
    bytes.try_readwrite()?.make_nonwriteable();
    Ok((rows, bytes))
}
