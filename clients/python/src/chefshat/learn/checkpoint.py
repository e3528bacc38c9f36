"""Deep Q agents in files: a network that plays, and a training that goes on where it was.

A network file (see `network`) holds what an agent decides by. A training file holds everything that `deep_q.learn` goes on from,
to the last bit: networks, optimiser, memories, exploration and chance of all agents; and the rule set. The games that were being
played are not in it: a training goes on with new ones.
"""

import dataclasses
import itertools
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
import safetensors
import safetensors.numpy
from google.protobuf import json_format

from chefshat import pb
from chefshat.files import write_whole
from chefshat.learn import deep_q
from chefshat.learn.deep_q import Agents, DeepQConfig, Layers
from chefshat.learn.network import Layer, Network, NetworkInfo

FORMAT = "chefshat-deep-q-training-1"


class TrainingFileError(ValueError):
    """A file is not a training of this format. The message names the file and what is wrong with it."""


@dataclass(frozen=True)
class Training:
    """Agents in training, and what they are trained by.

    Attributes:
        config: their hyper-parameters.
        agents: the stack.
        rules: the rule set, every field set.
        trained_by: the command.
    """

    config: DeepQConfig
    agents: Agents
    rules: pb.RuleSet
    trained_by: str

    def networks(self, name: str) -> list[Network]:
        """The network of every agent, all under one name. Its outputs are those of `deep_q.outputs`, before the tanh."""
        info = NetworkInfo(
            input="classic",
            output="turns",
            # Without tanh, which changes no order but rounds much to the same 1 or -1: a player would no longer see what is best.
            output_activation="none",
            masked=self.config.mask,
            players=self.rules.players,
            faces=self.rules.faces,
            jokers=self.rules.jokers,
            rules=json_format.MessageToJson(self.rules, indent=None),
            name=name,
            trained_by=self.trained_by,
        )
        return [Network(_layers_of(self.config, self.agents.online, agent), info) for agent in range(len(self.agents.epsilon))]


def stacked(config: DeepQConfig, networks: Sequence[Network]) -> Layers:
    """The layers of networks as `deep_q.start_from` takes them. Raises ValueError if one is none of such an agent's."""
    sizes = (config.inputs, *config.hidden, config.outputs)
    wanted = [(out, into) for into, out in itertools.pairwise(sizes)]
    for network in networks:
        info = network.info
        if (info.input, info.output) != ("classic", "turns"):
            raise ValueError(f"{info.name} sees {info.input} and says {info.output}: not a network of a Deep Q agent")
        found = [layer.weight.shape for layer in network.layers]
        if found != wanted:
            raise ValueError(f"the layers of {info.name} have the sizes {found}, not {wanted}")
    return tuple(
        (
            jnp.stack([jnp.asarray(network.layers[number].weight.T) for network in networks]),
            jnp.stack([jnp.asarray(network.layers[number].bias) for network in networks]),
        )
        for number in range(len(wanted))
    )


def save(path: str | os.PathLike[str], training: Training) -> None:
    """Writes a training to a file, whole or not at all. Raises OSError if it cannot be written."""
    metadata = {
        "format": FORMAT,
        "config": json.dumps(dataclasses.asdict(training.config)),
        "rules": json_format.MessageToJson(training.rules, indent=None),
        "trained_by": training.trained_by,
    }
    tensors = {name: np.asarray(leaf) for name, leaf in _named(_plain(training.agents))}
    write_whole(path, safetensors.numpy.save(tensors, metadata=metadata))


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is none, OSError if it cannot be read."""
    with open(path, "rb"):
        pass  # What cannot be read is an OSError in its own words, not safetensors'.
    try:
        with safetensors.safe_open(path, framework="np") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") != FORMAT:
                raise ValueError(f"its format is {metadata.get('format')!r}, not {FORMAT!r}")
            config_plain = json.loads(metadata["config"])
            config = DeepQConfig(**{**config_plain, "hidden": tuple(config_plain["hidden"])})
            rules = json_format.Parse(metadata["rules"], pb.RuleSet())
            number = len(file.get_tensor("epsilon"))
            if number == 0:
                raise ValueError("it holds no agents")
            # What the arrays must look like, without making them.
            template = jax.eval_shape(lambda: _plain(deep_q.start(config, range(number))))
            leaves = []
            for name, leaf in _named(template):
                tensor = file.get_tensor(name)
                if (tensor.shape, tensor.dtype) != (leaf.shape, leaf.dtype):
                    raise ValueError(f"its {name} is {tensor.dtype}{list(tensor.shape)}, not {leaf.dtype}{list(leaf.shape)}")
                leaves.append(jnp.asarray(tensor))
        agents: Agents = jax.tree.unflatten(jax.tree.structure(template), leaves)
        agents = agents._replace(keys=jax.random.wrap_key_data(agents.keys))
        return Training(config, agents, rules, metadata.get("trained_by", ""))
    except KeyError as missing:
        raise TrainingFileError(f"{os.fspath(path)} is no training: it has no {missing}") from missing
    except (ValueError, TypeError, safetensors.SafetensorError, json_format.ParseError) as error:
        raise TrainingFileError(f"{os.fspath(path)} is no training: {error}") from error


def _plain(agents: Agents) -> Agents:
    """With the keys as plain numbers, which a file can hold."""
    return agents._replace(keys=jax.random.key_data(agents.keys))


def _named(agents: Agents) -> list[tuple[str, jax.Array]]:
    """The arrays with their names, such as "online.0.1"."""
    return [
        (jax.tree_util.keystr(path, simple=True, separator="."), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(agents)
    ]


def _layers_of(config: DeepQConfig, layers: Layers, agent: int) -> list[Layer]:
    made = [Layer(_numpy(weight[agent]).T.copy(), _numpy(bias[agent])) for weight, bias in layers]
    if not config.see_mask:
        # What the agent does not see has no weight, so that whoever plays the network need not know of it.
        made[0].weight[:, config.inputs - config.outputs :] = 0.0
    return made


def _numpy(array: jax.Array) -> npt.NDArray[np.float32]:
    return np.array(array, np.float32)
