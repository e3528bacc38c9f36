"""The Deep Q agent of the 2020 paper, as pure functions over a stack of independent agents that are trained in lock-step.

Here are its hyper-parameters, the state of the agents, and the functions `start`, `act` and `learn`. Every array of the state has
a leading axis, one entry an agent; agents share nothing, so a stack of one is simply one agent, and an agent in a stack learns what
it would have learned alone. Playing games is not here (see `deep_q_training`), nor are files (`checkpoint`).

Where the paper is silent, this is decided:

- An agent learns after every transition, wrong actions included, once its memory holds a batch: one batch of `batch_size`
  transitions, drawn uniformly with replacement, and one step of Adam.
- Epsilon is multiplied with `epsilon_decay` after each such update, so it reaches 0.1 after 460 of them: in the first Shifts.
  Decayed once a game it would still be 0.78 at the 50th game, from which on the paper's agent is said to win always. The agent
  first published with the paper's figures also decays with every update.
- The target network is the online network as it was after the last update whose number is a multiple of `target_every`.
- The loss is the mean squared error of the chosen actions. What an action is aimed at may lie outside of -1..=1, the range of the
  outputs, since rewards of 1 discounted by 0.95 add up to 20; it is not cut off.
- Actions are compared before the tanh, which changes no order but tells apart what single precision rounds to the same 1.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.typing import ArrayLike

Array: TypeAlias = jax.Array
# Weights (agents, in, out) and biases (agents, out), from the input on.
Layers: TypeAlias = tuple[tuple[Array, Array], ...]


@dataclass(frozen=True)
class DeepQConfig:
    """The hyper-parameters; the standard values are those of the paper's table. A value out of its range raises ValueError.

    Attributes:
        inputs: numbers an agent sees, 1..=4096; the classic vector of the standard deck has 228.
        outputs: actions, 2..=1024; the turns of the standard deck are 200.
        hidden: neurons of each hidden layer (ReLU), 1 to 8 layers of 1..=4096. The output layer is tanh.
        batch_size: transitions in one update, 1..=4096.
        memory_size: transitions that are remembered, `batch_size`..=1,000,000; the oldest is forgotten first.
        discount: of the next decision's value, 0..=1.
        learning_rate: of Adam, above 0 and at most 1.
        epsilon_start: chance to explore at the beginning, 0..=1.
        epsilon_decay: factor of that chance after every update, 0..=1.
        epsilon_end: where it stops, 0..=1.
        target_every: updates between two copies of the online network to the target network, 1..=1,000,000.
        double: whether the online network says which next action the target network values (double Q-learning).
        mask: whether illegal actions are left out: in exploring, in exploiting and in the value of the next decision.
        wrong_limit: wrong actions at one decision after which a legal one is taken by chance, 0..=1,000,000; 0: any number of them.
        see_mask: whether the agent sees the legal actions. If not, the last `outputs` inputs count as 0 for it, which leaves the
            board and the hand.
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
        for neurons in self.hidden:
            _within("hidden", neurons, 1, 4096)
        _within("batch_size", self.batch_size, 1, 4096)
        _within("memory_size", self.memory_size, self.batch_size, 1_000_000)
        for name in ("discount", "epsilon_start", "epsilon_decay", "epsilon_end"):
            _within(name, getattr(self, name), 0.0, 1.0)
        _within("learning_rate", self.learning_rate, math.nextafter(0.0, 1.0), 1.0)
        _within("target_every", self.target_every, 1, 1_000_000)
        _within("wrong_limit", self.wrong_limit, 0, 1_000_000)
        if not self.see_mask and self.inputs <= self.outputs:
            raise ValueError(f"without see_mask, inputs must be more than outputs ({self.outputs}), not {self.inputs}")


class Numbers(NamedTuple):
    """Those hyper-parameters that neither shapes nor steps depend on: what is compiled for one set of them serves all others.

    They are numpy numbers under the names of `DeepQConfig`. The discount is not among them: compiled in, it is rounded otherwise,
    and the networks of the experiments in docs/experiments.md would be others.
    """

    learning_rate: np.float32
    epsilon_decay: np.float32
    epsilon_end: np.float32
    target_every: np.int32
    wrong_limit: np.int32


class Transitions(NamedTuple):
    """What followed a decision, one row an agent. Rows whose agent has nothing to learn are ignored.

    Attributes:
        states: (rows, inputs) f32, what was seen.
        actions: (rows,) i32, what was done.
        rewards: (rows,) f32.
        next_states: (rows, inputs) f32, what was seen at the agent's next decision.
        next_masks: (rows, outputs) bool, the legal actions there.
        done: (rows,) bool, the episode ended instead, and the next state means nothing.
    """

    states: Array
    actions: Array
    rewards: Array
    next_states: Array
    next_masks: Array
    done: Array


class Agents(NamedTuple):
    """The state of all agents. `learn` consumes it: use what it returns, not what it was given.

    Attributes:
        online: the network that decides.
        target: the network that values next decisions.
        optimiser: Adam's state.
        memory: transitions (agents, memory_size, ...), a ring.
        remembered: (agents,) i32, transitions ever remembered; the next one goes to slot `remembered % memory_size`.
        epsilon: (agents,) f32, chance to explore.
        updates: (agents,) i32, updates so far.
        keys: (agents,) keys of each agent's own chance.
    """

    online: Layers
    target: Layers
    optimiser: optax.OptState
    memory: Transitions
    remembered: Array
    epsilon: Array
    updates: Array
    keys: Array


def start(config: DeepQConfig, seeds: Sequence[int]) -> Agents:
    """New agents, one a seed: weights drawn uniformly as by Glorot and Bengio, biases 0, memories empty."""
    agents: Agents = _started(_shapes(config), _keys(seeds))
    return _exploring(config, agents)


def start_from(config: DeepQConfig, online: Layers, seeds: Sequence[int]) -> Agents:
    """New agents that begin with given networks, stacked, and with memory, optimiser and exploration as at a start."""
    if len(seeds) != len(online[0][0]):
        raise ValueError(f"{len(online[0][0])} networks and {len(seeds)} seeds: every agent needs one of each")
    agents: Agents = _started_from(_shapes(config), online, _keys(seeds))
    return _exploring(config, agents)


def outputs(config: DeepQConfig, layers: Layers, states: Array) -> Array:
    """What one network says of states (rows, inputs) before its tanh: (rows, outputs)."""
    values = states
    if not config.see_mask:
        values = jnp.where(jnp.arange(config.inputs) < config.inputs - config.outputs, values, 0.0)
    for weight, bias in layers[:-1]:
        values = jax.nn.relu(values @ weight + bias)
    weight, bias = layers[-1]
    return values @ weight + bias


def act(
    config: DeepQConfig, agents: Agents, ids: ArrayLike, states: Array, masks: Array, attempts: Array, *, explore: bool = True
) -> tuple[Array, Array]:
    """One decision for each row.

    Args:
        config: the hyper-parameters.
        agents: all agents.
        ids: (rows,) i32, the row's agent; each agent at most once. Rows of an agent that does not exist are decided somehow.
        states: (rows, inputs) f32.
        masks: (rows, outputs) bool, the legal actions.
        attempts: (rows,) i32, wrong actions at this decision so far.
        explore: whether to explore at all.

    Returns:
        The keys of all agents, to be put into the agents, and the actions (rows,) i32.
    """
    # Only what a decision needs is handed over: it is called much, and memories are many arrays.
    decider = agents.online, agents.epsilon, agents.keys
    keys, actions = _acted(_compiled(config), _numbers(config).wrong_limit, explore, decider, ids, states, masks, attempts)
    return keys, actions


def learn(config: DeepQConfig, agents: Agents, ids: ArrayLike, transitions: Transitions) -> Agents:
    """Remembers one transition a row and, where the memory holds a batch, updates the row's agent once.

    Args:
        config: the hyper-parameters.
        agents: all agents. Consumed.
        ids: (rows,) i32, the row's agent; each agent at most once. Rows of an agent that does not exist (any number from the
            number of agents on) are ignored: so the number of rows can stay the same, and nothing is compiled anew.
        transitions: one a row.
    """
    learned: Agents = _taught(_compiled(config), agents, _numbers(config), ids, transitions)
    return learned


@cache
def _compiled(config: DeepQConfig) -> DeepQConfig:
    """The same with the standard value of all that is not compiled into `act` and `learn`."""
    standard = DeepQConfig()
    names = (*Numbers._fields, "epsilon_start")
    return dataclasses.replace(config, **{name: getattr(standard, name) for name in names})


@cache
def _shapes(config: DeepQConfig) -> DeepQConfig:
    """Those that the shapes of agents depend on. A batch is as small as can be, so that it fits every memory."""
    return DeepQConfig(config.inputs, config.outputs, config.hidden, 1, config.memory_size)


@cache
def _numbers(config: DeepQConfig) -> Numbers:
    return Numbers(
        learning_rate=np.float32(config.learning_rate),
        epsilon_decay=np.float32(config.epsilon_decay),
        epsilon_end=np.float32(config.epsilon_end),
        target_every=np.int32(config.target_every),
        wrong_limit=np.int32(config.wrong_limit),
    )


@partial(jax.jit, static_argnums=0)
def _acted(
    config: DeepQConfig,
    wrong_limit: Array,
    explore: bool | Array,
    decider: tuple[Layers, Array, Array],
    ids: Array,
    states: Array,
    masks: Array,
    attempts: Array,
) -> tuple[Array, Array]:
    """See `act`; `decider` is what of the agents a decision needs: networks, epsilon and keys."""
    layers, epsilon, before = jax.tree.map(lambda leaf: leaf.at[ids].get(mode="clip"), decider)
    epsilon = jnp.where(explore, epsilon, 0.0)
    actions, keys = jax.vmap(partial(_decided, config, wrong_limit))(layers, epsilon, before, states, masks, attempts)
    return decider[2].at[ids].set(keys, mode="drop"), actions


@partial(jax.jit, static_argnums=0, donate_argnums=1)
def _taught(config: DeepQConfig, agents: Agents, numbers: Numbers, ids: Array, transitions: Transitions) -> Agents:
    """See `learn`."""
    slots = agents.remembered.at[ids].get(mode="clip") % config.memory_size
    memory = jax.tree.map(lambda kept, new: kept.at[ids, slots].set(new, mode="drop"), agents.memory, transitions)
    remembered = agents.remembered.at[ids].add(1, mode="drop")
    agents = agents._replace(memory=memory, remembered=remembered)

    held = jnp.minimum(remembered.at[ids].get(mode="clip"), config.memory_size)
    learners = jax.tree.map(lambda leaf: leaf.at[ids].get(mode="clip"), _learner(agents))
    keys, draws = _split(learners.keys)
    drawn = jax.vmap(lambda key, top: jax.random.randint(key, (config.batch_size,), 0, top))(draws, jnp.maximum(held, 1))
    batches = jax.tree.map(lambda kept: kept.at[ids[:, None], drawn].get(mode="clip"), memory)
    updated = jax.vmap(partial(_updated, config, numbers))(learners, batches)
    # An agent whose memory does not yet hold a batch stays as it is: its row is dropped.
    ready = jnp.where(held >= config.batch_size, ids, len(agents.keys))
    learned = jax.tree.map(lambda leaf, new: leaf.at[ready].set(new, mode="drop"), _learner(agents), updated._replace(keys=keys))
    return agents._replace(**learned._asdict())


class _Learner(NamedTuple):
    """What an update changes, under the names it has in `Agents`."""

    online: Layers
    target: Layers
    optimiser: optax.OptState
    epsilon: Array
    updates: Array
    keys: Array


def _learner(agents: Agents) -> _Learner:
    return _Learner(agents.online, agents.target, agents.optimiser, agents.epsilon, agents.updates, agents.keys)


def _decided(
    config: DeepQConfig, wrong_limit: Array, layers: Layers, epsilon: Array, key: Array, state: Array, mask: Array, attempts: Array
) -> tuple[Array, Array]:
    """One agent's decision and its next key."""
    allowed = mask if config.mask else jnp.ones_like(mask)
    best = jnp.argmax(jnp.where(allowed, outputs(config, layers, state[None])[0], -jnp.inf))
    key, coin, choice = jax.random.split(key, 3)
    given_up = jnp.logical_and(wrong_limit > 0, attempts >= wrong_limit)
    by_chance = jnp.argmax(jnp.where(jnp.where(given_up, mask, allowed), jax.random.uniform(choice, mask.shape), -1.0))
    exploring = jax.random.uniform(coin) < epsilon
    return jnp.where(jnp.logical_or(given_up, exploring), by_chance, best).astype(jnp.int32), key


def _updated(config: DeepQConfig, numbers: Numbers, learner: _Learner, batch: Transitions) -> _Learner:
    """One agent after one update."""
    next_values = jnp.tanh(outputs(config, learner.target, batch.next_states))
    judged = outputs(config, learner.online, batch.next_states) if config.double else next_values
    if config.mask:
        judged = jnp.where(batch.next_masks, judged, -jnp.inf)
    best = jax.nn.one_hot(jnp.argmax(judged, axis=-1), config.outputs)
    aim = batch.rewards + config.discount * jnp.where(batch.done, 0.0, (best * next_values).sum(-1))

    def loss(layers: Layers) -> Array:
        taken = jax.nn.one_hot(batch.actions, config.outputs)
        chosen = (taken * jnp.tanh(outputs(config, layers, batch.states))).sum(-1)
        return jnp.mean((chosen - aim) ** 2)

    steps, optimiser = _adam(numbers.learning_rate).update(jax.grad(loss)(learner.online), learner.optimiser)
    online: Layers = optax.apply_updates(learner.online, steps)
    updates = learner.updates + 1
    copied = updates % numbers.target_every == 0
    return learner._replace(
        online=online,
        target=jax.tree.map(lambda new, old: jnp.where(copied, new, old), online, learner.target),
        optimiser=optimiser,
        epsilon=jnp.minimum(learner.epsilon, jnp.maximum(numbers.epsilon_end, learner.epsilon * numbers.epsilon_decay)),
        updates=updates,
    )


def _adam(learning_rate: float | np.float32) -> optax.GradientTransformation:
    return optax.adam(learning_rate)


def _split(keys: Array) -> tuple[Array, Array]:
    pairs = jax.vmap(lambda key: jax.random.split(key, 2))(keys)
    return pairs[:, 0], pairs[:, 1]


def _exploring(config: DeepQConfig, agents: Agents) -> Agents:
    """The agents as much as they explore at the beginning."""
    return agents._replace(epsilon=jnp.full(len(agents.keys), config.epsilon_start, jnp.float32))


def _keys(seeds: Sequence[int]) -> Array:
    if not seeds:
        raise ValueError("no seeds: every agent needs one")
    return jnp.stack([jax.random.key(seed) for seed in seeds])


@partial(jax.jit, static_argnums=0)
def _started(config: DeepQConfig, keys: Array) -> Agents:
    keys, draws = _split(keys)
    return _fresh(config, jax.vmap(partial(_new_layers, config))(draws), keys)


@partial(jax.jit, static_argnums=0)
def _started_from(config: DeepQConfig, online: Layers, keys: Array) -> Agents:
    return _fresh(config, online, _split(keys)[0])


def _new_layers(config: DeepQConfig, key: Array) -> Layers:
    sizes = (config.inputs, *config.hidden, config.outputs)
    glorot = jax.nn.initializers.glorot_uniform()
    keys = jax.random.split(key, len(sizes) - 1)
    return tuple(
        (glorot(keys[layer], (size, sizes[layer + 1]), jnp.float32), jnp.zeros(sizes[layer + 1], jnp.float32))
        for layer, size in enumerate(sizes[:-1])
    )


def _fresh(config: DeepQConfig, online: Layers, keys: Array) -> Agents:
    number = len(keys)
    ring = (number, config.memory_size)
    return Agents(
        online=online,
        target=online,
        optimiser=jax.vmap(_adam(config.learning_rate).init)(online),
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
