"""Masked PPO in one file with JAX, in the manner of CleanRL: one seat learns against built-in agents, in many games at once.

    pip install '.[envs,learn]' ./native
    python samples/learning/ppo_jax.py
    python samples/learning/ppo_jax.py --opponents greedy --decisions 3000000

The algorithm is that of `ppo_torch.py`. `chefshat-learn ppo` trains by self-play instead, and its networks play in rooms.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import optax

Params = dict[str, list[tuple[jax.Array, jax.Array]]]


@dataclass(frozen=True)
class Options:
    """The options of the command line."""

    opponents: str = "random"
    """Built-in agents of the other seats."""
    decisions: int = 200_000
    """Decisions to learn from."""
    games: int = 64
    """Games at once."""
    steps: int = 64
    """Steps of all games between two updates."""
    epochs: int = 4
    """Passes over the decisions of an update."""
    minibatches: int = 4
    """Parts of a pass, which divide the decisions of an update."""
    learning_rate: float = 1e-3
    """Learning rate at the beginning; it falls to 0."""
    discount: float = 0.99
    """Discount of rewards, gamma."""
    gae_lambda: float = 0.95
    """Lambda of generalised advantage estimation."""
    clip: float = 0.2
    """Clipping of the policy's ratio."""
    entropy_bonus: float = 0.01
    """Weight of the entropy in the loss."""
    value_weight: float = 0.5
    """Weight of the value's loss."""
    max_gradient: float = 0.5
    """Norm to which gradients are clipped."""
    width: int = 128
    """Width of the hidden layers."""
    seed: int = 1
    """Seed of the games and the networks."""
    evaluation: int = 1000
    """Shifts to play at the end."""


class Samples(NamedTuple):
    """What the games brought since the last update: a row for each decision."""

    seen: jax.Array
    masks: jax.Array
    actions: jax.Array
    log_probabilities: jax.Array
    gains: jax.Array
    returns: jax.Array


def create(key: jax.Array, inputs: int, actions: int, width: int) -> Params:
    """Creates a policy and a value: networks with two hidden layers and orthogonal weights."""

    def network(key: jax.Array, outputs: int, gain: float) -> list[tuple[jax.Array, jax.Array]]:
        shapes = [(inputs, width, 2**0.5), (width, width, 2**0.5), (width, outputs, gain)]
        keys = jax.random.split(key, len(shapes))
        return [
            (jax.nn.initializers.orthogonal(scale)(key, (rows, columns)), jnp.zeros(columns))
            for key, (rows, columns, scale) in zip(keys, shapes, strict=True)
        ]

    of_policy, of_value = jax.random.split(key)
    return {"policy": network(of_policy, actions, 0.01), "value": network(of_value, 1, 1.0)}


def evaluated(layers: list[tuple[jax.Array, jax.Array]], seen: jax.Array) -> jax.Array:
    """Returns the outputs of a network."""
    for weights, bias in layers[:-1]:
        seen = jnp.tanh(seen @ weights + bias)
    weights, bias = layers[-1]
    return seen @ weights + bias


def log_policy(params: Params, seen: jax.Array, masks: jax.Array) -> jax.Array:
    """Returns the logarithms of the probabilities; illegal actions have none."""
    return jax.nn.log_softmax(jnp.where(masks, evaluated(params["policy"], seen), -1e8))


@jax.jit
def act(params: Params, key: jax.Array, seen: jax.Array, masks: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Draws actions. Returns them, the logarithms of their probabilities, and the values."""
    logs = log_policy(params, seen, masks)
    actions = jax.random.categorical(key, logs)
    return actions, jnp.take_along_axis(logs, actions[:, None], 1)[:, 0], evaluated(params["value"], seen)[:, 0]


@jax.jit
def best(params: Params, seen: jax.Array, masks: jax.Array) -> jax.Array:
    """Returns the most probable actions."""
    return log_policy(params, seen, masks).argmax(1)


def loss_of(params: Params, samples: Samples, options: Options) -> tuple[jax.Array, dict[str, jax.Array]]:
    """Returns the loss, and its parts."""
    logs = log_policy(params, samples.seen, samples.masks)
    ratio = jnp.exp(jnp.take_along_axis(logs, samples.actions[:, None], 1)[:, 0] - samples.log_probabilities)
    gains = (samples.gains - samples.gains.mean()) / (samples.gains.std() + 1e-8)
    policy_loss = -jnp.minimum(gains * ratio, gains * jnp.clip(ratio, 1 - options.clip, 1 + options.clip)).mean()
    value_loss = jnp.square(evaluated(params["value"], samples.seen)[:, 0] - samples.returns).mean() / 2
    entropy = -(jnp.exp(logs) * logs).sum(1).mean()
    loss = policy_loss + options.value_weight * value_loss - options.entropy_bonus * entropy
    return loss, {"policy_loss": policy_loss, "value_loss": value_loss, "entropy": entropy}


def optimizer(options: Options) -> optax.GradientTransformation:
    """Creates the optimizer; its learning rate is set for each update."""
    adam = optax.inject_hyperparams(optax.adam)(learning_rate=options.learning_rate, eps=1e-5)
    return optax.chain(optax.clip_by_global_norm(options.max_gradient), adam)


@partial(jax.jit, static_argnames="options")
def learn(
    params: Params, state: optax.OptState, key: jax.Array, samples: Samples, options: Options
) -> tuple[Params, optax.OptState, dict[str, jax.Array]]:
    """Learns from samples. Returns the networks, the optimizer's state, and the losses of the last minibatch."""
    count = len(samples.actions)

    def minibatch(carry: tuple[Params, optax.OptState], rows: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        params, state = carry
        part = Samples(*(column[rows] for column in samples))
        gradients, losses = jax.grad(loss_of, has_aux=True)(params, part, options)
        changes, state = optimizer(options).update(gradients, state, params)
        return (optax.apply_updates(params, changes), state), losses

    keys = jax.random.split(key, options.epochs)
    rows = jnp.concatenate([jax.random.permutation(key, count).reshape(options.minibatches, -1) for key in keys])
    (params, state), losses = jax.lax.scan(minibatch, (params, state), rows)
    return params, state, {name: value[-1] for name, value in losses.items()}


class Games:
    """The games, and the current observation of each."""

    def __init__(self, options: Options, *, seed: int) -> None:
        self.envs = gymnasium.make_vec(
            "chefshat.envs:chefshat/ChefsHat-v1",
            num_envs=options.games,
            observation="table",
            rewards="winning",
            opponents=options.opponents,
        )
        self.seen, infos = self.envs.reset(seed=seed)
        self.masks = infos["action_mask"] == 1
        # The places of the episodes that have ended.
        self.places: list[int] = []

    def step(self, actions: Any) -> tuple[Any, Any]:  # noqa: ANN401 - Arrays.
        """Takes an action in each game. Returns rewards, and where episodes ended; the next ones have begun."""
        self.seen, rewards, terminated, truncated, infos = self.envs.step(np.asarray(actions))
        ended = terminated | truncated
        if ended.any():
            self.places.extend(infos["final_info"]["place"][ended].tolist())
        self.masks = infos["action_mask"] == 1
        return rewards.astype(np.float32), ended

    def play(self, params: Params, key: jax.Array, options: Options) -> Samples:
        """Plays some steps by the policy, and estimates advantages."""
        rows = []
        for key in jax.random.split(key, options.steps):  # noqa: B020
            seen, masks = self.seen, self.masks
            actions, log_probabilities, values = map(np.asarray, act(params, key, seen, masks))
            rows.append((seen, masks, actions, log_probabilities, values, *self.step(actions)))
        seen, masks, actions, log_probabilities, values, rewards, ended = map(np.stack, zip(*rows, strict=True))
        next_values = np.asarray(evaluated(params["value"], jnp.asarray(self.seen))[:, 0])
        gains, gain = np.zeros_like(values), np.zeros_like(next_values)
        for step in reversed(range(options.steps)):
            surprise = rewards[step] + options.discount * next_values * ~ended[step] - values[step]
            gain = surprise + options.discount * options.gae_lambda * ~ended[step] * gain
            gains[step], next_values = gain, values[step]
        columns = (seen, masks, actions, log_probabilities, gains, gains + values)
        return Samples(*(jnp.asarray(column.reshape(-1, *column.shape[2:])) for column in columns))


def train(options: Options) -> Iterator[dict[str, Any]]:
    """Trains networks and evaluates the policy. Yields what is worth knowing after each update, and at the end."""
    games = Games(options, seed=options.seed)
    key, created = jax.random.split(jax.random.key(options.seed))
    params = create(created, games.seen.shape[1], games.masks.shape[1], options.width)
    state: Any = optimizer(options).init(params)
    per_update = options.games * options.steps
    updates = max(1, options.decisions // per_update)
    began = time.monotonic()
    for update in range(1, updates + 1):
        state[1].hyperparams["learning_rate"] = jnp.float32(options.learning_rate * (1 - (update - 1) / updates))
        key, playing, learning = jax.random.split(key, 3)
        params, state, losses = learn(params, state, learning, games.play(params, playing, options), options)
        speed = round(update * per_update / (time.monotonic() - began))
        parts = {name: float(value) for name, value in losses.items()}
        yield {"decisions": update * per_update, **summary(games.places[-1000:]), **parts, "decisions_per_second": speed}
    games.envs.close()
    games = Games(options, seed=options.seed + 1_000_000)
    while len(games.places) < options.evaluation:
        games.step(best(params, games.seen, games.masks))
    games.envs.close()
    yield {"event": "evaluated", **summary(games.places)}


def summary(places: Sequence[int]) -> dict[str, float]:
    """Returns the share of Shifts won (chance: 0.25), and the mean place (chance: 2.5)."""
    if not places:
        return {}
    return {"shifts": len(places), "won": round(float(np.mean(np.equal(places, 1))), 3), "place": round(float(np.mean(places)), 3)}


def main() -> None:
    """Command line. Prints a line of JSON for each tenth of the training, and one at the end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for field in fields(Options):
        parser.add_argument(f"--{field.name.replace('_', '-')}", type=type(field.default), default=field.default)
    options = Options(**vars(parser.parse_args()))
    shown = 0.0
    for line in train(options):
        if "event" in line or line["decisions"] >= shown:
            shown += options.decisions / 10
            print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
