//! Search from what one seat knows. A state has the cards of all seats; what its seat may not know is
//! dropped when a [`Position`] is created, and `chefshat_search` gets the rest.

use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use chefshat_agents::Network;
use chefshat_engine::{ActionId, Event, Game, Observation, RuleSet, Seat};
use chefshat_proto::v1;
use chefshat_record::convert::{
    FieldProblem, rules_from_proto, rules_to_proto, script_to_proto, situation_from_proto,
};
use chefshat_search::{
    Allocation, Belief, Chance, Estimate, Evaluation, Knowledge, KnowledgeError, Method, OwnTime,
    RolloutPolicy, Sampler, ShiftHistory, Worth, choose, likely_hands, outcomes, play_on,
};
use chefshat_simulation::vector::SavedGame;
use chefshat_vector::RequestError;
use numpy::PyArray1;
use prost::Message as _;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::games::{caught, decode, refused};
use crate::threads::pool;

/// Time between two looks whether the user interrupts the program.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(100);
/// Deals and states that are played between two such looks.
const CHUNK: u64 = 256;

/// The points and places of Shifts, one row after the other.
type Shifts<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u8>>);

/// What a seat knows at its decision, and all deals that are consistent with it.
#[pyclass(module = "chefshat_native", frozen)]
#[derive(Debug)]
pub(crate) struct Position {
    sampler: Sampler,
}

#[pymethods]
impl Position {
    /// The decision that a saved game waits for, from the knowledge of its seat alone.
    #[staticmethod]
    fn of_state(py: Python<'_>, state: &[u8], max_steps: u64) -> PyResult<Self> {
        Position::new(py, max_steps, || {
            let saved = SavedGame::from_bytes(state).map_err(RequestError::from)?;
            let seen = saved.seen().map_err(RequestError::from)?;
            Ok((seen.rules, seen.observation, seen.events))
        })
    }

    /// The decision that a serialized `Situation` describes.
    #[staticmethod]
    fn of_situation(py: Python<'_>, situation: &[u8], max_steps: u64) -> PyResult<Self> {
        let message = decode::<v1::Situation>("situation", situation)?;
        Position::new(py, max_steps, || {
            let rules = rules_from_proto(&message.rules.clone().unwrap_or_default())
                .map_err(|problem| RequestError::field("RULE_SET_REFUSED", &problem))?;
            let (observation, events) = situation_from_proto(&message, &rules)
                .map_err(|problem| RequestError::field("ANALYSIS_REFUSED", &problem))?;
            Ok((rules, observation, events))
        })
    }

    /// The seat that decides.
    #[getter]
    fn seat(&self) -> usize {
        self.seat_index().index()
    }

    /// The serialized `RuleSet`.
    #[getter]
    fn rules<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &rules_to_proto(self.rule_set()).encode_to_vec())
    }

    /// The number of possible deals.
    #[getter]
    fn deals(&self) -> f64 {
        self.sampler.ways()
    }

    /// The legal actions, ascending.
    #[getter]
    fn legal_actions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u16>> {
        let legal = self.sampler.legal_actions();
        PyArray1::from_iter(py, legal.iter().map(ActionId::index))
    }

    /// Draws deals: the cards that each seat then holds, one after the other.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        deals: u64,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let faces = self.rule_set().faces();
        let of_deal = |deal| {
            let game = self.sampler.game(&mut stream(seed, deal));
            let hands = game.hands().values().copied().collect::<Vec<_>>();
            hands.into_iter().flat_map(move |hand| hand.counts(faces))
        };
        let hands = in_chunks(py, deals, |part| {
            part.flat_map(of_deal).collect::<Vec<u8>>()
        })?;
        Ok(PyArray1::from_vec(py, hands))
    }

    /// Draws the same deals, from `first` on, as serialized `ListedStart`s: the start of the Shift,
    /// and the actions from there to the decision.
    #[pyo3(signature = (deals, seed, *, first = 0))]
    fn starts(&self, py: Python<'_>, deals: u64, seed: u64, first: u64) -> PyResult<Vec<Vec<u8>>> {
        let knowledge = self.sampler.knowledge();
        let start = |deal| {
            let world = self.sampler.world(&mut stream(seed, deal));
            let (script, actions) = knowledge
                .start(&world)
                .expect("a sampled deal leads to what the seat sees");
            v1::ListedStart {
                hands: Some(script_to_proto(&script, self.rule_set().faces())),
                actions: (actions.iter())
                    .flat_map(|action| action.index().to_le_bytes())
                    .collect(),
            }
            .encode_to_vec()
        };
        in_chunks(py, deals, |part| {
            part.map(|deal| start(first + deal)).collect()
        })
    }

    /// The cards that each seat holds on average over these deals, one seat after the other.
    fn expected_hands<'py>(
        &self,
        py: Python<'py>,
        deals: u64,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let interrupts = Interrupts::new();
        let progress = |done: u64| match interrupts.seen() {
            true => 1.0,
            false => done as f64 / deals as f64,
        };
        let hands = py.detach(|| caught(|| likely_hands(&self.sampler, bytes(seed), progress)))?;
        interrupts.result()?;
        Ok(PyArray1::from_vec(py, hands.concat()))
    }

    /// The natural logarithm of the likelihood of what the others did, for each of these deals.
    /// `policy`: what says how likely they decide, `trained` or the bytes of a network file.
    fn log_likelihoods<'py>(
        &self,
        py: Python<'py>,
        deals: u64,
        seed: u64,
        policy: Policy,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let rules = self.rule_set();
        let policy = rollout_policy(policy, rules).map_err(|error| refused(py, error))?;
        let belief = (policy.network()).and_then(|network| Belief::of(network, rules));
        let words = "only a network for these rules says how likely actions are: trained or a file";
        let belief = belief.ok_or_else(|| refused(py, field("agent", words)))?;
        let logs = in_chunks(py, deals, |part| {
            belief.log_likelihoods(&self.sampler, bytes(seed), part)
        })?;
        Ok(PyArray1::from_vec(py, logs))
    }

    /// Estimates what actions are worth. `policy`: the name of a built-in agent, or the bytes of a
    /// network file. `rollouts` and `time_ms`: 0 for no limit; one of them has to be set. The other
    /// agents' random choices and the deals follow from the seed.
    #[pyo3(signature = (actions, policy, *, rollouts, time_ms, halving, threads, seed))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        actions: Vec<u16>,
        policy: Policy,
        rollouts: u64,
        time_ms: u64,
        halving: bool,
        threads: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let pool = pool(threads);
        let time_used = OwnTime::of_search(pool.as_deref());
        let method = Method {
            policy: rollout_policy(policy, self.rule_set()).map_err(|error| refused(py, error))?,
            allocation: match halving {
                true => Allocation::Halving,
                false => Allocation::Uniform,
            },
            belief: None,
        };
        let actions = self.legal(actions).map_err(|error| refused(py, error))?;
        let interrupts = Interrupts::new();
        let progress = |done: u64| {
            let share = |spent: f64, all: u64| if all == 0 { 0.0 } else { spent / all as f64 };
            let elapsed = 1000.0 * time_used.used().as_secs_f64();
            match interrupts.seen() {
                true => 1.0,
                false => share(done as f64, rollouts).max(share(elapsed, time_ms)),
            }
        };
        let mut evaluation = Evaluation::new(&actions, method.allocation);
        if rollouts > 0 {
            evaluation = evaluation.at_most(rollouts);
        }
        let (sampler, pool, seed) = (&self.sampler, pool.as_deref(), bytes(seed));
        let mut step = || evaluation.step(sampler, &method, seed, pool, progress);
        py.detach(|| caught(|| while !step() {}))?;
        interrupts.result()?;
        estimates(py, evaluation.estimates())
    }

    /// Points and places of the seat for each action in each of `deals` deals from `first` on, which
    /// are those of `sample` and `evaluate` with this seed: a row by action for each deal.
    #[pyo3(signature = (actions, policy, *, first, deals, threads, seed))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn outcomes<'py>(
        &self,
        py: Python<'py>,
        actions: Vec<u16>,
        policy: Policy,
        first: u64,
        deals: u64,
        threads: usize,
        seed: u64,
    ) -> PyResult<Shifts<'py>> {
        let method = Method {
            policy: rollout_policy(policy, self.rule_set()).map_err(|error| refused(py, error))?,
            allocation: Allocation::Uniform,
            belief: None,
        };
        let actions = self.legal(actions).map_err(|error| refused(py, error))?;
        let pool = pool(threads);
        let worths = in_chunks(py, deals, |part| {
            let part = first + part.start..first + part.end;
            let (sampler, pool) = (&self.sampler, pool.as_deref());
            outcomes(sampler, &actions, &method, bytes(seed), part, pool).concat()
        })?;
        Ok(shifts(py, &worths))
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(pyo3::exceptions::PyTypeError::new_err(
            "a position cannot be pickled or copied: create it from its state or situation",
        ))
    }
}

/// The agents of rollouts.
#[derive(FromPyObject)]
pub(crate) enum Policy {
    Name(String),
    File(Vec<u8>),
}

impl Position {
    fn new(
        py: Python<'_>,
        max_steps: u64,
        read: impl FnOnce() -> Result<(RuleSet, Observation, Vec<Event>), RequestError> + Send,
    ) -> PyResult<Self> {
        let sampler = py.detach(|| {
            caught(|| {
                let (rules, observation, events) = read()?;
                let seat = observation.seat.unwrap_or(Seat::new(0));
                let history = ShiftHistory::of(seat, &events);
                Knowledge::new(rules, &observation, &history)
                    .and_then(|knowledge| Sampler::new(knowledge, max_steps))
                    .map_err(unknown)
            })
        })?;
        let sampler = sampler.map_err(|error| refused(py, error))?;
        Ok(Position { sampler })
    }

    fn rule_set(&self) -> &RuleSet {
        self.sampler.knowledge().rules()
    }

    fn seat_index(&self) -> Seat {
        self.sampler.knowledge().seat()
    }

    /// These actions, which have to be legal, and at least one.
    fn legal(&self, actions: Vec<u16>) -> Result<Vec<ActionId>, RequestError> {
        let actions: Vec<ActionId> = actions.into_iter().map(ActionId::new).collect();
        let legal = self.sampler.legal_actions();
        if actions.is_empty() || !actions.iter().all(|action| legal.contains(*action)) {
            let words = "give at least one action, and only legal ones";
            return Err(field("actions", words));
        }
        Ok(actions)
    }
}

/// Points and places of all seats in the Shift of each state, played on by agents of these policies,
/// one for each seat or one for all: a row by seat for each state. The random choices at the state
/// with number i follow from the seed and i.
#[pyfunction]
#[pyo3(signature = (states, policies, *, threads, seed))]
pub(crate) fn play_states<'py>(
    py: Python<'py>,
    states: Vec<Bound<'py, PyBytes>>,
    policies: Vec<Policy>,
    threads: usize,
    seed: u64,
) -> PyResult<Shifts<'py>> {
    let games = open_games(py, &states)?;
    let Some(rules) = games.first().map(|game| *game.rules()) else {
        return Ok(shifts(py, &[]));
    };
    let players = rules.players();
    let policies = (policies.into_iter())
        .map(|policy| rollout_policy(policy, &rules))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| refused(py, error))?;
    let policies = match &policies[..] {
        [all] => vec![all.clone(); players],
        each if each.len() == players => policies,
        other => {
            let words = format!(
                "{} agents for {players} seats: give one for each, or one for all",
                other.len()
            );
            return Err(refused(py, field("agent", words)));
        }
    };
    let pool = pool(threads);
    let worths = in_chunks(py, games.len() as u64, |part| {
        let played = |number: u64| {
            let game = games[number as usize].closing_copy();
            play_on(game, &policies, stream(seed, number).seed())
        };
        on_pool(pool.as_deref(), part, played)
            .iter()
            .flat_map(|worths| worths.values().copied())
            .collect()
    })?;
    Ok(shifts(py, &worths))
}

/// What an agent of this policy does at the decision of each state. Its random choices at the state
/// with number i follow from the seed and i.
#[pyfunction]
#[pyo3(signature = (states, policy, *, seed))]
pub(crate) fn choose_actions<'py>(
    py: Python<'py>,
    states: Vec<Bound<'py, PyBytes>>,
    policy: Policy,
    seed: u64,
) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let games = open_games(py, &states)?;
    let Some(rules) = games.first().map(|game| *game.rules()) else {
        return Ok(PyArray1::from_vec(py, Vec::new()));
    };
    let policy = rollout_policy(policy, &rules).map_err(|error| refused(py, error))?;
    let pool = pool(0);
    let actions = in_chunks(py, games.len() as u64, |part| {
        let chosen = |number: u64| {
            let game = &games[number as usize];
            choose(game, &policy, stream(seed, number).seed()).index()
        };
        on_pool(pool.as_deref(), part, chosen)
    })?;
    Ok(PyArray1::from_vec(py, actions))
}

/// The games of states, in all of which a decision is open, and which have the same size.
fn open_games(py: Python<'_>, states: &[Bound<'_, PyBytes>]) -> PyResult<Vec<Game>> {
    let size = |game: &Game| {
        let rules = game.rules();
        (rules.players(), rules.faces(), rules.hand_size())
    };
    let open_game = |number: usize, first: Option<&Game>| {
        let saved = SavedGame::from_bytes(states[number].as_bytes())?;
        let game = saved.game().filter(|game| game.decision().is_some());
        let words = format!("state {number}: its game is over");
        let game = game.ok_or_else(|| field("states", words))?;
        if first.is_some_and(|first| size(first) != size(game)) {
            let words =
                "give states of games with the same numbers of players, faces and cards dealt";
            return Err(field("states", words));
        }
        Ok(game.clone())
    };
    let mut games: Vec<Game> = Vec::with_capacity(states.len());
    for number in 0..states.len() {
        if number % CHUNK as usize == 0 {
            py.check_signals()?;
        }
        let game = open_game(number, games.first()).map_err(|error| refused(py, error))?;
        games.push(game);
    }
    Ok(games)
}

/// Works on `all` deals or states, a chunk at a time, until the user interrupts the program.
fn in_chunks<T: Send>(
    py: Python<'_>,
    all: u64,
    work: impl Fn(Range<u64>) -> Vec<T> + Sync,
) -> PyResult<Vec<T>> {
    let mut done = Vec::new();
    for first in (0..all).step_by(CHUNK as usize) {
        let part = first..all.min(first + CHUNK);
        done.extend(py.detach(|| caught(|| work(part)))?);
        py.check_signals()?;
    }
    Ok(done)
}

/// What `of` returns for each number, in order.
fn on_pool<T: Send>(
    pool: Option<&ThreadPool>,
    part: Range<u64>,
    of: impl Fn(u64) -> T + Sync + Send,
) -> Vec<T> {
    match pool {
        Some(pool) => pool.install(|| part.into_par_iter().map(of).collect()),
        None => part.map(of).collect(),
    }
}

fn shifts<'py>(py: Python<'py>, worths: &[Worth]) -> Shifts<'py> {
    let points = PyArray1::from_iter(py, worths.iter().map(|worth| worth.points));
    (
        points,
        PyArray1::from_iter(py, worths.iter().map(|worth| worth.place)),
    )
}

fn rollout_policy(policy: Policy, rules: &RuleSet) -> Result<RolloutPolicy, RequestError> {
    match policy {
        Policy::Name(name) => RolloutPolicy::from_name(&name).ok_or_else(|| {
            let words = format!(
                "there is no agent {name:?}: choose random, greedy or trained, or the path of a network file"
            );
            field("agent", words)
        }),
        Policy::File(bytes) => {
            let network = Network::from_bytes(&bytes);
            let network = network.map_err(|error| field("agent", error.to_string()))?;
            if !network.fits(rules) {
                let words = "the network was trained for other rules";
                return Err(field("agent", words));
            }
            Ok(RolloutPolicy::Network(Arc::new(network)))
        }
    }
}

/// Interrupts of the program, which Python notices only if it is asked.
struct Interrupts {
    looked: Mutex<(Instant, PyResult<()>)>,
}

impl Interrupts {
    fn new() -> Self {
        Interrupts {
            looked: Mutex::new((Instant::now(), Ok(()))),
        }
    }

    /// Whether there was one.
    fn seen(&self) -> bool {
        let Ok(mut looked) = self.looked.lock() else {
            return true;
        };
        if looked.1.is_ok() && looked.0.elapsed() > SIGNAL_INTERVAL {
            *looked = (Instant::now(), Python::attach(|py| py.check_signals()));
        }
        looked.1.is_err()
    }

    fn result(self) -> PyResult<()> {
        self.looked.into_inner().map_or(Ok(()), |looked| looked.1)
    }
}

/// A number of an estimate.
type Number = fn(&Estimate) -> f64;

/// The columns of estimates by name.
fn estimates<'py>(py: Python<'py>, found: &[Estimate]) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let actions = found.iter().map(|estimate| estimate.action.index());
    columns.set_item("actions", PyArray1::from_iter(py, actions))?;
    let rollouts = found.iter().map(|estimate| estimate.rollouts);
    columns.set_item("rollouts", PyArray1::from_iter(py, rollouts))?;
    let numbers: [(&str, Number); 5] = [
        ("points", Estimate::points),
        ("standard_errors", Estimate::standard_error),
        ("gains", Estimate::gain),
        ("gain_errors", Estimate::gain_error),
        ("places", Estimate::place),
    ];
    for (name, number) in numbers {
        columns.set_item(name, PyArray1::from_iter(py, found.iter().map(number)))?;
    }
    Ok(columns)
}

fn unknown(error: KnowledgeError) -> RequestError {
    field("position", error.to_string())
}

fn field(name: &'static str, words: impl Into<String>) -> RequestError {
    RequestError::field("ANALYSIS_REFUSED", &FieldProblem::new(name, words))
}

/// The random numbers of a deal.
fn stream(seed: u64, deal: u64) -> Chance {
    Chance::stream(bytes(seed), deal)
}

fn bytes(seed: u64) -> [u8; 32] {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    bytes
}
