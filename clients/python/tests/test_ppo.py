"""PPO: legal samples, learning, and resuming from a file."""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_made import hand_made

from chefshat import pb
from chefshat.learn import features, network, ppo, ppo_checkpoint
from chefshat.learn.ppo import Hyperparameters, Rates, Samples
from chefshat.learn.ppo_checkpoint import Opponent, Plan
from chefshat.learn.training_file import TrainingFileError
from chefshat.learn.training_log import Progress

HYPER = Hyperparameters(policy_widths=(16,), value_widths=(16,), minibatches=4)
DATA = Path(__file__).parent / "data"
RULES = pb.RuleSet(players=4, faces=11, jokers=2)


def no_hands(count: int) -> jax.Array:
    """Returns the column of samples whose value network does not see the hands of others."""
    return jnp.zeros((count, 0))


def rows(count: int, seed: int) -> np.ndarray:
    case = hand_made(count, seed=seed)
    return features.table(case, case.seats, case.kinds, case.mask_bits, players=4, faces=11, hand_size=17)


def test_samples_are_legal_and_match_their_probabilities() -> None:
    learner = ppo.start(1, 334, 214, HYPER)
    # Larger weights than the initial ones, so that legal actions differ.
    params = jax.tree.map(lambda weights: weights * 30, learner.params)
    inputs = rows(64, seed=1)
    legal = inputs[:, -214:] > 0
    draws = 400
    drawn = jax.vmap(ppo.act, in_axes=(None, 0, None))(params, jax.random.split(jax.random.key(2), draws), inputs)
    actions, log_probabilities = (np.asarray(column) for column in drawn)
    assert np.take_along_axis(legal[np.newaxis], actions[:, :, np.newaxis], axis=2).all()
    assert (log_probabilities <= 1e-6).all()
    # The row with the most legal actions, and its first sample.
    row = int(np.argmax(legal.sum(axis=1)))
    likely = float(np.exp(log_probabilities[0, row]))
    seen = float((actions[:, row] == actions[0, row]).mean())
    assert abs(seen - likely) < 5 * (likely * (1 - likely) / draws) ** 0.5 + 1 / draws


def test_it_learns_which_action_pays() -> None:
    learner = ppo.start(1, 334, 214, HYPER)
    inputs = rows(256, seed=3)
    legal = inputs[:, -214:] > 0
    # The legal action with the lowest index has a positive reward, every other one a negative.
    best = legal.argmax(axis=1)

    def share(params: ppo.Params) -> float:
        actions, _ = ppo.act(params, jax.random.key(9), inputs)
        return float((np.asarray(actions) == best).mean())

    before = share(learner.params)
    for number in range(60):
        actions, log_probabilities = ppo.act(learner.params, jax.random.key(100 + number), inputs)
        paid = np.where(np.asarray(actions) == best, 1.0, -1.0).astype(np.float32)
        weights = np.ones(256, np.float32)
        samples = Samples(
            jnp.asarray(inputs),
            no_hands(256),
            actions,
            log_probabilities,
            jnp.asarray(paid),
            jnp.asarray(paid),
            jnp.asarray(weights),
        )
        learner, losses = ppo.learn(learner, samples, Rates(3e-3, 3e-3), jnp.float32(0.0), HYPER)
        assert all(np.isfinite(float(value)) for value in losses)
    assert share(learner.params) > max(0.8, before + 0.2)


def test_rows_without_weight_are_ignored() -> None:
    learner = ppo.start(1, 334, 214, HYPER)
    inputs = jnp.asarray(rows(32, seed=4))
    actions, log_probabilities = ppo.act(learner.params, jax.random.key(1), inputs)
    gains = jnp.linspace(-1, 1, 32)
    nothing = Samples(inputs, no_hands(len(inputs)), actions, log_probabilities, gains, gains, jnp.zeros(32))
    # Adam's epsilon prevents a division by zero: the networks do not change.
    after, losses = ppo.learn(learner, nothing, Rates(1.0, 1.0), jnp.float32(1.0), HYPER)
    for old, new in zip(jax.tree.leaves(learner.params), jax.tree.leaves(after.params), strict=True):
        np.testing.assert_array_equal(old, new)
    assert float(losses.value) == 0


def test_the_value_network_may_see_other_hands_and_learn_alone() -> None:
    hyper = dataclasses.replace(HYPER, all_hands=True)
    learner = ppo.start(1, 334, 214, hyper, hidden=36)
    inputs = jnp.asarray(rows(32, seed=4))
    hidden = jax.random.uniform(jax.random.key(2), (32, 36))
    values = ppo.values(learner.params, inputs, hidden)
    assert (values != ppo.values(learner.params, inputs, hidden[::-1])).any()
    # It does not see the mask, which follows from the rest.
    np.testing.assert_array_equal(values, ppo.values(learner.params, inputs.at[:, -214:].set(1), hidden))

    actions, log_probabilities = ppo.act(learner.params, jax.random.key(1), inputs)
    gains = jnp.linspace(-1, 1, 32)
    samples = Samples(inputs, hidden, actions, log_probabilities, gains, gains, jnp.ones(32))
    after, losses = ppo.learn(learner, samples, Rates(0.0, 1e-2), jnp.float32(0.01), hyper)
    jax.tree.map(np.testing.assert_array_equal, after.params.policy, learner.params.policy)
    again = jnp.square(ppo.values(after.params, inputs, hidden) - gains).mean()
    assert float(again) < float(jnp.square(values - gains).mean())
    assert np.isfinite(float(losses.policy))


def test_a_training_resumes_exactly_from_a_file(tmp_path: Path) -> None:
    plan = Plan(games=8, steps=16, hyper=HYPER)
    training = ppo_checkpoint.begin(plan, 7, RULES, "a command")
    inputs = jnp.asarray(rows(32, seed=4))
    actions, log_probabilities = ppo.act(training.learner.params, jax.random.key(1), inputs)
    gains = jnp.linspace(-1, 1, 32)
    samples = Samples(inputs, no_hands(len(inputs)), actions, log_probabilities, gains, gains, jnp.ones(32))

    def learned(learner: ppo.Learner) -> ppo.Learner:
        after, _ = ppo.learn(learner, samples, Rates(1e-3, 1e-3), jnp.float32(0.01), HYPER)
        return ppo.Learner(*after)

    training = ppo_checkpoint.Training(plan, 7, RULES, learned(training.learner), Progress(1, 128, 0.5, 1), "a command")
    ppo_checkpoint.save(tmp_path / "t", training)
    read = ppo_checkpoint.load(tmp_path / "t")
    assert (read.plan, read.seed, read.rules, read.progress, read.trained_by) == (plan, 7, RULES, training.progress, "a command")
    on, on_read = learned(training.learner), learned(read.learner)
    np.testing.assert_array_equal(jax.random.key_data(on.key), jax.random.key_data(on_read.key))
    for one, other in zip(jax.tree.leaves(on[:2]), jax.tree.leaves(on_read[:2]), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_training_of_an_older_version_continues(tmp_path: Path) -> None:
    """The files were written before the networks were modules of flax: a training, and its network one epoch later."""
    old = ppo_checkpoint.load(DATA / "ppo-1.training")
    assert (old.plan.gae_lambda, old.plan.hyper.policy_widths, old.progress.decisions) == (0.9, (4, 4), 128)
    assert old.plan.opponents == (Opponent("greedy"),)
    case = hand_made(16, seed=4, players=2, faces=4, jokers=2)
    size = features.dealt(2, 4, 2)
    inputs = jnp.asarray(features.table(case, case.seats, case.kinds, case.mask_bits, players=2, faces=4, hand_size=size))
    actions, log_probabilities = ppo.act(old.learner.params, jax.random.key(1), inputs)
    gains = jnp.linspace(-1, 1, 16)
    samples = Samples(inputs, no_hands(len(inputs)), actions, log_probabilities, gains, gains, jnp.ones(16))
    learner, _ = ppo.learn(old.learner, samples, Rates(1e-2, 1e-2), jnp.float32(0.01), old.plan.hyper)
    learned = dataclasses.replace(old, learner=ppo.Learner(*learner))
    for now, then in zip(learned.network("now").layers, network.load(DATA / "ppo-1.safetensors").layers, strict=True):
        np.testing.assert_allclose(now.weight, then.weight, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(now.bias, then.bias, rtol=1e-5, atol=1e-6)
    ppo_checkpoint.save(tmp_path / "t", learned)
    again = ppo_checkpoint.load(tmp_path / "t")
    jax.tree.map(np.testing.assert_array_equal, again.learner.params, learned.learner.params)


def test_a_plan_keeps_the_digests_of_its_opponents(tmp_path: Path) -> None:
    file = tmp_path / "one, two.safetensors"
    file.write_bytes(b"weights")
    plan = Plan(opponent_games=8, opponents=(Opponent(str(file)), Opponent("greedy"))).checked()
    assert [len(opponent.sha256) for opponent in plan.opponents] == [64, 0]
    restored = Plan.of(json.loads(json.dumps(dataclasses.asdict(plan))))
    assert restored == plan == restored.checked()
    file.write_bytes(b"others")
    with pytest.raises(ValueError, match="is not the network that this training played against so far"):
        restored.checked()
    file.unlink()
    with pytest.raises(FileNotFoundError, match="there is no file"):
        restored.checked()


def test_plans_of_older_versions_name_their_opponents_in_one_text() -> None:
    plain = {**dataclasses.asdict(Plan()), "opponents": "past.safetensors,trained,greedy"}
    assert Plan.of(plain).opponents == (Opponent("past.safetensors"), Opponent("trained"), Opponent("greedy"))


def test_a_plan_cannot_show_hands_of_opponents() -> None:
    with pytest.raises(ValueError, match="hands of opponents are not shown"):
        Plan(opponent_games=1, hyper=Hyperparameters(all_hands=True))


def test_other_files_are_refused_with_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "t"
    path.write_bytes(b"cards")
    with pytest.raises(TrainingFileError, match="is not a training"):
        ppo_checkpoint.load(path)
    with pytest.raises(FileNotFoundError):
        ppo_checkpoint.load(tmp_path / "nothing")


def test_the_network_is_the_policy() -> None:
    training = ppo_checkpoint.begin(Plan(hyper=HYPER), 7, RULES, "a command")
    policy = training.network("a name")
    case = hand_made(20, seed=5)
    inputs = policy.inputs(case, case.seats, case.kinds, case.mask_bits)
    chosen = policy.actions(case, case.seats, case.kinds, case.mask_bits)
    logits = np.asarray(ppo._logits(training.learner.params, jnp.asarray(inputs)))
    np.testing.assert_array_equal(chosen, logits.argmax(axis=1))
    assert policy.info.trained_by == "a command"
