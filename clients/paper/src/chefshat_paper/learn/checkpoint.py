"""Deep Q agents in files: a network that plays, and a training to resume.

A network file (see `network`) holds what an agent decides by. A training file (see `training_file`) holds, to the last bit, the
state that `deep_q.learn` continues from (networks, optimiser, memories, exploration and random keys of all agents) and the
training's settings. Games in progress are not in it: a resumed training starts new ones.
"""

import dataclasses
import itertools
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import jax
from chefshat import pb
from chefshat.learn import mlp, training_file
from chefshat.learn.mlp import Params
from chefshat.learn.network import Layer, Network
from chefshat.learn.training_file import network_info, opened
from chefshat.learn.training_log import Progress

from chefshat_paper.learn import deep_q
from chefshat_paper.learn.deep_q import Agents, DeepQConfig

FORMAT = "chefshat-deep-q-training-1"


@dataclass(frozen=True)
class Training:
    """Agents in training, and the settings of the training.

    Attributes:
        config: their hyper-parameters.
        agents: the stack.
        rules: the rule set, every field set.
        trained_by: the command, or the commands.
        opponents: the built-in agent of the other seats; empty: unknown.
        rewards: the reward scheme; empty: unknown.
        seed: the seed.
        shifts: Shifts played so far.
        progress: what else is counted. Files of earlier versions do not say, and so count from 0.
        evaluation_due: whether the file was written for an evaluation, which the log has if it succeeded.
    """

    config: DeepQConfig
    agents: Agents
    rules: pb.RuleSet
    trained_by: str
    opponents: str = ""
    rewards: str = ""
    seed: int = 0
    shifts: int = 0
    progress: Progress = field(default_factory=Progress)
    evaluation_due: bool = False

    def networks(self, name: str) -> list[Network]:
        """Returns the network of every agent, all with one name. Its outputs are those of `deep_q.outputs`, before the tanh."""
        # Tanh preserves order but rounds many values to the same 1 or -1, which would hide the best action.
        info = network_info(self.rules, name, self.trained_by, input="classic", output="turns", masked=self.config.mask)
        return [Network(_layers_of(self.config, self.agents.online, agent), info) for agent in range(len(self.agents.epsilon))]


def stacked(config: DeepQConfig, networks: Sequence[Network]) -> Params:
    """Converts networks to the parameters that `deep_q.start_from` takes. Raises ValueError for one of another kind of agent."""
    sizes = (config.inputs, *config.hidden, config.outputs)
    wanted = [(out, into) for into, out in itertools.pairwise(sizes)]
    for network in networks:
        info = network.info
        if (info.input, info.output) != ("classic", "turns"):
            raise ValueError(f"{info.name} has input {info.input} and output {info.output}: not a network of a Deep Q agent")
        found = [layer.weight.shape for layer in network.layers]
        if found != wanted:
            raise ValueError(f"the layers of {info.name} have the sizes {found}, not {wanted}")
    return mlp.stack([network.layers for network in networks])


def save(path: str | os.PathLike[str], training: Training) -> None:
    """Writes a training to a file atomically. Raises OSError if it cannot be written."""
    texts = {
        "config": json.dumps(dataclasses.asdict(training.config)),
        "trained_by": training.trained_by,
        "opponents": training.opponents,
        "rewards": training.rewards,
        "seed": str(training.seed),
        "shifts": str(training.shifts),
        "progress": json.dumps(dataclasses.asdict(training.progress)),
        "evaluation_due": json.dumps(training.evaluation_due),
    }
    training_file.save(path, FORMAT, training.agents, training.rules, texts)


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is not one, OSError if it cannot be read."""
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
            Progress(**json.loads(texts.get("progress", "{}"))),
            bool(json.loads(texts.get("evaluation_due", "false"))),
        )


def _layers_of(config: DeepQConfig, params: Params, agent: int) -> list[Layer]:
    layers = mlp.to_layers(jax.tree.map(lambda leaf: leaf[agent], params))
    if not config.see_mask:
        # Zero weights for what the agent does not see, so that players of the network need not know about it.
        layers[0].weight[:, config.inputs - config.outputs :] = 0.0
    return layers
