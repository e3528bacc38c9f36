"""One seat of many games at once as a `gymnasium.vector.VectorEnv`, stepped together. One game is in `gymnasium_env`."""

from collections.abc import Sequence
from typing import Any, ClassVar, Unpack

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from chefshat.address import ServerAddress
from chefshat.columns import Endings
from chefshat.envs.copying import NotCopied
from chefshat.envs.gymnasium_env import check_open
from chefshat.envs.illegal import penalties, with_limit
from chefshat.envs.observing import Form, ObservationFunction, Observed
from chefshat.envs.options import EnvOptions
from chefshat.vector import Batch, VectorEnv


class ChefsHatVectorEnv(NotCopied, gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Many games stepped together; the agent has the same seat in all of them, the others are built-in agents of the server.

    Observations, actions, rewards and episodes are those of `ChefsHatEnv`, one row per game. When an episode ends, the next one
    starts in the same step (`AutoresetMode.SAME_STEP`): the observation returned is the first of the next episode; the last one of
    the old is in `infos["final_obs"]`, an array of objects, None where no episode has ended, and its info in
    `infos["final_info"]`. `infos["action_mask"]` is an array of n rows of A numbers, 0 or 1. As in Gymnasium, `infos["_key"]` marks
    the valid rows of `infos["key"]`.

    With `autoreset_mode="next_step"` (`AutoresetMode.NEXT_STEP`) the step that ends an episode returns its last observation, and
    `infos["place"]`; the game then pauses: the next step ignores its action, whose mask has all actions, and returns the first
    observation of the next episode. Gymnasium's wrappers that change observations, such as `NormalizeObservation`, require this
    mode. The forms "classic" and "table" are normalised.

    In the rare case that a game's other seats have so many decisions that some are left for the next step, its row stays unchanged,
    and its next action is ignored.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": [],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        address: str | ServerAddress | None = None,
        num_envs: int = 1,
        *,
        seat: int = 0,
        observation: str | ObservationFunction = "table",
        rewards: str | None = "winning",
        invalid: str = "ask_again",
        invalid_penalty: float = 0.0,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        **options: Unpack[EnvOptions],
    ) -> None:
        """Starts the games.

        Args:
            num_envs: n, the number of games.
            address: see `ChefsHatEnv`, as for `seat`, `observation`, `rewards` and `invalid`.
            seat: the seat of the agent.
            observation: the form of observations.
            rewards: the scheme.
            invalid: effect of an illegal action.
            invalid_penalty: subtracted from the reward of an illegal action.
            render_mode: only None: there is no rendering.
            autoreset_mode: when a game begins its next episode: in the step that ends one ("same_step"), or in the next step.
            options: further arguments of `VectorEnv`, except for `total_games`: new games follow without limit.
        """
        if render_mode is not None:
            raise ValueError("many games cannot be rendered: leave render_mode out, or use ChefsHatEnv")
        if {"client_seats", "games", "total_games"} & options.keys():
            raise ValueError("give seat= and num_envs= instead of client_seats, games and total_games, or use chefshat.VectorEnv")
        modes = {AutoresetMode.SAME_STEP: "same_step", AutoresetMode.NEXT_STEP: "next_step"}
        if autoreset_mode not in modes and autoreset_mode not in modes.values():
            raise ValueError(f'autoreset_mode={autoreset_mode!r}: choose "same_step" or "next_step"')
        self._pauses = autoreset_mode in (AutoresetMode.NEXT_STEP, "next_step")
        mode = AutoresetMode.NEXT_STEP if self._pauses else AutoresetMode.SAME_STEP
        self.metadata = {**type(self).metadata, "autoreset_mode": mode}  # type: ignore[misc]  # As Gymnasium's own do.
        self.num_envs = num_envs
        self.vector = VectorEnv(address, num_envs, client_seats=[seat], rewards=rewards, **with_limit(invalid, options))
        self._invalid_penalty = invalid_penalty
        sizes = self.vector.sizes
        self.single_action_space = spaces.Discrete(sizes.num_actions)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._form = Form(observation, sizes, self.vector.batch)
        self.single_observation_space = self._form.space_with_mask
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        # The last observation of each game, for games without a row in a batch.
        self._seen: Observed | None = None
        self._masks = np.zeros((num_envs, sizes.num_actions), np.int8)
        # The games that pause for a step, because an episode has ended.
        self._paused = np.zeros(num_envs, np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Starts new games.

        Args:
            seed: the base seed of all games; None: the next games of the last base seed.
            options: `{"reset_mask": mask}`: resets only the games where the (n,) booleans are true.
        """
        if seed is not None and not isinstance(seed, (int, np.integer)):
            raise TypeError("one seed determines all games: give a number")
        check_open(self.vector)
        super().reset(seed=seed)
        chosen = None if options is None else options.get("reset_mask")
        if chosen is None:
            self._paused = np.zeros(self.num_envs, np.bool_)
        if chosen is not None:
            mask = np.asarray(chosen)
            if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or seed is not None:
                raise ValueError(f"a reset_mask is an array of {self.num_envs} booleans, and excludes a seed")
            batch = self.vector.reset(games=np.flatnonzero(mask))
            self._paused = self._paused & ~mask
        else:
            batch = self.vector.reset(seed)
        return self._observe(batch), self._infos(batch)

    def step(self, actions: Any) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:  # noqa: ANN401
        """Takes the open decision of each game; `actions` are n integers."""
        check_open(self.vector)
        if self._seen is None:
            raise gymnasium.error.ResetNeeded("there is no running episode: call reset()")
        chosen = np.asarray(actions)
        waiting = self.vector.batch
        if len(waiting) < self.num_envs and chosen.shape == (self.num_envs,):
            chosen = chosen[waiting.games]
        rows, cost = waiting.games, penalties(waiting, chosen, self._invalid_penalty)
        paused = self._paused
        if paused.any():
            left = paused[rows]
            cost = np.where(left, 0.0, cost)
            batch = self.vector.step(chosen, leave_open=left)
        else:
            batch = self.vector.step(chosen)
        rewards = np.zeros(self.num_envs, np.float64)
        rewards[batch.games] = batch.rewards
        terminations = np.zeros(self.num_envs, np.bool_)
        truncations = np.zeros(self.num_envs, np.bool_)
        observed, infos = self._observe(batch), self._infos(batch)
        if len(batch.endings):
            endings = batch.endings.first_of_each_game()
            rewards[endings.games] = endings.rewards
            terminations[endings.games] = ~endings.truncated
            truncations[endings.games] = endings.truncated
            if self._pauses:
                observed = self._last(observed, infos, endings)
            else:
                self._add_endings(infos, endings)
        rewards[rows] -= cost
        if self._pauses:
            # The rewards of the rows that have waited were those of the first step.
            rewards[paused] = 0
            self._paused = terminations | truncations
        return observed, rewards, terminations, truncations, infos

    def action_masks(self) -> NDArray[np.bool_]:
        """Returns whether each of the A actions is legal now, one row per game."""
        return self._masks.astype(np.bool_)

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401 - As Gymnasium has it.
        """Ends the games."""
        self.vector.close()

    def _observe(self, batch: Batch) -> Any:  # noqa: ANN401 - Of the space's kind.
        """Returns the observations of all games; the last one for games without a row in the batch."""
        observed = self._form.of(batch)
        masks = batch.masks.view(np.int8)
        if len(batch) < self.num_envs:
            masks = _put(self._masks, batch.games, masks)
            if isinstance(observed, dict):
                before = self._seen if isinstance(self._seen, dict) else {}
                observed = {name: _put(before.get(name), batch.games, array, self.num_envs) for name, array in observed.items()}
            else:
                before_ = self._seen if isinstance(self._seen, np.ndarray) else None
                observed = _put(before_, batch.games, observed, self.num_envs)
        self._seen, self._masks = observed, masks
        if isinstance(observed, dict):
            return {**observed, "action_mask": masks}
        return observed

    def _infos(self, batch: Batch) -> dict[str, Any]:
        everywhere = np.ones(self.num_envs, np.bool_)
        infos: dict[str, Any] = {"action_mask": self._masks, "_action_mask": everywhere}
        for name, column in (("kind", batch.kinds), ("invalid_attempts", batch.attempts)):
            infos[name] = np.zeros(self.num_envs, np.int64)
            infos[name][batch.games] = column
            infos[f"_{name}"] = everywhere
        return infos

    def _last(self, observed: Any, infos: dict[str, Any], endings: Endings) -> Any:  # noqa: ANN401 - Of the space's kind.
        """Puts the last observations of the episodes that have ended in place of the first ones of the next, which come again."""
        ended, last = endings.games, self._form.of(endings)
        # The mask of an action that is ignored.
        self._masks = masks = self._masks.copy()
        masks[ended] = 1
        places = np.zeros(self.num_envs, np.int64)
        places[ended] = endings.places_taken
        infos["action_mask"] = masks
        infos["place"], infos["_place"] = places, np.isin(np.arange(self.num_envs), ended)
        if isinstance(last, dict):
            return {**{name: _put(observed[name], ended, last[name]) for name in last}, "action_mask": masks}
        return _put(observed, ended, last)

    def _add_endings(self, infos: dict[str, Any], endings: Endings) -> None:
        """Adds the final observations."""
        ended = np.zeros(self.num_envs, np.bool_)
        ended[endings.games] = True
        observed = self._form.of(endings)
        last = np.full(self.num_envs, None, object)
        nothing = np.zeros(self.vector.num_actions, np.int8)
        for row, game in enumerate(endings.games.tolist()):
            one = self._form.row(observed, row)
            last[game] = {**one, "action_mask": nothing} if self._form.has_parts else one
        places = np.zeros(self.num_envs, np.int64)
        places[endings.games] = endings.places_taken
        infos["final_obs"], infos["_final_obs"] = last, ended
        infos["final_info"], infos["_final_info"] = {"place": places, "_place": ended}, ended


def _put(before: NDArray[Any] | None, games: NDArray[np.uint32], rows: NDArray[Any], count: int = 0) -> NDArray[Any]:
    """Puts rows into a copy of the old array, or into zeros."""
    array = np.zeros((count, *rows.shape[1:]), rows.dtype) if before is None else before.copy()
    array[games] = rows
    return array
