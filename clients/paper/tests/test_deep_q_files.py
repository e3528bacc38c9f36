"""Deep Q agents in files: a training resumes to the last bit, and a network decides like its agent."""

import dataclasses
from pathlib import Path

import jax
import numpy as np
import pytest
import safetensors.numpy
from chefshat import pb
from chefshat.learn import network
from chefshat.learn.training_file import TrainingFileError
from test_deep_q import ids, same, transitions

from chefshat_paper.learn import checkpoint, deep_q
from chefshat_paper.learn.checkpoint import Training
from chefshat_paper.learn.deep_q import DeepQConfig

RULES = pb.RuleSet(preset="paper", players=4, faces=11, jokers=2, target_shifts=250)
DATA = Path(__file__).parent / "data"
SMALL = DeepQConfig(hidden=(16, 8), batch_size=4, memory_size=16, target_every=3)


@pytest.fixture(scope="module")
def training() -> Training:
    """Two agents after some updates."""
    agents = deep_q.start(SMALL, [1, 2])
    for number in range(20):
        agents = deep_q.learn(SMALL, agents, ids(0, 1), transitions(SMALL, 2, number))
    return Training(SMALL, agents, RULES, "a command", "greedy", "validity", 3, 17)


def test_a_training_resumes_exactly(training: Training, tmp_path: Path) -> None:
    checkpoint.save(tmp_path / "t.training", training)
    read = checkpoint.load(tmp_path / "t.training")
    for name in ("config", "rules", "trained_by", "opponents", "rewards", "seed", "shifts"):
        assert getattr(read, name) == getattr(training, name), name
    assert same(read.agents, training.agents)
    # Learning consumes agents; those of the fixture are needed again.
    one, other = checkpoint.load(tmp_path / "t.training").agents, read.agents
    for number in range(5):
        batch = transitions(SMALL, 2, 100 + number)
        one, other = (deep_q.learn(SMALL, agents, ids(0, 1), batch) for agents in (one, other))
        keys, actions = deep_q.act(SMALL, one, ids(0, 1), batch.states, batch.next_masks, ids(0, 0))
        keys_other, actions_other = deep_q.act(SMALL, other, ids(0, 1), batch.states, batch.next_masks, ids(0, 0))
        assert actions.tolist() == actions_other.tolist()
        one, other = one._replace(keys=keys), other._replace(keys=keys_other)
    assert same(one, other)
    assert not same(one, training.agents)
    assert [path.name for path in tmp_path.iterdir()] == ["t.training"]


def test_a_network_decides_as_the_agent_does(training: Training, tmp_path: Path) -> None:
    batch = transitions(SMALL, 2, 0)
    expected = deep_q.outputs(SMALL, jax.tree.map(lambda leaf: leaf[1], training.agents.online), batch.states)
    net = training.networks("second")[1]
    network.save(tmp_path / "n.safetensors", net.layers, net.info)
    read = network.load(tmp_path / "n.safetensors")
    np.testing.assert_allclose(read.outputs(np.asarray(batch.states)), expected, rtol=1e-5, atol=1e-6)
    assert (read.info.input, read.info.output, read.info.masked, read.info.name) == ("classic", "turns", False, "second")
    assert '"targetShifts": 250' in read.info.rules


def test_training_can_start_with_networks_from_files(training: Training) -> None:
    params = checkpoint.stacked(SMALL, training.networks("both"))
    jax.tree.map(np.testing.assert_array_equal, params, training.agents.online)
    with pytest.raises(ValueError, match="have the sizes"):
        checkpoint.stacked(DeepQConfig(), training.networks("both"))
    other = dataclasses.replace(training.networks("both")[0].info, input="table")
    layer = network.Layer(np.zeros((200, other.input_width), np.float32), np.zeros(200, np.float32))
    with pytest.raises(ValueError, match="not a network of a Deep Q agent"):
        checkpoint.stacked(SMALL, [network.Network([layer], other)])


def test_a_training_of_an_older_version_continues(tmp_path: Path) -> None:
    """The files were written before the networks were modules of flax: a training, and a network of it one update later."""
    old = checkpoint.load(DATA / "deep-q-1.training")
    assert (old.config.hidden, old.opponents, old.seed, old.shifts) == ((4, 3), "greedy", 3, 17)
    agents = deep_q.learn(old.config, old.agents, ids(0, 1), transitions(old.config, 2, 5))
    learned = dataclasses.replace(old, agents=agents).networks("now")[1]
    for now, then in zip(learned.layers, network.load(DATA / "deep-q-1.safetensors").layers, strict=True):
        np.testing.assert_allclose(now.weight, then.weight, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(now.bias, then.bias, rtol=1e-5, atol=1e-6)


def test_hidden_inputs_have_zero_weights() -> None:
    config = dataclasses.replace(SMALL, see_mask=False)
    (net,) = Training(config, deep_q.start(config, [1]), RULES, "").networks("blind")
    assert not net.layers[0].weight[:, 28:].any()
    assert net.layers[0].weight[:, :28].all()


def test_files_of_other_formats_are_refused(training: Training, tmp_path: Path) -> None:
    path = tmp_path / "t.training"
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(TrainingFileError, match=r"t\.training is not a training"):
        checkpoint.load(path)
    net = training.networks("n")[0]
    network.save(path, net.layers, net.info)
    with pytest.raises(TrainingFileError, match="its format is 'chefshat-network-1'"):
        checkpoint.load(path)
    checkpoint.save(path, training)
    tensors = safetensors.numpy.load_file(path)
    with safetensors.safe_open(path, framework="np") as file:
        metadata = file.metadata()
    for broken, message in (
        ({name: tensor for name, tensor in tensors.items() if name != "updates"}, "updates"),
        ({**tensors, "updates": tensors["updates"][:1]}, r"its updates is int32\[1\], not int32\[2\]"),
    ):
        path.write_bytes(safetensors.numpy.save(broken, metadata=metadata))
        with pytest.raises(TrainingFileError, match=message):
            checkpoint.load(path)
    with pytest.raises(FileNotFoundError):
        checkpoint.load(tmp_path / "missing")
