"""Deep Q agents in files: a network that plays, and a training that goes on where it was.

A network file (see `network`) holds what an agent decides by. A training file (see `training_file`) holds everything that
`deep_q.learn` goes on from, to the last bit: networks, optimiser, memories, exploration and chance of all agents; and what they are
trained by. The games that were being played are not in it: a training goes on with new ones.
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

from chefshat import pb
from chefshat.learn import deep_q, training_file
from chefshat.learn.deep_q import Agents, DeepQConfig, Layers
from chefshat.learn.network import Layer, Network
from chefshat.learn.training_file import network_info, opened

FORMAT = "chefshat-deep-q-training-1"


@dataclass(frozen=True)
class Training:
    """Agents in training, and what they are trained by.

    Attributes:
        config: their hyper-parameters.
        agents: the stack.
        rules: the rule set, every field set.
        trained_by: the command, or the commands.
        opponents: the built-in agent of the other seats; empty: not said.
        rewards: the scheme that turns are rewarded by; empty: not said.
        seed: where chance comes from.
        shifts: Shifts that were played so far.
    """

    config: DeepQConfig
    agents: Agents
    rules: pb.RuleSet
    trained_by: str
    opponents: str = ""
    rewards: str = ""
    seed: int = 0
    shifts: int = 0

    def networks(self, name: str) -> list[Network]:
        """The network of every agent, all under one name. Its outputs are those of `deep_q.outputs`, before the tanh."""
        # Tanh changes no order but rounds much to the same 1 or -1: a player would no longer see what is best.
        info = network_info(self.rules, name, self.trained_by, input="classic", output="turns", masked=self.config.mask)
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
    texts = {
        "config": json.dumps(dataclasses.asdict(training.config)),
        "trained_by": training.trained_by,
        "opponents": training.opponents,
        "rewards": training.rewards,
        "seed": str(training.seed),
        "shifts": str(training.shifts),
    }
    training_file.save(path, FORMAT, training.agents, training.rules, texts)


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is none, OSError if it cannot be read."""
    with opened(path, FORMAT) as contents:
        texts = contents.texts
        plain = json.loads(texts["config"])
        config = DeepQConfig(**{**plain, "hidden": tuple(plain["hidden"])})
        number = len(contents.tensor("epsilon"))
        if number == 0:
            raise ValueError("it holds no agents")
        return Training(
            config,
            contents.state(lambda: deep_q.start(config, range(number))),
            contents.rules,
            texts["trained_by"],
            texts["opponents"],
            texts["rewards"],
            int(texts["seed"]),
            int(texts["shifts"]),
        )


def _layers_of(config: DeepQConfig, layers: Layers, agent: int) -> list[Layer]:
    made = [Layer(_numpy(weight[agent]).T.copy(), _numpy(bias[agent])) for weight, bias in layers]
    if not config.see_mask:
        # What the agent does not see has no weight, so that whoever plays the network need not know of it.
        made[0].weight[:, config.inputs - config.outputs :] = 0.0
    return made


def _numpy(array: jax.Array) -> npt.NDArray[np.float32]:
    return np.array(array, np.float32)
