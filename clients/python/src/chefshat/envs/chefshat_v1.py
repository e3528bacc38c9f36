"""All seats of one game for PettingZoo (AEC: one agent decides at a time): `chefshat_v1.env()`.

One seat against built-in agents is in `gymnasium_env`. Seats decide in turn, so there is no parallel form.
"""

import copy
from typing import Any, ClassVar, Unpack, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chefshat.address import ServerAddress

try:
    from pettingzoo import AECEnv
    from pettingzoo.utils import wrappers
except ImportError as error:
    raise ImportError("chefshat_v1 needs PettingZoo: pip install 'chefshat[envs]'") from error

from chefshat.columns import Situations
from chefshat.envs.copying import NotCopied
from chefshat.envs.gymnasium_env import check_open, take, wait_for_a_row
from chefshat.envs.illegal import with_limit
from chefshat.envs.observing import Form, ObservationFunction, mask_space
from chefshat.envs.options import AllSeatsOptions, EnvOptions
from chefshat.envs.rendering import RENDER_MODES, as_text, can_render, check_render_mode
from chefshat.learn import features
from chefshat.vector import Batch, VectorEnv

__all__ = ["env", "raw_env"]


def env(address: str | ServerAddress | None = None, **options: Unpack[AllSeatsOptions]) -> "AECEnv[str, Any, Any]":
    """Creates the environment with PettingZoo's checks of the order of calls. Arguments: see `raw_env`, which checks actions."""
    return _InOrder(raw_env(address, **options))


class _InOrder(wrappers.OrderEnforcingWrapper):  # type: ignore[misc]  # PettingZoo has no types.
    """PettingZoo's checks of the order of calls. Asks the environment once for what an agent sees, not for each part of it."""

    def last(self, observe: bool = True) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        last = self.env.last if self._has_reset else super().last
        return cast(tuple[Any, float, bool, bool, dict[str, Any]], last(observe))

    def __str__(self) -> str:
        return str(self.env)


class raw_env(NotCopied, AECEnv[str, Any, Any]):  # type: ignore[misc]  # PettingZoo has no types.
    """The environment without checks. The agents are "player_0" to "player_{N-1}", by seat.

    An observation is a dictionary: "observation", of the form chosen, and "action_mask", A numbers of 0 or 1 (default 214), all 0
    unless the agent decides next. The observation of another agent is that of its last decision. `infos` have "kind" (a value of
    `pb.DecisionKind`), "invalid_attempts", and at the end "place", from 1.

    An illegal action is an invalid attempt: it gets the reward of the scheme less `invalid_penalty`, and the same agent decides
    again; after 10 of them (`max_invalid_attempts`) the default action is taken. An agent gets the
    rewards since its last decision at its next decision, or at the end of the episode. Then all agents are done; `reset()` starts
    the next Shift of the same game, or the next game if that is the episode. In the middle of an episode, with a seed, or with
    `options={"new_game": True}`, it starts a new game.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": list(RENDER_MODES),
        "name": "chefshat_v1",
        "is_parallelizable": False,
        "render_fps": 4,
    }

    def __init__(
        self,
        address: str | ServerAddress | None = None,
        *,
        observation: str | ObservationFunction = "table",
        rewards: str | None = "winning",
        invalid: str = "ask_again",
        invalid_penalty: float = 0.0,
        render_mode: str | None = None,
        **options: Unpack[EnvOptions],
    ) -> None:
        """Starts a game. For the arguments see `ChefsHatEnv`; this environment has all seats."""
        super().__init__()
        check_render_mode(render_mode)
        if "client_seats" in options or "games" in options:
            raise ValueError("this environment has one game and all seats; otherwise use chefshat.VectorEnv")
        self.render_mode = render_mode
        self.vector = VectorEnv(address, 1, rewards=rewards, **with_limit(invalid, options))
        self._invalid_penalty = invalid_penalty
        sizes = self.vector.sizes
        self.possible_agents = [f"player_{seat}" for seat in range(sizes.players)]
        self.agents: list[str] = []
        self._form = Form(observation, sizes, self.vector.batch)
        if sizes.has_all_hands:
            width = features.table_width(sizes.players, sizes.faces) + sizes.all_hands
            self.state_space = spaces.Box(0.0, 2.0, (width,), np.float32)
            self._state = np.zeros(width, np.float32)
            self._deck = np.array([*range(1, sizes.faces + 1), features.MAX_JOKERS], np.float32)
        seen = spaces.Dict({"observation": self._form.space, "action_mask": mask_space(sizes)})
        # Separate spaces, because each has its own seed.
        self._observation_spaces: dict[str, spaces.Space[Any]] = {agent: copy.deepcopy(seen) for agent in self.possible_agents}
        self._action_spaces: dict[str, spaces.Space[Any]] = {
            agent: spaces.Discrete(sizes.num_actions) for agent in self.possible_agents
        }
        self._nothing = self._form.of(Situations(1, sizes))
        self._no_mask = np.zeros(sizes.num_actions, np.int8)
        self._seen: dict[str, Any] = {}
        self._mask = self._no_mask
        self._stepped = False

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Returns the space of an agent's observations."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Returns the space of an agent's actions."""
        return self._action_spaces[agent]

    def observe(self, agent: str) -> dict[str, Any]:
        """Returns the observation at an agent's current or last decision; zeros before its first."""
        deciding = agent == self.agent_selection and not self.terminations.get(agent) and not self.truncations.get(agent)
        mask = (self._mask if deciding else self._no_mask).copy()
        seen = self._seen.get(agent)
        return {"observation": self._form.row(self._nothing, 0) if seen is None else seen, "action_mask": mask}

    def state(self) -> NDArray[np.float32]:
        """Returns what a centralised critic may see, with `all_hands=True`: more than any agent.

        It is the "table" observation of the agent that decides, then the hands of all agents from that one on, each count as a
        share of the deck's; at the end of an episode that of the last decision.
        """
        if not self.vector.sizes.has_all_hands:
            raise ValueError("the state has the hands of all agents: create the environment with all_hands=True")
        return self._state.copy()

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts the next episode. The last seed given determines the games. Options: `{"new_game": True}`."""
        check_open(self.vector)
        if seed is not None:
            self.vector.reset(seed)
        elif self._stepped or (options or {}).get("new_game"):
            self.vector.reset(games=[0])
        self._stepped = False
        self.agents = self.possible_agents.copy()
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos: dict[str, dict[str, Any]] = {agent: {} for agent in self.agents}
        self._skip_agent_selection = None
        self._seen = {}
        wait_for_a_row(self.vector)
        self._take_turn(self.vector.batch)

    def step(self, action: Any) -> None:  # noqa: ANN401 - As PettingZoo has it.
        """Takes the decision of `agent_selection`; None if that agent is done."""
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)
            return
        batch, penalty = take(self.vector, action, self._invalid_penalty)
        self._stepped = True
        self._cumulative_rewards[agent] = 0.0
        self._clear_rewards()
        if batch.ended:
            self._end(batch)
        else:
            reward = self._take_turn(batch)
            self.rewards[self.agent_selection] = reward
        self.rewards[agent] -= penalty
        self._accumulate_rewards()
        if self.render_mode == "human":
            self.render()

    def render(self) -> str | None:
        """Formats the situation of the deciding agent as text: returned with "ansi", printed with "human"."""
        if not can_render(self.render_mode):
            return None
        situations: Situations = self.vector.batch
        if self.agents and (any(self.terminations.values()) or any(self.truncations.values())):
            situations = self.vector.batch.endings
        text = as_text(situations, 0, self.vector.action_texts)
        if self.render_mode == "human":
            print(text)
            return None
        return text

    def close(self) -> None:
        """Ends the game."""
        self.vector.close()

    def _take_turn(self, batch: Batch) -> float:
        """Selects the deciding agent. Returns its rewards since its last decision."""
        observation, self._mask, reward, seat, kind, attempts = self._form.first(batch)
        agent = self.possible_agents[seat]
        self.agent_selection = agent
        if batch.sizes.has_all_hands:
            hands = batch.all_hands.reshape(-1, len(self._deck)) / self._deck
            seen = observation if self._form.is_table else features.table_of(batch)[0]
            self._state = np.concatenate([seen, np.roll(hands, -seat, axis=0).ravel()])
        self._seen[agent] = observation
        self.infos[agent] = {"kind": kind, "invalid_attempts": attempts}
        return reward

    def _end(self, batch: Batch) -> None:
        """Ends the episode for all agents."""
        self._stepped = False
        endings = batch.endings
        observed = self._form.of(endings)
        # There was no decision in further episodes that ended in the same step.
        for row, seat in enumerate(endings.seats[: self.vector.players].tolist()):
            agent = self.possible_agents[seat]
            self.rewards[agent] = float(endings.rewards[row])
            self.truncations[agent] = bool(endings.truncated[row])
            self.terminations[agent] = not self.truncations[agent]
            self.infos[agent] = {"kind": 0, "invalid_attempts": 0, "place": int(endings.places_taken[row])}
            self._seen[agent] = self._form.row(observed, row)
