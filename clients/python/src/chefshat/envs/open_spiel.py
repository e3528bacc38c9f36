"""The game as a Python game of OpenSpiel: importing this module registers "python_chefshat".

    game = pyspiel.load_game("python_chefshat", {"shifts": 1, "deals": 1000})

The first move is chance: it chooses one of `deals` seeds, each of which determines the deals of the whole game. Everything else is
decisions of players, so histories, serialized states and clones work as in other games. A clone plays its history again when it is
used; for speed use `VectorEnv`.

A player's observation is that of its current or last decision, in the form "table"; zeros before its first.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import pyspiel
except ImportError as error:
    raise ImportError("chefshat.envs.open_spiel needs OpenSpiel: pip install open_spiel") from error

from chefshat.columns import Situations
from chefshat.learn import features
from chefshat.vector import VectorEnv

NAME = "python_chefshat"
_PARAMETERS: dict[str, Any] = {"rules": "paper", "shifts": 1, "deals": 1000}
_TYPE = pyspiel.GameType(
    short_name=NAME,
    long_name="Chef's Hat",
    dynamics=pyspiel.GameType.Dynamics.SEQUENTIAL,
    chance_mode=pyspiel.GameType.ChanceMode.EXPLICIT_STOCHASTIC,
    information=pyspiel.GameType.Information.IMPERFECT_INFORMATION,
    utility=pyspiel.GameType.Utility.CONSTANT_SUM,
    reward_model=pyspiel.GameType.RewardModel.TERMINAL,
    max_num_players=6,
    min_num_players=2,
    provides_information_state_string=False,
    provides_information_state_tensor=False,
    provides_observation_string=True,
    provides_observation_tensor=True,
    parameter_specification=_PARAMETERS,
)


class _Position:
    """A game after some decisions; plays them when it is first looked at. Copies share nothing."""

    def __init__(self, options: Mapping[str, Any], deal: int, actions: list[int]) -> None:
        self._options = options
        self._deal = deal
        self._actions = actions
        self._env: VectorEnv | None = None
        # The observation of each player at its last decision.
        self._seen: dict[int, NDArray[np.float32]] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _Position, (self._options, self._deal, list(self._actions))

    def env(self) -> VectorEnv:
        """Returns the game, after the decisions."""
        if self._env is None:
            self._env = VectorEnv(seed=self._deal, total_games=1, **self._options)
            self._advance()
            for action in self._actions:
                self._env.step([action])
                self._advance()
        return self._env

    def take(self, action: int) -> None:
        """Takes a decision."""
        self.env().step([action])
        self._advance()
        self._actions.append(action)

    def seen(self, player: int) -> NDArray[np.float32]:
        """Returns the observation of a player at its current or last decision."""
        sizes = self.env().sizes
        return self._seen.get(player, np.zeros(features.table_width(sizes.players, sizes.faces), np.float32))

    def _advance(self) -> None:
        env = self._env
        assert env is not None, "the callers made it"
        while len(env.batch) == 0 and not env.batch.done:
            env.step(np.zeros(0, np.uint16))
        situations: Situations = env.batch if len(env.batch) else env.batch.endings
        for player, row in zip(situations.seats.tolist(), features.table_of(situations), strict=True):
            self._seen[player] = np.asarray(row, np.float32)


class ChefsHatGame(pyspiel.Game):  # type: ignore[misc]  # OpenSpiel has no types.
    """The game, with the parameters `rules` (a preset), `shifts` (the number of Shifts) and `deals`."""

    def __init__(self, params: Mapping[str, Any] | None = None) -> None:
        given = {**_PARAMETERS, **(params or {})}
        self.options: dict[str, Any] = {
            "games": 1,
            "episode": "game",
            "rules": {"preset": given["rules"], "target_shifts": given["shifts"]},
        }
        self.deals = int(given["deals"])
        with VectorEnv(seed=0, **self.options) as env:
            self.sizes = env.sizes
            points, turns = list(env.rules.points), env.rules.max_turns
        shifts = int(given["shifts"])
        info = pyspiel.GameInfo(
            num_distinct_actions=self.sizes.num_actions,
            max_chance_outcomes=self.deals,
            num_players=self.sizes.players,
            min_utility=float(shifts * min(points)),
            max_utility=float(shifts * max(points)),
            utility_sum=float(shifts * sum(points)),
            # Besides turns: the cards given, a special action of each, and the deal.
            max_game_length=shifts * (turns + 4 * self.sizes.players),
        )
        super().__init__(_TYPE, info, dict(params or {}))

    def new_initial_state(self) -> "ChefsHatState":
        """Returns the state before the deal."""
        return ChefsHatState(self)

    def make_py_observer(self, iig_obs_type: Any = None, params: Any = None) -> "ChefsHatObserver":  # noqa: ANN401
        """Returns what observes states."""
        if iig_obs_type is not None and iig_obs_type.perfect_recall:
            raise ValueError("observations have no perfect recall: use IIGObservationType(perfect_recall=False)")
        return ChefsHatObserver(self)


class ChefsHatState(pyspiel.State):  # type: ignore[misc]
    """A state of the game."""

    def __init__(self, game: ChefsHatGame) -> None:
        super().__init__(game)
        self._options, self._deals = game.options, game.deals
        self.position: _Position | None = None

    def current_player(self) -> int:
        """Returns the player who decides."""
        if self.position is None:
            return int(pyspiel.PlayerId.CHANCE)
        batch = self.position.env().batch
        return int(pyspiel.PlayerId.TERMINAL) if len(batch) == 0 else int(batch.seats[0])

    def is_terminal(self) -> bool:
        """Returns whether the game is over."""
        return self.position is not None and len(self.position.env().batch) == 0

    def chance_outcomes(self) -> list[tuple[int, float]]:
        """Returns the deals, which are equally probable."""
        return [(deal, 1 / self._deals) for deal in range(self._deals)]

    def returns(self) -> list[float]:
        """Returns the points of each player; zeros before the end."""
        if not self.is_terminal() or self.position is None:
            return [0.0] * self.num_players()
        return [float(points) for points in self.position.env().batch.endings.observations.points[0]]

    def _legal_actions(self, player: int) -> list[int]:
        assert self.position is not None, "a player decides after the deal"
        return [int(action) for action in np.flatnonzero(self.position.env().batch.masks[0])]

    def _apply_action(self, action: int) -> None:
        if self.position is None:
            self.position = _Position(self._options, action, [])
        else:
            self.position.take(action)

    def _action_to_string(self, player: int, action: int) -> str:
        if player == pyspiel.PlayerId.CHANCE or self.position is None:
            return f"deal {action}"
        return self.position.env().action_texts[action]

    def __str__(self) -> str:
        return " ".join(map(str, self.history()))


class ChefsHatObserver:
    """Observes states, as OpenSpiel's `Observation` expects.

    Attributes:
        tensor: the latest observation.
        dict: the same, by name.
    """

    def __init__(self, game: ChefsHatGame) -> None:
        width = features.table_width(game.sizes.players, game.sizes.faces)
        self.tensor: NDArray[np.float32] = np.zeros(width, np.float32)
        self.dict = {"observation": self.tensor}

    def set_from(self, state: ChefsHatState, player: int) -> None:
        """Observes a state as a player."""
        self.tensor[:] = 0 if state.position is None else state.position.seen(player)

    def string_from(self, state: ChefsHatState, player: int) -> str:
        """Returns the observation as text."""
        self.set_from(state, player)
        return " ".join(f"{number:g}" for number in self.tensor)


pyspiel.register_game(_TYPE, ChefsHatGame)
