"""The command `value`: trains a value network, which estimates the expected points of a policy from what a seat may know.

The policy plays all seats. In each Shift the first seat takes a random action at one of its first decisions, and then plays by the
policy again, in situations that it would not have reached itself. The network learns from the decisions after that action.
"""

import argparse
import dataclasses
import json
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
import optax
from tqdm import tqdm

from chefshat import join_options, pb
from chefshat.address import ServerAddress
from chefshat.errors import ChefsHatError, failed
from chefshat.learn import features, network, runs
from chefshat.learn.mlp import Mlp, Params, to_layers
from chefshat.learn.network import Network, NetworkFileError
from chefshat.learn.training_file import network_info
from chefshat.opponents import selected
from chefshat.vector import VectorEnv

# Parallel games.
GAMES = 256
# The random action is one of the first 20 decisions; few Shifts have more.
EXPLORED = 20
# The share of Shifts for validation.
VALIDATION = 0.1
MINIBATCH = 1024
# Rows that are moved at a time.
CHUNK = 1024
LEARNING_RATE = 1e-3


@dataclass(frozen=True)
class Learned:
    """How well the points of other Shifts are estimated. A constant, their mean, explains 0 of their variance.

    Attributes:
        decisions: decisions learned from.
        shifts: Shifts that they are from.
        explained: share of the variance of points that the network explains, at most 1.
        explained_by_cards: the same by the best linear function of the numbers of cards in all hands, for comparison.
    """

    decisions: int
    shifts: int
    explained: float
    explained_by_cards: float

    def __str__(self) -> str:
        network, cards = 100 * self.explained, 100 * self.explained_by_cards
        learned_from = f"learned from {self.decisions:,} decisions of {self.shifts:,} Shifts"
        return f"explains {network:.1f} % of the variance of points, the numbers of cards {cards:.1f} % ({learned_from})"


@dataclass(frozen=True)
class Samples:
    """Decisions of Shifts that have ended.

    Attributes:
        inputs: (D, W) f16: `features.table` of each.
        cards: (D, N) u8: cards in each hand, from that of the seat that decides on.
        points: (D,) f32: points of its Shift.
        shifts: (D,): the number of its Shift.
    """

    inputs: npt.NDArray[np.float16]
    cards: npt.NDArray[np.uint8]
    points: npt.NDArray[np.float32]
    shifts: npt.NDArray[np.int64]


def run(options: argparse.Namespace) -> int:
    """Runs the command: plays, learns, writes the network and prints how well it knows. Returns the exit code."""
    try:
        with runs.reserved(options.out, replace=options.force, can_resume=False):
            found = _train(options)
    except (ChefsHatError, NetworkFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    print(json.dumps(dataclasses.asdict(found)) if options.json else f"{options.out} {found}")
    return 0


def _train(options: argparse.Namespace) -> Learned:
    """Plays, learns and writes the network."""
    policy = network.load(options.policy)
    samples, rules = play(
        policy, options.policy, options.decisions, options.seed, options.rules, join_options.server_if_any(options)
    )
    params, found = learn(samples, options.width, options.epochs, options.seed, float(max(rules.points)))
    name = f"value of {policy.info.name or options.policy}"[:64]
    info = network_info(rules, name, runs.trained_by("", options.trained_by), input="table", output="points", masked=True)
    network.save(options.out, to_layers(params), info, dtype=np.float16)
    return found


def play(
    policy: Network, file: Path, decisions: int, seed: int, rules: str | pb.RuleSet, address: str | ServerAddress | None
) -> tuple[Samples, pb.RuleSet]:
    """Plays until there are this many decisions to learn from. `file`: the policy's, by which the other seats play."""
    if policy.info.output != "actions":
        raise ValueError(f"{file} has outputs for {policy.info.output}: a value is that of a policy for all actions")
    opponent = network.TRAINED if str(file) == network.TRAINED else file
    rng = np.random.default_rng(seed)
    cards: list[npt.NDArray[np.uint8]] = []
    shifts_of: list[npt.NDArray[np.int64]] = []
    # The Shifts that have ended, and their points.
    ended_shifts: list[npt.NDArray[np.int64]] = []
    ended_points: list[npt.NDArray[np.float32]] = []
    options: Any = {"client_seats": [0], "opponents": opponent, "rules": rules, "skip_forced": True}
    with VectorEnv(address, GAMES, seed=runs.SEED_STEP + seed, **options) as env:
        if not policy.info.fits(env.players, env.faces, env.hand_size):
            raise ValueError(f"{file} plays with {policy.info.players} players and {policy.info.faces} faces, not in these games")
        worth = np.array(env.rules.points, np.float32)
        # These take nearly all of the memory, so they exist once.
        inputs = np.empty((decisions + GAMES, features.table_width(env.players, env.faces)), np.float16)
        # Of each game: its Shift, the number of its next decision there, and that of the random action.
        shift, number, explored = np.arange(GAMES), np.zeros(GAMES, np.int64), rng.integers(EXPLORED, size=GAMES)
        begun, kept = GAMES, 0
        random_actions = env.sample(seed)
        with tqdm(total=decisions, unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
            while kept < decisions:
                batch, games = env.batch, env.batch.games
                rows = np.flatnonzero(number[games] > explored[games])
                if len(rows):
                    inputs[kept : kept + len(rows)] = features.table_of(selected(batch, rows))
                    cards.append(batch.observations.cards_left[rows])
                    shifts_of.append(shift[games[rows]])
                    kept += len(rows)
                    bar.update(len(rows))
                actions = np.where(number[games] == explored[games], random_actions, policy.actions_of(batch))
                number[games] += 1
                endings = env.step(actions).endings.first_of_each_game()
                ended = endings.games
                ended_shifts.append(shift[ended])
                ended_points.append(worth[endings.places_taken - 1])
                shift[ended] = begun + np.arange(len(ended))
                begun += len(ended)
                number[ended], explored[ended] = 0, rng.integers(EXPLORED, size=len(ended))
                random_actions = env.sample()
        rules_used = env.rules
    points = np.full(begun, np.nan, np.float32)
    points[np.concatenate(ended_shifts)] = np.concatenate(ended_points)
    shifts = np.concatenate(shifts_of)
    known = np.flatnonzero(~np.isnan(points[shifts]))
    for first in range(0, len(known), CHUNK):
        part = known[first : first + CHUNK]
        inputs[first : first + len(part)] = inputs[part]
    samples = Samples(inputs[: len(known)], np.concatenate(cards)[known], points[shifts[known]], shifts[known])
    return samples, rules_used


def learn(samples: Samples, width: int, epochs: int, seed: int, most: float) -> tuple[Params, Learned]:
    """Learns the points by least squares. `most`: the most points of a Shift, for the scale of the outputs."""
    rng = np.random.default_rng(seed)
    shifts, of = np.unique(samples.shifts, return_inverse=True)
    measured = (rng.random(len(shifts)) < VALIDATION)[of]
    rows = np.flatnonzero(~measured)
    if len(rows) < MINIBATCH or not measured.any():
        raise ValueError(f"{len(samples.points)} decisions are too few to learn from: play more with --decisions")
    mlp = Mlp((width, width, 1))
    params = mlp.start(jax.random.key(seed), samples.inputs.shape[1])
    steps = epochs * (len(rows) // MINIBATCH)
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, steps))
    state = optimizer.init(params)
    update = jax.jit(partial(_update, mlp, optimizer))
    with tqdm(total=steps, unit=" updates", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        for _ in range(epochs):
            order = rng.permutation(rows)
            for first in range(0, len(rows) - MINIBATCH + 1, MINIBATCH):
                part = order[first : first + MINIBATCH]
                targets = samples.points[part] / most
                params, state = update(params, state, samples.inputs[part].astype(np.float32), targets)
                bar.update()
    last = params[f"Dense_{len(params) - 1}"]
    params = {**params, f"Dense_{len(params) - 1}": {name: most * array for name, array in last.items()}}
    parts = np.array_split(samples.inputs[measured], 64)
    expected = np.concatenate([np.asarray(mlp.of(params, jnp.asarray(part, jnp.float32)))[:, 0] for part in parts])
    linear = np.column_stack([samples.cards, np.ones(len(samples.cards))])
    slopes = np.linalg.lstsq(linear[rows].astype(np.float64), samples.points[rows], rcond=None)[0]
    points = samples.points[measured]
    explained = [float(1 - np.square(points - found).mean() / points.var()) for found in (expected, linear[measured] @ slopes)]
    return params, Learned(len(rows), len(np.unique(samples.shifts[rows])), *explained)


def _update(
    mlp: Mlp,
    optimizer: optax.GradientTransformation,
    params: Params,
    state: optax.OptState,
    inputs: jax.Array,
    targets: jax.Array,
) -> tuple[Params, optax.OptState]:
    def loss(params: Params) -> jax.Array:
        return jnp.square(mlp.of(params, inputs)[:, 0] - targets).mean()

    changes, state = optimizer.update(jax.grad(loss)(params), state)
    updated: Params = optax.apply_updates(params, changes)
    return updated, state
