"""Masked PPO in one file with PyTorch, in the manner of CleanRL: one seat learns against built-in agents, in many games at once.

    pip install '.[envs]' ./native torch
    python samples/learning/ppo_torch.py
    python samples/learning/ppo_torch.py --opponents greedy --decisions 3000000 --tensorboard runs/greedy

Every part of the algorithm is here: change what you want to study. At the end the policy plays new games, without exploring.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical


@dataclass
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
    """Parts of a pass."""
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
    tensorboard: str = ""
    """Folder for TensorBoard; needs the package tensorboard."""


class Agent(nn.Module):  # type: ignore[misc]
    """A policy and a value, two networks."""

    def __init__(self, inputs: int, actions: int, width: int) -> None:
        super().__init__()
        self.policy = network(inputs, width, actions, gain=0.01)
        self.value = network(inputs, width, 1, gain=1.0)

    def distribution(self, seen: torch.Tensor, masks: torch.Tensor) -> Categorical:
        """Returns the distribution over the legal actions."""
        return Categorical(logits=self.policy(seen).masked_fill(~masks, -1e8))


def network(inputs: int, width: int, outputs: int, gain: float) -> nn.Sequential:
    """Creates a network with two hidden layers and orthogonal weights."""
    layers = [nn.Linear(inputs, width), nn.Linear(width, width), nn.Linear(width, outputs)]
    for layer, scale in zip(layers, (2**0.5, 2**0.5, gain), strict=True):
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


@dataclass
class Rollout:
    """What the games brought since the last update: tensors of steps times games."""

    seen: torch.Tensor
    masks: torch.Tensor
    actions: torch.Tensor
    log_probabilities: torch.Tensor
    values: torch.Tensor
    rewards: torch.Tensor
    ended: torch.Tensor


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
        seen, infos = self.envs.reset(seed=seed)
        self._now(seen, infos)
        # The places of the episodes that have ended.
        self.places: list[int] = []

    def _now(self, seen: Any, infos: dict[str, Any]) -> None:  # noqa: ANN401 - An array.
        self.seen = torch.as_tensor(seen, dtype=torch.float32)
        self.masks = torch.as_tensor(infos["action_mask"] == 1)

    def step(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Takes an action in each game. Returns rewards, and where episodes ended; the next ones have begun."""
        seen, rewards, terminated, truncated, infos = self.envs.step(actions.numpy())
        ended = terminated | truncated
        if ended.any():
            self.places.extend(infos["final_info"]["place"][ended].tolist())
        self._now(seen, infos)
        return torch.as_tensor(rewards, dtype=torch.float32), torch.as_tensor(ended, dtype=torch.float32)

    @torch.no_grad()  # type: ignore[untyped-decorator]
    def play(self, agent: Agent, steps: int) -> Rollout:
        """Plays some steps by the policy."""
        columns: list[list[torch.Tensor]] = [[] for _ in fields(Rollout)]
        for _ in range(steps):
            seen, masks = self.seen, self.masks
            distribution = agent.distribution(seen, masks)
            actions = distribution.sample()
            values = agent.value(seen).squeeze(1)
            rewards, ended = self.step(actions)
            row = (seen, masks, actions, distribution.log_prob(actions), values, rewards, ended)
            for column, part in zip(columns, row, strict=True):
                column.append(part)
        return Rollout(*(torch.stack(column) for column in columns))


def advantages(rollout: Rollout, next_values: torch.Tensor, options: Options) -> torch.Tensor:
    """Returns the generalised advantage estimates."""
    found = torch.zeros_like(rollout.rewards)
    gain = torch.zeros_like(next_values)
    for step in reversed(range(len(found))):
        going_on = 1 - rollout.ended[step]
        surprise = rollout.rewards[step] + options.discount * next_values * going_on - rollout.values[step]
        gain = surprise + options.discount * options.gae_lambda * going_on * gain
        found[step], next_values = gain, rollout.values[step]
    return found


def learn(
    agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout, gains: torch.Tensor, options: Options
) -> dict[str, float]:
    """Learns from a rollout. Returns the losses of the last minibatch."""
    seen, masks, actions = rollout.seen.flatten(0, 1), rollout.masks.flatten(0, 1), rollout.actions.flatten()
    before, returns, gains = rollout.log_probabilities.flatten(), (gains + rollout.values).flatten(), gains.flatten()
    for _ in range(options.epochs):
        for rows in torch.randperm(len(actions)).chunk(options.minibatches):
            distribution = agent.distribution(seen[rows], masks[rows])
            ratio = (distribution.log_prob(actions[rows]) - before[rows]).exp()
            gain = (gains[rows] - gains[rows].mean()) / (gains[rows].std() + 1e-8)
            policy_loss = -torch.min(gain * ratio, gain * ratio.clamp(1 - options.clip, 1 + options.clip)).mean()
            value_loss = (agent.value(seen[rows]).squeeze(1) - returns[rows]).square().mean() / 2
            entropy = distribution.entropy().mean()
            loss = policy_loss + options.value_weight * value_loss - options.entropy_bonus * entropy
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), options.max_gradient)
            optimizer.step()
    return {"policy_loss": policy_loss.item(), "value_loss": value_loss.item(), "entropy": entropy.item()}


@torch.no_grad()  # type: ignore[untyped-decorator]
def evaluate(agent: Agent, options: Options) -> list[int]:
    """Returns the places of the policy in new games, where it takes the most probable action."""
    games = Games(options, seed=options.seed + 1_000_000)
    while len(games.places) < options.evaluation:
        games.step(agent.policy(games.seen).masked_fill(~games.masks, -1e8).argmax(dim=1))
    games.envs.close()
    return games.places


def train(options: Options) -> Iterator[dict[str, Any]]:
    """Trains an agent and evaluates it. Yields what is worth knowing after each update, and at the end."""
    torch.manual_seed(options.seed)
    # Such small networks are slower with more.
    torch.set_num_threads(1)
    games = Games(options, seed=options.seed)
    agent = Agent(games.seen.shape[1], games.masks.shape[1], options.width)
    optimizer = torch.optim.Adam(agent.parameters(), lr=options.learning_rate, eps=1e-5)
    per_update = options.games * options.steps
    updates = max(1, options.decisions // per_update)
    began = time.monotonic()
    for update in range(1, updates + 1):
        optimizer.param_groups[0]["lr"] = options.learning_rate * (1 - (update - 1) / updates)
        rollout = games.play(agent, options.steps)
        with torch.no_grad():
            next_values = agent.value(games.seen).squeeze(1)
        losses = learn(agent, optimizer, rollout, advantages(rollout, next_values, options), options)
        recent = games.places[-1000:]
        speed = update * per_update / (time.monotonic() - began)
        yield {"decisions": update * per_update, **summary(recent), **losses, "decisions_per_second": round(speed)}
    games.envs.close()
    yield {"event": "evaluated", **summary(evaluate(agent, options))}


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
    writer = None
    if options.tensorboard:
        from torch.utils.tensorboard import SummaryWriter

        writer = SummaryWriter(options.tensorboard)
    shown = 0.0
    for line in train(options):
        decisions = line.get("decisions", options.decisions)
        if writer is not None:
            for name, value in line.items():
                if not isinstance(value, str):
                    writer.add_scalar(name, value, decisions)
        if "event" in line or decisions >= shown:
            shown += options.decisions / 10
            print(json.dumps(line), flush=True)
    if writer is not None:
        writer.close()


if __name__ == "__main__":
    main()
