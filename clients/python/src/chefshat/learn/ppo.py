"""Proximal policy optimisation with a mask, as pure functions in JAX: the networks, how they act, and one epoch of learning.

The policy network gives a number for each action, of which illegal ones are taken out before anything is drawn or compared; the
value network, apart from it, guesses what the Shift will bring the seat. Games, and what is to be learned from them, are in
`self_play`; the training as a whole is in `ppo_training`.
"""

import itertools
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import optax

# One layer: weight (out, in), bias (out,).
Layers: TypeAlias = list[tuple[jax.Array, jax.Array]]


class Params(NamedTuple):
    """Both networks."""

    policy: Layers
    value: Layers


class Learner(NamedTuple):
    """All that a training goes on from, but for its games.

    Attributes:
        params: the networks.
        optimizer: the state of Adam.
        key: where chance comes from.
    """

    params: Params
    optimizer: optax.OptState
    key: jax.Array


class Samples(NamedTuple):
    """Decisions to learn from, B rows.

    Attributes:
        inputs: (B, width) features; the last A of them are the mask.
        actions: (B,) what was decided.
        log_probabilities: (B,) of that, when it was decided.
        advantages: (B,) how much better than expected it went.
        returns: (B,) what the value network should have said.
        weights: (B,) 1 for rows that count, 0 for the others.
    """

    inputs: jax.Array
    actions: jax.Array
    log_probabilities: jax.Array
    advantages: jax.Array
    returns: jax.Array
    weights: jax.Array


class Losses(NamedTuple):
    """Means over the rows of an epoch.

    Attributes:
        policy: loss of the policy, as it was minimised.
        value: squared error of the value network.
        entropy: of the policy over legal actions, in nats.
        divergence: estimated Kullback-Leibler divergence of the policy that decided and the one learned.
        clipped: share of rows whose probability had changed by more than the clip range.
    """

    policy: jax.Array
    value: jax.Array
    entropy: jax.Array
    divergence: jax.Array
    clipped: jax.Array


@dataclass(frozen=True)
class Hyper:
    """What is fixed for a training, and compiled in.

    Attributes:
        policy_widths: hidden units of the policy network, layer by layer.
        value_widths: hidden units of the value network.
        clip: how far the ratio of probabilities may move before it counts no more.
        max_gradient_norm: gradients are scaled down to it.
        minibatches: into how many parts an epoch's rows are split; a divisor of their number.
    """

    policy_widths: tuple[int, ...] = (256, 256)
    value_widths: tuple[int, ...] = (128, 128)
    clip: float = 0.2
    max_gradient_norm: float = 0.5
    minibatches: int = 16


def _optimizer(hyper: Hyper) -> optax.GradientTransformation:
    # The learning rate changes as the training goes on, so it is multiplied in by `learn`.
    return optax.chain(optax.clip_by_global_norm(hyper.max_gradient_norm), optax.scale_by_adam(eps=1e-5))


def start(seed: int, inputs: int, actions: int, hyper: Hyper) -> Learner:
    """A learner that knows nothing: orthogonal weights, small ones last, so that at first all legal actions are about alike."""
    key, policy, value = jax.random.split(jax.random.key(seed), 3)

    def layers(key: jax.Array, widths: tuple[int, ...], last: float) -> Layers:
        gains = [2**0.5] * (len(widths) - 2) + [last]
        keys = jax.random.split(key, len(gains))
        shapes = [(outputs, inputs) for inputs, outputs in itertools.pairwise(widths)]
        made = zip(gains, keys, shapes, strict=True)
        return [(jax.nn.initializers.orthogonal(gain)(key, shape), jnp.zeros(shape[0])) for gain, key, shape in made]

    params = Params(
        layers(policy, (inputs, *hyper.policy_widths, actions), 0.01), layers(value, (inputs, *hyper.value_widths, 1), 1.0)
    )
    return Learner(params, _optimizer(hyper).init(params), key)


def _forward(layers: Layers, inputs: jax.Array) -> jax.Array:
    values = inputs
    for weight, bias in layers[:-1]:
        values = jax.nn.relu(values @ weight.T + bias)
    weight, bias = layers[-1]
    return values @ weight.T + bias


def _logits(params: Params, inputs: jax.Array) -> jax.Array:
    """(B, A): log-probabilities; of illegal actions minus infinity."""
    outputs = _forward(params.policy, inputs)
    legal = inputs[:, -outputs.shape[1] :] > 0
    return jax.nn.log_softmax(jnp.where(legal, outputs, -jnp.inf))


@jax.jit
def act(params: Params, key: jax.Array, inputs: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Draws an action for each row.

    Args:
        params: the networks.
        key: chance of this call.
        inputs: (B, width) features, at least one legal action in each row.

    Returns:
        (B,) actions, (B,) their log-probabilities, (B,) values.
    """
    logits = _logits(params, inputs)
    actions = jax.random.categorical(key, logits)
    chosen = jnp.take_along_axis(logits, actions[:, None], axis=1)[:, 0]
    return actions, chosen, _forward(params.value, inputs)[:, 0]


def _loss(params: Params, samples: Samples, entropy_bonus: jax.Array, hyper: Hyper) -> tuple[jax.Array, Losses]:
    rows = jnp.maximum(samples.weights.sum(), 1)

    def mean(values: jax.Array) -> jax.Array:
        return (values * samples.weights).sum() / rows

    logits = _logits(params, samples.inputs)
    change = jnp.take_along_axis(logits, samples.actions[:, None], axis=1)[:, 0] - samples.log_probabilities
    ratio = jnp.exp(change)
    bounded = jnp.clip(ratio, 1 - hyper.clip, 1 + hyper.clip)
    policy = -mean(jnp.minimum(ratio * samples.advantages, bounded * samples.advantages))
    # Where the probability is 0 its logarithm is not finite; the product counts as 0, and so must its gradient.
    finite = jnp.where(logits > -jnp.inf, logits, 0)
    entropy = mean(-(jnp.exp(logits) * finite).sum(axis=1))
    value = mean(jnp.square(_forward(params.value, samples.inputs)[:, 0] - samples.returns))
    losses = Losses(policy, value, entropy, mean(ratio - 1 - change), mean((jnp.abs(ratio - 1) > hyper.clip).astype(jnp.float32)))
    return policy + value - entropy_bonus * entropy, losses


@partial(jax.jit, static_argnames="hyper")
def learn(
    learner: Learner, samples: Samples, learning_rate: jax.Array, entropy_bonus: jax.Array, hyper: Hyper
) -> tuple[Learner, Losses]:
    """One epoch: every row is looked at once, in parts drawn anew.

    Args:
        learner: as the last epoch left it.
        samples: B rows, a multiple of `hyper.minibatches`.
        learning_rate: of this epoch.
        entropy_bonus: how much a nat of entropy is worth in this epoch.
        hyper: as the learner was started with.
    """
    key, shuffle = jax.random.split(learner.key)
    parts = jax.random.permutation(shuffle, len(samples.actions)).reshape(hyper.minibatches, -1)

    def step(state: tuple[Params, optax.OptState], rows: jax.Array) -> tuple[tuple[Params, optax.OptState], Losses]:
        params, optimizer = state
        part = Samples(*(column[rows] for column in samples))
        gradients, losses = jax.grad(_loss, has_aux=True)(params, part, entropy_bonus, hyper)
        updates, optimizer = _optimizer(hyper).update(gradients, optimizer, params)
        return (jax.tree.map(lambda old, update: old - learning_rate * update, params, updates), optimizer), losses

    (params, optimizer), losses = jax.lax.scan(step, (learner.params, learner.optimizer), parts)
    return Learner(params, optimizer, key), Losses(*(values.mean() for values in losses))
