"""The Deep Q agent of the 2020 paper, as pure functions over a stack of independent agents that are trained in lock-step.

Here are its hyper-parameters, the state of the agents, and the functions `start`, `act` and `learn`. Every array of the state has
a leading axis, one entry per agent. Agents share nothing: each learns the same as alone. Playing games
is in `deep_q_training`, files are in `checkpoint`.

Where the paper is silent, this is decided:

- An agent learns after every transition, illegal actions included, once its memory holds a batch: one batch of `batch_size`
  transitions, drawn uniformly with replacement, and one step of Adam.
- Epsilon is multiplied by `epsilon_decay` after each such update, so it reaches 0.1 after 460 of them, within the first Shifts.
  Decayed once a game it would still be 0.78 at the 50th game, from which on the paper reports that its agent always wins. The agent
  first published with the paper's figures also decays with every update.
- The target network is the online network as of the last update whose number is a multiple of `target_every`.
- The loss is the mean squared error of the chosen actions. Targets may lie outside of -1..=1, the range of the outputs, since
  rewards of 1 discounted by 0.95 add up to 20; they are not clipped.
- Actions are compared before the tanh, which preserves order but maps values far from 0 to the same 1 in single precision.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from chefshat.learn.mlp import Mlp, Params
from jax import Array
from jax.typing import ArrayLike


@dataclass(frozen=True)
class DeepQConfig:
    """The hyper-parameters; the defaults are those of the paper's table. Raises ValueError for a value out of range.

    Attributes:
        inputs: width of an observation, 1..=4096; the classic vector of the default deck has 228.
        outputs: actions, 2..=1024; a turn of the default deck has 200.
        hidden: units of each hidden layer (ReLU), 1 to 8 layers of 1..=4096. The output layer is tanh.
        batch_size: transitions in one update, 1..=4096.
        memory_size: capacity of the replay memory, `batch_size`..=1,000,000 transitions; the oldest is dropped first.
        discount: of the next decision's value, 0..=1.
        learning_rate: of Adam, above 0 and at most 1.
        epsilon_start: initial probability of exploring, 0..=1.
        epsilon_decay: factor of that probability after every update, 0..=1.
        epsilon_end: its lower bound, 0..=1.
        target_every: updates between two copies of the online network to the target network, 1..=1,000,000.
        double: whether the online network selects the next action that the target network evaluates (double Q-learning).
        mask: whether illegal actions are excluded: in exploring, in exploiting and in the value of the next decision.
        wrong_limit: illegal actions at one decision after which a random legal one is taken, 0..=1,000,000; 0: unlimited.
        see_mask: whether the agent sees the legal actions. If not, the last `outputs` inputs are 0, which leaves the board and the
            hand.
    """

    inputs: int = 228
    outputs: int = 200
    hidden: tuple[int, ...] = (128, 256)
    batch_size: int = 32
    memory_size: int = 2_000
    discount: float = 0.95
    learning_rate: float = 0.001
    epsilon_start: float = 1.0
    epsilon_decay: float = 0.995
    epsilon_end: float = 0.1
    target_every: int = 50
    double: bool = False
    mask: bool = False
    wrong_limit: int = 0
    see_mask: bool = True

    def __post_init__(self) -> None:
        _within("inputs", self.inputs, 1, 4096)
        _within("outputs", self.outputs, 2, 1024)
        _within("the number of hidden layers", len(self.hidden), 1, 8)
        for units in self.hidden:
            _within("hidden", units, 1, 4096)
        _within("batch_size", self.batch_size, 1, 4096)
        _within("memory_size", self.memory_size, self.batch_size, 1_000_000)
        for name in ("discount", "epsilon_start", "epsilon_decay", "epsilon_end"):
            _within(name, getattr(self, name), 0.0, 1.0)
        _within("learning_rate", self.learning_rate, math.nextafter(0.0, 1.0), 1.0)
        _within("target_every", self.target_every, 1, 1_000_000)
        _within("wrong_limit", self.wrong_limit, 0, 1_000_000)
        if not self.see_mask and self.inputs <= self.outputs:
            raise ValueError(f"without see_mask, inputs must be more than outputs ({self.outputs}), not {self.inputs}")

    @property
    def network(self) -> Mlp:
        """The network of one agent, before its tanh."""
        return Mlp((*self.hidden, self.outputs))


class Hyperparameters(NamedTuple):
    """The hyper-parameters that are passed to compiled functions as numbers, so that one compilation serves all their values.

    The names are those of `DeepQConfig`. The discount is not among them: compiled in, it is rounded differently, and the
    experiments in docs/experiments.md would give other networks.
    """

    learning_rate: np.float32
    epsilon_decay: np.float32
    epsilon_end: np.float32
    target_every: np.int32
    wrong_limit: np.int32


class Transitions(NamedTuple):
    """What followed a decision, one row per agent. Rows of agents that have nothing to learn are ignored.

    Attributes:
        states: (rows, inputs) f32, the observation.
        actions: (rows,) i32, the action taken.
        rewards: (rows,) f32.
        next_states: (rows, inputs) f32, the observation at the agent's next decision.
        next_masks: (rows, outputs) bool, the legal actions there.
        done: (rows,) bool, whether the episode ended instead; the next state is then ignored.
    """

    states: Array
    actions: Array
    rewards: Array
    next_states: Array
    next_masks: Array
    done: Array


class Agents(NamedTuple):
    """The state of all agents. `learn` consumes it: use the state it returns.

    Attributes:
        online: the network that decides.
        target: the network that evaluates next decisions.
        optimiser: Adam's state.
        memory: transitions (agents, memory_size, ...), a ring buffer.
        remembered: (agents,) i32, transitions stored so far; the next one goes to slot `remembered % memory_size`.
        epsilon: (agents,) f32, probability of exploring.
        updates: (agents,) i32, updates so far.
        keys: (agents,) the random keys.
    """

    online: Params
    target: Params
    optimiser: optax.OptState
    memory: Transitions
    remembered: Array
    epsilon: Array
    updates: Array
    keys: Array


# What one update changes.
LEARNED = ("online", "target", "optimiser", "epsilon", "updates", "keys")


def start(config: DeepQConfig, seeds: Sequence[int]) -> Agents:
    """Returns new agents, one per seed: Glorot-uniform weights, biases 0, empty memories."""
    agents: Agents = _init(_shapes(config), _keys(seeds))
    return _exploring(config, agents)


def start_from(config: DeepQConfig, online: Params, seeds: Sequence[int]) -> Agents:
    """Returns new agents with given networks (stacked), and with new memories, optimisers and exploration."""
    networks = len(online["Dense_0"]["bias"])
    if len(seeds) != networks:
        raise ValueError(f"{networks} networks and {len(seeds)} seeds: every agent needs one of each")
    agents: Agents = _init_from(_shapes(config), online, _keys(seeds))
    return _exploring(config, agents)


def outputs(config: DeepQConfig, params: Params, states: Array) -> Array:
    """Returns one network's outputs before the tanh, (rows, outputs), for states (rows, inputs)."""
    if not config.see_mask:
        states = jnp.where(jnp.arange(config.inputs) < config.inputs - config.outputs, states, 0.0)
    return config.network.of(params, states)


def act(
    config: DeepQConfig, agents: Agents, ids: ArrayLike, states: Array, masks: Array, attempts: Array, *, explore: bool = True
) -> tuple[Array, Array]:
    """Takes one decision for each row.

    Args:
        config: the hyper-parameters.
        agents: all agents.
        ids: (rows,) i32, the row's agent; each agent at most once. Rows of an agent that does not exist get some action.
        states: (rows, inputs) f32.
        masks: (rows, outputs) bool, the legal actions.
        attempts: (rows,) i32, illegal actions at this decision so far.
        explore: whether to explore at all.

    Returns:
        The new keys of all agents, to be stored in the agents, and the actions (rows,) i32.
    """
    # Passes only what a decision needs: this is called often, and memories are many arrays.
    decider = agents.online, agents.epsilon, agents.keys
    keys, actions = _act_step(
        _compiled(config), _hyperparameters(config).wrong_limit, explore, decider, ids, states, masks, attempts
    )
    return keys, actions


def learn(config: DeepQConfig, agents: Agents, ids: ArrayLike, transitions: Transitions) -> Agents:
    """Stores one transition per row and, where the memory holds a batch, updates the row's agent once.

    Args:
        config: the hyper-parameters.
        agents: all agents. Consumed.
        ids: (rows,) i32, the row's agent; each agent at most once. Rows of an agent that does not exist (any number from the
            number of agents on) are ignored: padding with them keeps the number of rows constant and avoids recompilation.
        transitions: one per row.
    """
    learned: Agents = _learn_step(_compiled(config), agents, _hyperparameters(config), ids, transitions)
    return learned


@cache
def _compiled(config: DeepQConfig) -> DeepQConfig:
    """Resets to the default what is not compiled into `act` and `learn`."""
    default = DeepQConfig()
    names = (*Hyperparameters._fields, "epsilon_start")
    return dataclasses.replace(config, **{name: getattr(default, name) for name in names})


@cache
def _shapes(config: DeepQConfig) -> DeepQConfig:
    """Keeps only what the shapes of agents depend on. The batch is minimal, so that it fits every memory."""
    return DeepQConfig(config.inputs, config.outputs, config.hidden, 1, config.memory_size)


@cache
def _hyperparameters(config: DeepQConfig) -> Hyperparameters:
    return Hyperparameters(
        learning_rate=np.float32(config.learning_rate),
        epsilon_decay=np.float32(config.epsilon_decay),
        epsilon_end=np.float32(config.epsilon_end),
        target_every=np.int32(config.target_every),
        wrong_limit=np.int32(config.wrong_limit),
    )


@partial(jax.jit, static_argnums=0)
def _act_step(
    config: DeepQConfig,
    wrong_limit: Array,
    explore: bool | Array,
    decider: tuple[Params, Array, Array],
    ids: Array,
    states: Array,
    masks: Array,
    attempts: Array,
) -> tuple[Array, Array]:
    """See `act`; `decider` holds the networks, epsilon and keys of the agents."""
    params, epsilon, before = jax.tree.map(lambda leaf: leaf.at[ids].get(mode="clip"), decider)
    epsilon = jnp.where(explore, epsilon, 0.0)
    actions, keys = jax.vmap(partial(_choose, config, wrong_limit))(params, epsilon, before, states, masks, attempts)
    return decider[2].at[ids].set(keys, mode="drop"), actions


@partial(jax.jit, static_argnums=0, donate_argnums=1)
def _learn_step(config: DeepQConfig, agents: Agents, hyper: Hyperparameters, ids: Array, transitions: Transitions) -> Agents:
    """See `learn`."""
    slots = agents.remembered.at[ids].get(mode="clip") % config.memory_size
    memory = jax.tree.map(lambda old, new: old.at[ids, slots].set(new, mode="drop"), agents.memory, transitions)
    agents = agents._replace(memory=memory, remembered=agents.remembered.at[ids].add(1, mode="drop"))

    stored = jnp.minimum(agents.remembered.at[ids].get(mode="clip"), config.memory_size)
    learned = {name: getattr(agents, name) for name in LEARNED}
    learners = jax.tree.map(lambda leaf: leaf.at[ids].get(mode="clip"), learned)
    learners["keys"], draws = _split(learners["keys"])
    drawn = jax.vmap(lambda key, top: jax.random.randint(key, (config.batch_size,), 0, top))(draws, jnp.maximum(stored, 1))
    batches = jax.tree.map(lambda column: column.at[ids[:, None], drawn].get(mode="clip"), memory)
    updated = jax.vmap(partial(_update, config, hyper))(learners, batches)
    # An agent whose memory does not hold a batch yet stays as it is: its row is dropped.
    ready = jnp.where(stored >= config.batch_size, ids, len(agents.keys))
    return agents._replace(**jax.tree.map(lambda leaf, new: leaf.at[ready].set(new, mode="drop"), learned, updated))


def _choose(
    config: DeepQConfig, wrong_limit: Array, params: Params, epsilon: Array, key: Array, state: Array, mask: Array, attempts: Array
) -> tuple[Array, Array]:
    """Returns one agent's action and its next key."""
    allowed = mask if config.mask else jnp.ones_like(mask)
    best = jnp.argmax(jnp.where(allowed, outputs(config, params, state[None])[0], -jnp.inf))
    key, coin, choice = jax.random.split(key, 3)
    exhausted = jnp.logical_and(wrong_limit > 0, attempts >= wrong_limit)
    by_chance = jnp.argmax(jnp.where(jnp.where(exhausted, mask, allowed), jax.random.uniform(choice, mask.shape), -1.0))
    exploring = jax.random.uniform(coin) < epsilon
    return jnp.where(jnp.logical_or(exhausted, exploring), by_chance, best).astype(jnp.int32), key


def _update(config: DeepQConfig, hyper: Hyperparameters, learner: dict[str, Any], batch: Transitions) -> dict[str, Any]:
    """Returns one agent's learned state after one update."""
    online, target = learner["online"], learner["target"]
    next_values = jnp.tanh(outputs(config, target, batch.next_states))
    judged = outputs(config, online, batch.next_states) if config.double else next_values
    if config.mask:
        judged = jnp.where(batch.next_masks, judged, -jnp.inf)
    best = jax.nn.one_hot(jnp.argmax(judged, axis=-1), config.outputs)
    targets = batch.rewards + config.discount * jnp.where(batch.done, 0.0, (best * next_values).sum(-1))

    def loss(params: Params) -> Array:
        taken = jax.nn.one_hot(batch.actions, config.outputs)
        chosen = (taken * jnp.tanh(outputs(config, params, batch.states))).sum(-1)
        return jnp.mean((chosen - targets) ** 2)

    steps, optimiser = optax.adam(hyper.learning_rate).update(jax.grad(loss)(online), learner["optimiser"])
    online = optax.apply_updates(online, steps)
    updates = learner["updates"] + 1
    return learner | {
        "online": online,
        "target": optax.periodic_update(online, target, updates, hyper.target_every),
        "optimiser": optimiser,
        "epsilon": jnp.minimum(learner["epsilon"], jnp.maximum(hyper.epsilon_end, learner["epsilon"] * hyper.epsilon_decay)),
        "updates": updates,
    }


def _split(keys: Array) -> tuple[Array, Array]:
    pairs = jax.vmap(lambda key: jax.random.split(key, 2))(keys)
    return pairs[:, 0], pairs[:, 1]


def _exploring(config: DeepQConfig, agents: Agents) -> Agents:
    """Sets epsilon to its initial value."""
    return agents._replace(epsilon=jnp.full(len(agents.keys), config.epsilon_start, jnp.float32))


def _keys(seeds: Sequence[int]) -> Array:
    if not seeds:
        raise ValueError("no seeds: every agent needs one")
    return jnp.stack([jax.random.key(seed) for seed in seeds])


@partial(jax.jit, static_argnums=0)
def _init(config: DeepQConfig, keys: Array) -> Agents:
    keys, draws = _split(keys)
    return _fresh(config, jax.vmap(lambda key: config.network.start(key, config.inputs))(draws), keys)


@partial(jax.jit, static_argnums=0)
def _init_from(config: DeepQConfig, online: Params, keys: Array) -> Agents:
    return _fresh(config, online, _split(keys)[0])


def _fresh(config: DeepQConfig, online: Params, keys: Array) -> Agents:
    number = len(keys)
    ring = (number, config.memory_size)
    return Agents(
        online=online,
        target=online,
        optimiser=jax.vmap(optax.adam(config.learning_rate).init)(online),
        memory=Transitions(
            states=jnp.zeros((*ring, config.inputs), jnp.float32),
            actions=jnp.zeros(ring, jnp.int32),
            rewards=jnp.zeros(ring, jnp.float32),
            next_states=jnp.zeros((*ring, config.inputs), jnp.float32),
            next_masks=jnp.zeros((*ring, config.outputs), jnp.bool_),
            done=jnp.zeros(ring, jnp.bool_),
        ),
        remembered=jnp.zeros(number, jnp.int32),
        epsilon=jnp.zeros(number, jnp.float32),
        updates=jnp.zeros(number, jnp.int32),
        keys=keys,
    )


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} must be {low:,}..={high:,}, not {value:,}")
