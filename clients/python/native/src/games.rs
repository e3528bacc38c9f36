//! Games that a program steps in its own process.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, TryLockError};

use chefshat_agents::{AgentKind, Network};
use chefshat_engine::{ActionId, ActionSpace};
use chefshat_proto::v1;
use chefshat_record::convert::FieldProblem;
use chefshat_simulation::vector::{
    Batch as Columns, LEAVE_OPEN, Opponent, VectorGames, VectorSetup,
};
use chefshat_vector::{
    Limits, Request, RequestError, record_lines, saved_to_proto, seeds_from_setup,
    setup_from_proto, start_from_proto, started_to_proto,
};
use numpy::{PyArray1, PyArrayMethods as _};
use prost::Message;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rand::TryRng as _;

use crate::tables::{Batch, Record, layouts};
use crate::threads::pool;

/// Most games whose step is fast.
const MAX_FAST_GAMES: u32 = 8;
/// Free memory in bytes where the system does not say.
const ASSUMED_FREE_MEMORY: u64 = 8 << 30;

create_exception!(
    chefshat_native,
    Refused,
    PyException,
    "A refused request: its reason in UPPER_SNAKE, the reason in words, and metadata."
);

/// Many games of one client, stepped together. See `VectorService` for what the messages mean.
#[pyclass(module = "chefshat_native", frozen)]
#[derive(Debug)]
pub(crate) struct Games {
    /// `None` once a step has failed for good.
    state: Mutex<Option<VectorGames>>,
    started: Vec<u8>,
    /// Whether a step takes less time than others would wait for the interpreter.
    is_fast: bool,
    threads: usize,
}

#[pymethods]
impl Games {
    /// Begins the games of a serialized `VectorSetup`; returns them with their first batch.
    /// `threads`: 0 for as many as there are cores.
    #[staticmethod]
    #[pyo3(signature = (setup, threads = 0))]
    fn begin(py: Python<'_>, setup: &[u8], threads: usize) -> PyResult<(Self, Batch)> {
        let message = decode::<v1::VectorSetup>("setup", setup)?;
        let pool = pool(threads);
        let limits = Limits::in_process(free_memory());
        let begun = py.detach(|| {
            caught(|| {
                let seeds = seeds_from_setup(&message, &limits, random_seed)?;
                let (rules, start) = start_from_proto(&message)?.ok_or_else(no_records_here)?;
                let setup = setup_from_proto(&message, rules, start, seeds, &limits)?;
                let started = started_to_proto(&setup).encode_to_vec();
                let (games, mut columns) = VectorGames::on(setup, pool);
                let records = records(&games, &mut columns);
                Ok((games, started, columns, records))
            })
        });
        let (games, started, columns, records) = begun?.map_err(|error| refused(py, error))?;
        let batch = Batch::new(columns, records, games.setup());
        let handle = Self {
            is_fast: games.setup().games() <= MAX_FAST_GAMES && only_fast_agents(games.setup()),
            state: Mutex::new(Some(games)),
            started,
            threads,
        };
        Ok((handle, batch))
    }

    /// The serialized `VectorStarted`.
    #[getter]
    fn started<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.started)
    }

    /// For each table the bytes of a row before each column.
    #[getter]
    fn layouts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let state = self.lock()?;
        layouts(py, state.as_ref().ok_or_else(|| ended(py))?.setup())
    }

    /// Takes one action for each row of the latest batch and returns the next batch. Raises
    /// `TypeError` for anything but an array of uint16 or int64, and `ValueError` if there is not
    /// one action for each row, or a number is not an action; then the games are unchanged. If
    /// `partial`, 65535 leaves a decision open.
    #[pyo3(signature = (actions, partial = false))]
    fn step(&self, py: Python<'_>, actions: &Bound<'_, PyAny>, partial: bool) -> PyResult<Batch> {
        let actions = if let Ok(actions) = actions.cast::<PyArray1<u16>>() {
            let actions = actions.try_readonly()?;
            actions
                .as_array()
                .iter()
                .copied()
                .map(ActionId::new)
                .collect()
        } else if let Ok(actions) = actions.cast::<PyArray1<i64>>() {
            let actions = actions.try_readonly()?;
            let actions = actions.as_array();
            let action = |number: &i64| u16::try_from(*number).map(ActionId::new);
            actions.iter().map(action).collect::<Result<_, _>>()?
        } else {
            return Err(PyTypeError::new_err(
                "actions are an array of uint16 or int64",
            ));
        };
        self.execute(py, Request::Actions(actions), partial)
    }

    /// Executes a serialized `VectorReset` and returns the next batch.
    fn reset(&self, py: Python<'_>, reset: &[u8]) -> PyResult<Batch> {
        let message = decode::<v1::VectorReset>("reset", reset)?;
        let limits = Limits::in_process(u64::MAX);
        let request = Request::reset(&message, &limits).map_err(|error| refused(py, error))?;
        self.execute(py, request, false)
    }

    /// Executes a serialized `VectorRestore` and returns the next batch.
    fn restore(&self, py: Python<'_>, restore: &[u8]) -> PyResult<Batch> {
        let message = decode::<v1::VectorRestore>("restore", restore)?;
        self.execute(py, Request::Restore(message), false)
    }

    /// Executes a serialized `VectorSave` and returns serialized `VectorStates`.
    fn save<'py>(&self, py: Python<'py>, save: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let message = decode::<v1::VectorSave>("save", save)?;
        let state = self.lock()?;
        let games = state.as_ref().ok_or_else(|| ended(py))?;
        let encode = || saved_to_proto(&message, games).map(|states| states.encode_to_vec());
        let states = py.detach(|| caught(encode))?;
        let states = states.map_err(|error| refused(py, error))?;
        Ok(PyBytes::new(py, &states))
    }

    /// Draws a legal action for each row of the latest batch: row i takes the draw `first + i` of
    /// the seed.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        seed: u64,
        first: u64,
    ) -> PyResult<Bound<'py, PyArray1<u16>>> {
        let state = self.lock()?;
        let games = state.as_ref().ok_or_else(|| ended(py))?;
        let mut actions = Vec::with_capacity(games.rows());
        games.sample(seed, first, |action| actions.push(action.index()));
        Ok(PyArray1::from_vec(py, actions))
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "running games cannot be pickled or copied: save their states",
        ))
    }
}

impl Games {
    /// Executes a request. Long ones do not hold the interpreter.
    fn execute(&self, py: Python<'_>, request: Request, partial: bool) -> PyResult<Batch> {
        let mut state = self.lock()?;
        let games = state.as_mut().ok_or_else(|| ended(py))?;
        if let Request::Actions(actions) = &request {
            let size = games.setup().rules().actions().size();
            let known =
                |action: &ActionId| action.index() < size || (partial && *action == LEAVE_OPEN);
            let known = actions.iter().all(known);
            if actions.len() != games.rows() || !known {
                return Err(PyValueError::new_err("give one action for each row"));
            }
        }
        if !self.is_fast {
            // That of this process, which may have been forked.
            games.set_pool(pool(self.threads));
        }
        let work = || {
            caught(|| {
                let mut columns = request.execute(games)?;
                let records = records(games, &mut columns);
                Ok::<_, RequestError>(Batch::new(columns, records, games.setup()))
            })
        };
        let done = match self.is_fast {
            true => work(),
            false => py.detach(work),
        };
        match done {
            Ok(Ok(batch)) => Ok(batch),
            // As over the network, a refused request ends the games, and so does a panic. An illegal
            // action has changed nothing; to a server it is not sent.
            Ok(Err(error)) => {
                if error.reason != "ILLEGAL_ACTION" {
                    *state = None;
                }
                Err(refused(py, error))
            }
            Err(panic) => {
                *state = None;
                Err(panic)
            }
        }
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Option<VectorGames>>> {
        self.state.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => PyErr::new::<Refused, _>((
                "GAMES_IN_USE",
                "another thread is stepping these games, or was when this process was forked: use one env for each thread and process",
                Vec::<(String, String)>::new(),
            )),
            TryLockError::Poisoned(_) => panicked(),
        })
    }
}

/// The texts of all actions of a deck with this number of faces, 4..=15.
#[pyfunction]
pub(crate) fn action_texts(faces: u8) -> PyResult<Vec<String>> {
    let space = ActionSpace::new(faces)
        .ok_or_else(|| PyValueError::new_err(format!("{faces} is not in 4..=15")))?;
    let texts = (0..space.size()).filter_map(|index| space.text(ActionId::new(index)));
    Ok(texts.collect())
}

/// The file of the network of the built-in agent `trained`.
#[pyfunction]
pub(crate) fn trained_network(py: Python<'_>) -> Bound<'_, PyBytes> {
    PyBytes::new(py, Network::TRAINED_FILE)
}

/// Whether all built-in agents decide in less than a microsecond.
fn only_fast_agents(setup: &VectorSetup) -> bool {
    let fast = [AgentKind::Random, AgentKind::Greedy].map(Opponent::BuiltIn);
    setup.built_in().all(|agent| fast.contains(&agent))
}

/// The records of games that ended, taken from their columns.
fn records(games: &VectorGames, columns: &mut Columns) -> Vec<Record> {
    let played = std::mem::take(&mut columns.played);
    let record = |played| Record {
        lines: record_lines(games.setup(), played)
            .iter()
            .map(Message::encode_to_vec)
            .collect(),
        game: played.game,
        index: played.index,
    };
    played.iter().map(record).collect()
}

pub(crate) fn decode<M: Message + Default>(name: &str, bytes: &[u8]) -> PyResult<M> {
    M::decode(bytes).map_err(|error| {
        let words = format!("the {name} is not a message: {error}");
        PyValueError::new_err(words)
    })
}

/// Runs work; a panic becomes an error, so that it does not end the interpreter.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> PyResult<T> {
    // The state of the work is dropped, so it is never seen half done.
    catch_unwind(AssertUnwindSafe(work)).map_err(|_| panicked())
}

fn panicked() -> PyErr {
    let words =
        "an internal error, which is a bug of chefshat-native; the standard error has the details";
    PyErr::new::<Refused, _>(("INTERNAL", words, Vec::<(String, String)>::new()))
}

fn ended(py: Python<'_>) -> PyErr {
    let message = "these games have ended with an earlier error; begin others".to_owned();
    let (reason, metadata) = ("GAMES_ENDED", Vec::new());
    refused(
        py,
        RequestError {
            reason,
            message,
            metadata,
        },
    )
}

fn no_records_here() -> RequestError {
    let words =
        "recorded games are stored by a server: give the address of the one that has the game";
    RequestError::field("BRANCH_REFUSED", &FieldProblem::new("branch", words))
}

pub(crate) fn refused(py: Python<'_>, error: RequestError) -> PyErr {
    let metadata = PyDict::new(py);
    for (key, value) in error.metadata {
        if let Err(error) = metadata.set_item(key, value) {
            return error;
        }
    }
    PyErr::new::<Refused, _>((error.reason, error.message, metadata.unbind()))
}

/// Bytes of memory that are free on this machine, and in the control group (version 2) of this
/// process, which can take pages of files back.
fn free_memory() -> u64 {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let line = |text: &str, name: &str| {
        let found = text.lines().find_map(|line| line.strip_prefix(name))?;
        number(found.trim().trim_end_matches(" kB"))
    };
    let machine = read("/proc/meminfo").and_then(|text| line(&text, "MemAvailable:"));
    let group = || {
        let most = number(&read("/sys/fs/cgroup/memory.max")?)?;
        let used = number(&read("/sys/fs/cgroup/memory.current")?)?;
        let of_files = line(&read("/sys/fs/cgroup/memory.stat")?, "inactive_file ")?;
        Some(most.saturating_sub(used.saturating_sub(of_files)))
    };
    let machine = machine.map(|kibibytes| kibibytes.saturating_mul(1024));
    machine
        .into_iter()
        .chain(group())
        .min()
        .unwrap_or(ASSUMED_FREE_MEMORY)
}

fn random_seed() -> u64 {
    let mut bytes = [0; 8];
    rand::rngs::SysRng
        .try_fill_bytes(&mut bytes)
        .expect("the operating system provides random bytes");
    u64::from_le_bytes(bytes)
}
