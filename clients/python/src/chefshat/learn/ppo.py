"""Proximal policy optimisation with an action mask, as pure functions in JAX: the networks, acting, and one epoch of learning.

The policy network has an output for each action; illegal actions are masked out before sampling or comparing. The value network
is separate and estimates the seat's reward at the end of the Shift, from the policy's input or, since no player needs it in a game,
with the hands of the other seats. Games and samples are in `self_play`, the training loop is in `ppo_training`.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax

from chefshat.learn import mlp
from chefshat.learn.mlp import Mlp


class Params(NamedTuple):
    """The parameters of both networks."""

    policy: mlp.Params
    value: mlp.Params


class Rates(NamedTuple):
    """The learning rates of an epoch. The gradients' moments also follow those of a network whose rate is 0.

    Attributes:
        policy: of the policy network.
        value: of the value network.
    """

    policy: float | jax.Array
    value: float | jax.Array


class Learner(NamedTuple):
    """The state of a training, except for its games.

    Attributes:
        params: the networks.
        optimizer: the state of Adam.
        key: the random key.
    """

    params: Params
    optimizer: optax.OptState
    key: jax.Array


class Samples(NamedTuple):
    """Decisions to learn from, B rows.

    Attributes:
        inputs: (B, width) features; the last A of them are the mask.
        hidden: (B, H) the hands of the other seats, which only the value network sees; H is 0 if it does not.
        actions: (B,) the actions taken.
        log_probabilities: (B,) of these actions, when they were taken.
        advantages: (B,) estimated advantages.
        returns: (B,) targets of the value network.
        weights: (B,) 1 for rows that count, 0 for the others.
    """

    inputs: jax.Array
    hidden: jax.Array
    actions: jax.Array
    log_probabilities: jax.Array
    advantages: jax.Array
    returns: jax.Array
    weights: jax.Array


class Losses(NamedTuple):
    """Means over the rows of an epoch.

    Attributes:
        policy: the clipped surrogate loss.
        value: squared error of the value network.
        entropy: of the policy over legal actions, in nats.
        approx_kl: estimated Kullback-Leibler divergence between the acting and the learned policy.
        clipped: share of rows whose probability ratio left the clip range.
    """

    policy: jax.Array
    value: jax.Array
    entropy: jax.Array
    approx_kl: jax.Array
    clipped: jax.Array


@dataclass(frozen=True)
class Hyperparameters:
    """What is fixed for a training, and compiled in.

    Attributes:
        policy_widths: units of the policy network's hidden layers.
        value_widths: units of the value network's hidden layers.
        clip: clip range of the probability ratio.
        max_gradient_norm: gradients are clipped to this global norm.
        minibatches: number of parts an epoch's rows are split into; a divisor of their number.
        all_hands: whether the value network sees the hands of all seats, instead of the mask.
    """

    policy_widths: tuple[int, ...] = (256, 256)
    value_widths: tuple[int, ...] = (128, 128)
    clip: float = 0.2
    max_gradient_norm: float = 0.5
    minibatches: int = 16
    all_hands: bool = False


def _optimizer(hyper: Hyperparameters) -> optax.GradientTransformation:
    """Returns Adam with a learning rate of 1."""
    return optax.chain(optax.clip_by_global_norm(hyper.max_gradient_norm), optax.scale_by_adam(eps=1e-5), optax.scale(-1.0))


def start(seed: int, inputs: int, actions: int, hyper: Hyperparameters, hidden: int = 0) -> Learner:
    """Returns a new learner: orthogonal weights, with small ones in the policy's last layer for a near-uniform first policy.

    Args:
        seed: of the weights and of what follows.
        inputs: width of the features.
        actions: A.
        hyper: the widths, among others.
        hidden: numbers that describe the hands of the other seats; 0: the value network does not see them.
    """
    key, policy, value = jax.random.split(jax.random.key(seed), 3)

    def params(key: jax.Array, inputs: int, widths: tuple[int, ...], gain: float) -> mlp.Params:
        orthogonal = nn.initializers.orthogonal
        return Mlp(widths, orthogonal(2**0.5), orthogonal(gain)).start(key, inputs)

    seen = inputs - actions + hidden if hidden else inputs
    both = Params(params(policy, inputs, (*hyper.policy_widths, actions), 0.01), params(value, seen, (*hyper.value_widths, 1), 1.0))
    return Learner(both, _optimizer(hyper).init(both), key)


def _forward(params: mlp.Params, inputs: jax.Array) -> jax.Array:
    widths = tuple(params[f"Dense_{number}"]["bias"].shape[-1] for number in range(len(params)))
    return Mlp(widths).of(params, inputs)


def _logits(params: Params, inputs: jax.Array) -> jax.Array:
    """Returns the log-probabilities, (B, A); minus infinity for illegal actions."""
    outputs = _forward(params.policy, inputs)
    legal = inputs[:, -outputs.shape[1] :] > 0
    return jax.nn.log_softmax(jnp.where(legal, outputs, -jnp.inf))


@jax.jit
def act(params: Params, key: jax.Array, inputs: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Samples an action for each row.

    Args:
        params: the networks.
        key: random key of this call.
        inputs: (B, width) features, at least one legal action in each row.

    Returns:
        (B,) actions, (B,) their log-probabilities.
    """
    logits = _logits(params, inputs)
    actions = jax.random.categorical(key, logits)
    chosen = jnp.take_along_axis(logits, actions[:, None], axis=1)[:, 0]
    return actions, chosen


@jax.jit
def values(params: Params, inputs: jax.Array, hidden: jax.Array) -> jax.Array:
    """Returns the outputs of the value network, (B,); the arguments are those of `Samples`."""
    if hidden.shape[1]:
        actions = params.policy[f"Dense_{len(params.policy) - 1}"]["bias"].shape[-1]
        inputs = jnp.concatenate([inputs[:, :-actions], hidden], axis=1)
    return _forward(params.value, inputs)[:, 0]


def _loss(params: Params, samples: Samples, entropy_bonus: jax.Array, hyper: Hyperparameters) -> tuple[jax.Array, Losses]:
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
    value = mean(jnp.square(values(params, samples.inputs, samples.hidden) - samples.returns))
    losses = Losses(policy, value, entropy, mean(ratio - 1 - change), mean((jnp.abs(ratio - 1) > hyper.clip).astype(jnp.float32)))
    return policy + value - entropy_bonus * entropy, losses


@partial(jax.jit, static_argnames="hyper")
def learn(
    learner: Learner, samples: Samples, rates: Rates, entropy_bonus: jax.Array, hyper: Hyperparameters
) -> tuple[Learner, Losses]:
    """Runs one epoch over the samples, in minibatches drawn anew.

    Args:
        learner: the state after the last epoch.
        samples: B rows, a multiple of `hyper.minibatches`.
        rates: the learning rates of this epoch.
        entropy_bonus: weight of the entropy in the loss of this epoch.
        hyper: the ones the learner was started with.
    """
    key, shuffle = jax.random.split(learner.key)
    parts = jax.random.permutation(shuffle, len(samples.actions)).reshape(hyper.minibatches, -1)
    optimizer = _optimizer(hyper)

    def step(state: tuple[Params, optax.OptState], rows: jax.Array) -> tuple[tuple[Params, optax.OptState], Losses]:
        params, optimizer_state = state
        part = Samples(*(column[rows] for column in samples))
        gradients, losses = jax.grad(_loss, has_aux=True)(params, part, entropy_bonus, hyper)
        updates, optimizer_state = optimizer.update(gradients, optimizer_state, params)
        scaled = Params(*(optax.tree.scale(rate, part) for rate, part in zip(rates, updates, strict=True)))
        return (optax.apply_updates(params, scaled), optimizer_state), losses

    (params, optimizer_state), losses = jax.lax.scan(step, (learner.params, learner.optimizer), parts)
    return Learner(params, optimizer_state, key), Losses(*(values.mean() for values in losses))
