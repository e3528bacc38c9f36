"""Many games for the algorithms of Stable-Baselines3 and sb3-contrib, as their `VecEnv`.

One game needs no adapter: `ChefsHatEnv` is a `gymnasium.Env` with `action_masks()`.
"""

from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium
import numpy as np

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError(
        "chefshat.envs.stable_baselines needs Stable-Baselines3: pip install stable-baselines3 sb3-contrib"
    ) from error

from chefshat.envs.copying import NotCopied
from chefshat.envs.gymnasium_vector import ChefsHatVectorEnv
from chefshat.envs.options import OneSeatOptions


class ChefsHatVecEnv(NotCopied, VecEnv):  # type: ignore[misc]  # It may not be installed.
    """A `ChefsHatVectorEnv` for Stable-Baselines3, stepped in one call. `MaskablePPO` of sb3-contrib finds its masks.

    The info of a game whose episode has ended has `terminal_observation`, `TimeLimit.truncated`, `place`, and `episode`, the
    totals that the algorithms log.
    """

    def __init__(self, num_envs: int, **options: Unpack[OneSeatOptions]) -> None:
        """Starts the games.

        `options` are the arguments of `ChefsHatVectorEnv`, without `autoreset_mode`: algorithms expect the first observation of the
        next episode in the step that ends one. Raises ValueError for that argument.
        """
        if "autoreset_mode" in options:
            raise ValueError("autoreset_mode: games of Stable-Baselines3 begin their next episode in the step that ends one")
        self.games = ChefsHatVectorEnv(num_envs=num_envs, **options)
        self._actions = np.zeros(num_envs, np.int64)
        self._seed: int | None = None
        self._returns = np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, np.int64)
        # Asked for by the constructor.
        self.render_mode = None
        super().__init__(num_envs, self.games.single_observation_space, self.games.single_action_space)

    def reset(self) -> Any:  # noqa: ANN401 - Observations of the space.
        """Starts new games and returns their first observations."""
        observed, infos = self.games.reset(seed=self._seed)
        self.reset_infos = self._split(infos)
        self._seed = None
        self._returns[:], self._lengths[:] = 0, 0
        return observed

    def step_async(self, actions: Any) -> None:  # noqa: ANN401 - n integers.
        """Notes the actions of the next step."""
        self._actions = np.asarray(actions)

    def step_wait(self) -> Any:  # noqa: ANN401 - As Stable-Baselines3 has it.
        """Steps the games. Returns observations, rewards, whether episodes have ended, and infos."""
        observed, rewards, terminated, truncated, infos = self.games.step(self._actions)
        ended = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        each = self._split(infos)
        for game in np.flatnonzero(ended):
            each[game]["terminal_observation"] = infos["final_obs"][game]
            each[game]["TimeLimit.truncated"] = bool(truncated[game])
            each[game]["place"] = int(infos["final_info"]["place"][game])
            each[game]["episode"] = {"r": float(self._returns[game]), "l": int(self._lengths[game])}
        self._returns[ended], self._lengths[ended] = 0, 0
        return observed, rewards.astype(np.float32), ended, each

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Sets the base seed of the games after the next reset."""
        self._seed = seed
        return [seed] * self.num_envs

    def close(self) -> None:
        """Ends the games."""
        self.games.close()

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Any = None) -> list[bool]:  # noqa: ANN401
        """Returns false for each game: wrappers wrap all of them."""
        return [False] * len(self._chosen(indices))

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ANN401
        """Returns an attribute of the games, once for each."""
        return [getattr(self.games, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ANN401
        """Sets an attribute of all games."""
        setattr(self.games, attr_name, value)

    def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **options: Any) -> list[Any]:  # noqa: ANN401
        """Calls `action_masks`, the one method that games have each."""
        if method_name != "action_masks":
            raise AttributeError(f"games that are stepped together have no method {method_name!r} each; `games` has those of all")
        masks = self.games.action_masks()
        return [masks[game] for game in self._chosen(indices)]

    def _chosen(self, indices: Any) -> list[int]:  # noqa: ANN401
        chosen = np.arange(self.num_envs) if indices is None else np.atleast_1d(indices)
        return [int(game) for game in chosen]

    def _split(self, infos: dict[str, Any]) -> list[dict[str, Any]]:
        """Returns the info of each game."""
        masks, kinds, attempts = infos["action_mask"], infos["kind"], infos["invalid_attempts"]
        return [
            {"action_mask": masks[game], "kind": int(kinds[game]), "invalid_attempts": int(attempts[game])}
            for game in range(self.num_envs)
        ]
