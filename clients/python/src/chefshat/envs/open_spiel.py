"""The game as a Python game of OpenSpiel: importing this module registers "python_chefshat".

    game = pyspiel.load_game("python_chefshat", {"shifts": 1, "deals": 1000})
    small = pyspiel.load_game("python_chefshat", {"players": 3, "faces": 5, "jokers": 0})

The first move is chance: it chooses one of `deals` seeds, each of which determines the deals of the whole game. Everything else is
decisions of players, so histories, serialized states and clones work as in other games. A clone plays its history again when it is
used; for speed use `VectorEnv`.

A player's observation is that of its current or last decision, in the form "table"; zeros before its first.

Its information state has perfect recall: for each Shift its hand at its first decision, whether it had or received the Golden card,
and all actions that it may know (`chefshat.history`), until its current or last decision, or the end of the Shift. As text it is
complete. The tensor has tokens of the latest `history` actions of each Shift, by default 512; ordinary Shifts have some 100.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import pyspiel
except ImportError as error:
    raise ImportError("chefshat.envs.open_spiel needs OpenSpiel: pip install open_spiel") from error

from chefshat import history
from chefshat.batch import Batch
from chefshat.columns import Situations, Sizes
from chefshat.learn import features
from chefshat.vector import VectorEnv

NAME = "python_chefshat"
_PARAMETERS: dict[str, Any] = {"rules": "paper", "shifts": 1, "deals": 1000, "history": 512}
# Rules other than the preset's, and the value that stands for the preset's own: a parameter of OpenSpiel has one.
_RULES = {"players": 0, "faces": 0, "jokers": -1, "max_idle_pizzas": 0, "max_turns": 0}
_PARAMETERS |= _RULES
# Of the environment: more than the actions between two decisions of a player, so that none is missed.
_WIDTH = 1024
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
    provides_information_state_string=True,
    provides_information_state_tensor=True,
    provides_observation_string=True,
    provides_observation_tensor=True,
    parameter_specification=_PARAMETERS,
)


@dataclass(slots=True)
class _Shift:
    """What a player knows of a Shift.

    Attributes:
        hand: its hand at its first decision, F+1 counts.
        had_golden: whether the Golden card was in it.
        got_golden: whether the player has had the Golden card at any time.
        actions: numbers of the actions that it knows, as in the column `history`.
    """

    hand: NDArray[np.uint8]
    had_golden: bool
    got_golden: bool
    actions: NDArray[np.uint16]

    def text(self, sizes: Sizes, texts: Sequence[str]) -> str:
        """Returns all of it as text."""
        golden = "had" if self.had_golden else "received" if self.got_golden else "never had"
        actions = (
            f"{seat} {texts[action] if action < sizes.num_actions else 'give ?'}"
            for seat, action in zip(*history.parts_of(self.actions, sizes), strict=True)
        )
        return f"hand {' '.join(map(str, self.hand))}; {golden} the Golden card; {', '.join(actions)}"

    def tensor(self, player: int, sizes: Sizes, width: int) -> NDArray[np.float32]:
        """Returns the hand, the Golden card at first and ever, and the tokens of the latest `width` actions after padding."""
        latest = self.actions[-width:]
        tokens = history.tokens_of(*history.parts_of(latest, sizes), np.array(player, np.int32), sizes)
        padding = np.full(2 * (width - len(latest)), history.PADDING)
        return np.concatenate([self.hand, [self.had_golden, self.got_golden], padding, tokens.ravel()]).astype(np.float32)


class _Position:
    """A game after some decisions; plays them when it is first looked at. Copies share nothing."""

    def __init__(self, options: Mapping[str, Any], deal: int, actions: list[int]) -> None:
        self._options = options
        self._deal = deal
        self._actions = actions
        self._env: VectorEnv | None = None
        # The observation of each player at its last decision.
        self._seen: dict[int, NDArray[np.float32]] = {}
        # What each player knows of each Shift, by its number.
        self._known: dict[int, dict[int, _Shift]] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _Position, (self._options, self._deal, list(self._actions))

    def env(self) -> VectorEnv:
        """Returns the game, after the decisions."""
        if self._env is None:
            self._env = VectorEnv(seed=self._deal, total_games=1, history=_WIDTH, **self._options)
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

    def known(self, player: int) -> list[_Shift]:
        """Returns what a player knows of each Shift, up to its current or last decision."""
        self.env()
        return list(self._known.get(player, {}).values())

    def _advance(self) -> None:
        env = self._env
        assert env is not None, "the callers made it"
        self._look(env.batch)
        while len(env.batch) == 0 and not env.batch.done:
            self._look(env.step(np.zeros(0, np.uint16)))

    def _look(self, batch: Batch) -> None:
        # The end of a Shift comes before the first decision of the next.
        for situations in (batch.endings, batch):
            if situations is batch or batch.done:
                for player, row in zip(situations.seats.tolist(), features.table_of(situations), strict=True):
                    self._seen[player] = np.asarray(row, np.float32)
            for row, player in enumerate(situations.seats.tolist()):
                self._learn(self._known.setdefault(player, {}), situations, row)

    def _learn(self, known: dict[int, _Shift], situations: Situations, row: int) -> None:
        seen = situations.observations
        golden = bool(seen.golden[row])
        empty = np.zeros(0, np.uint16)
        shift = known.setdefault(int(seen.shifts[row]), _Shift(seen.hands[row], golden, golden, empty))
        shift.got_golden |= golden
        new = int(seen.history_counts[row]) - len(shift.actions)
        shift.actions = np.concatenate([shift.actions, seen.history[row, _WIDTH - new :]])


class ChefsHatGame(pyspiel.Game):  # type: ignore[misc]  # OpenSpiel has no types.
    """The game.

    Its parameters are `rules` (a preset), `shifts` (the number of Shifts), `deals`, `history`, and rules that differ from the
    preset's: `players` (2 to 6), `faces` (4 to 15), `jokers` (0 to 2), `max_idle_pizzas` and `max_turns`, as in `RuleSet`.

    Raises:
        ChefsHatError: RULE_SET_REFUSED: there is no such rule set.
    """

    def __init__(self, params: Mapping[str, Any] | None = None) -> None:
        given = {**_PARAMETERS, **(params or {})}
        rules = {name: given[name] for name, unset in _RULES.items() if given[name] != unset}
        self.options: dict[str, Any] = {
            "games": 1,
            "rules": {"preset": given["rules"], "target_shifts": given["shifts"], **rules},
        }
        self.deals, self.shifts, self.history = (int(given[name]) for name in ("deals", "shifts", "history"))
        with VectorEnv(seed=0, **self.options) as env:
            self.sizes = env.sizes
            points, turns, self.texts = list(env.rules.points), env.rules.max_turns, env.action_texts
        shifts = self.shifts
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
        return ChefsHatObserver(self, has_recall=iig_obs_type is not None and iig_obs_type.perfect_recall)


class ChefsHatState(pyspiel.State):  # type: ignore[misc]
    """A state of the game."""

    def __init__(self, game: ChefsHatGame) -> None:
        super().__init__(game)
        self._options, self._deals, self._texts = game.options, game.deals, game.texts
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
        return [float(points) for points in self.position.env().batch.endings.observations.points[-1]]

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
        return self._texts[action]

    def __str__(self) -> str:
        return " ".join(map(str, self.history()))


class ChefsHatObserver:
    """Observes states, as OpenSpiel's `Observation` expects.

    Attributes:
        tensor: the latest observation or information state.
        dict: the same, by name.
    """

    def __init__(self, game: ChefsHatGame, *, has_recall: bool) -> None:
        """Creates an observer: of information states if `has_recall`, else of observations."""
        self._game = game
        self._has_recall = has_recall
        sizes = game.sizes
        if has_recall:
            shape = (game.shifts, sizes.card_kinds + 2 + 2 * game.history)
            self.tensor: NDArray[np.float32] = np.zeros(sizes.players + shape[0] * shape[1], np.float32)
            self.dict = {
                "player": self.tensor[: sizes.players],
                "shifts": self.tensor[sizes.players :].reshape(shape),
            }
        else:
            self.tensor = np.zeros(features.table_width(sizes.players, sizes.faces), np.float32)
            self.dict = {"observation": self.tensor}

    def set_from(self, state: ChefsHatState, player: int) -> None:
        """Observes a state as a player."""
        self.tensor[:] = 0
        if self._has_recall:
            self.dict["player"][player] = 1
        if state.position is None:
            return
        if self._has_recall:
            for row, shift in zip(self.dict["shifts"], state.position.known(player), strict=False):
                row[:] = shift.tensor(player, self._game.sizes, self._game.history)
        else:
            self.tensor[:] = state.position.seen(player)

    def string_from(self, state: ChefsHatState, player: int) -> str:
        """Returns the observation or information state as text."""
        if self._has_recall:
            known = [] if state.position is None else state.position.known(player)
            return "\n".join([f"player {player}", *(shift.text(self._game.sizes, self._game.texts) for shift in known)])
        self.set_from(state, player)
        return " ".join(f"{number:g}" for number in self.tensor)


pyspiel.register_game(_TYPE, ChefsHatGame)
