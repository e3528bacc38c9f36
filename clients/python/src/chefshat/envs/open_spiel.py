"""The game as a Python game of OpenSpiel: importing this module registers "python_chefshat".

    game = pyspiel.load_game("python_chefshat", {"shifts": 1, "deals": 1000})
    rules = {"players": 2, "faces": 4, "jokers": 0, "max_idle_pizzas": 1, "max_turns": 6}
    small = pyspiel.load_game("python_chefshat", {"deals": 0, **rules})

The first move is chance: it chooses one of `deals` seeds, each of which determines the deals of the whole game; or, with `deals` 0
and one Shift of a small deck, one of all deals, each as likely as it is. Everything else is decisions of players, so histories,
serialized states and clones work as in other games. A clone takes the same time after any number of moves. `VectorEnv` is faster.

`resample_from_infostate` draws from all deals that agree with what the player who decides knows, each equally likely, with
`chefshat.search`: search by sampled deals, such as OpenSpiel's IS-MCTS in Python, needs nothing else.

A player's observation is that of its current or last decision, in the form "table"; zeros before its first.

Its information state has perfect recall: for each Shift its hand at its first decision, whether it had or received the Golden card,
and all actions that it may know (`chefshat.history`), until its current or last decision, or the end of the Shift. As text it is
complete. The tensor has tokens of the latest `history` actions of each Shift, by default 512; ordinary Shifts have some 100.
"""

import itertools
import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

try:
    import pyspiel
except ImportError as error:
    raise ImportError("chefshat.envs.open_spiel needs OpenSpiel: pip install open_spiel") from error

from chefshat import history, pb, search
from chefshat.batch import Batch
from chefshat.columns import Situations, Sizes
from chefshat.learn import features
from chefshat.vector import VectorEnv

_T = TypeVar("_T")

NAME = "python_chefshat"
_PARAMETERS: dict[str, Any] = {"rules": "paper", "shifts": 1, "deals": 1000, "history": 512}
# Rules other than the preset's, and the value that stands for the preset's own: a parameter of OpenSpiel has one.
_RULES = {"players": 0, "faces": 0, "jokers": -1, "max_idle_pizzas": 0, "max_turns": 0}
_PARAMETERS |= _RULES
# The most deals of a game that has all of them.
_MAX_DEALS = 10_000
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class _Position:
    """A game at a decision, or after its end.

    Attributes:
        state: the game, as an environment saves it; nothing after the end.
        player: who decides; `TERMINAL` after the end.
        legal: the legal actions, ascending.
        points: those of each player; zeros before the end.
        seen: what each player saw at its last decision of each Shift, by its number: a table, and its row.
        known: what each player knows of each Shift, by its number.
        searched: here, the possible deals of the player who decides, once counted.
    """

    state: bytes
    player: int
    legal: list[int]
    points: list[float]
    seen: dict[int, dict[int, tuple[Situations, int]]]
    known: dict[int, dict[int, _Shift]]
    searched: list[search.Position] = field(default_factory=list)

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Position":
        """Returns itself: nothing changes it."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _Position, (self.state, self.player, self.legal, self.points, self.seen, self.known)

    def possible(self) -> search.Position:
        """Returns the possible deals of the player who decides."""
        if not self.searched:
            self.searched.append(search.position(self.state))
        return self.searched[0]


class _Games(threading.local):
    """The environment in which a thread takes the decisions of all positions: each is restored before its decision.

    Attributes:
        options: of the environment.
        sizes: of its columns.
    """

    def __init__(self, options: Mapping[str, Any], sizes: Sizes) -> None:
        self.options, self.sizes = options, sizes
        self._env: VectorEnv | None = None
        # Where the environment stands.
        self._state = b""

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Games":
        """Returns itself: clones share it."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _Games, (self.options, self.sizes)

    def begun(self, **start: Any) -> _Position:  # noqa: ANN401 # Options of a VectorEnv.
        """Returns the first decision of a game that begins in this way."""
        env = VectorEnv(total_games=1, history=_WIDTH, **start, **self.options)
        return self._found(env, _Position(b"", 0, [], [], {}, {}))

    def after(self, position: _Position, action: int) -> _Position:
        """Returns the position after a decision.

        Raises:
            ValueError: the action is not legal.
        """
        if action not in position.legal:
            raise ValueError(f"action {action} is not legal here: choose one of {position.legal}")
        # If the decision is interrupted, nothing is left that stands elsewhere than it says.
        env, self._env = self._env, None
        if env is None:
            env, self._state = VectorEnv(seed=0, total_games=1, history=_WIDTH, **self.options), b""
        if self._state != position.state:
            env.restore([0], [position.state])
        env.step([action])
        return self._found(env, position)

    def drawn(self, position: _Position, seed: int) -> _Position:
        """Returns the same decision, with another deal that the player who decides cannot tell from this one.

        All that agree with what it knows are equally likely; later Shifts are dealt anew.
        """
        player = position.player
        ((hands, actions),) = position.possible().starts(1, seed)
        drawn = self.begun(seed=seed, starts=[(hands, [])])
        # Cards that the player gave are drawn as a set; it knows in which order it gave them.
        seats, taken = history.parts_of(list(position.known[player].values())[-1].actions, self.sizes)
        own = iter(taken[seats == player].tolist())
        for action in actions:
            # It also knows what it gave without a choice.
            drawn = self.after(drawn, next(filter(drawn.legal.__contains__, own)) if drawn.player == player else action)
        # Earlier Shifts are not drawn again.
        current = list(position.known[player])[-1]
        return replace(drawn, known=_since(current, position.known, drawn.known), seen=_since(current, position.seen, drawn.seen))

    def _found(self, env: VectorEnv, before: _Position) -> _Position:
        seen = {player: dict(shifts) for player, shifts in before.seen.items()}
        known = {player: dict(shifts) for player, shifts in before.known.items()}
        _look(env.batch, seen, known)
        while len(env.batch) == 0 and not env.batch.done:
            _look(env.step(np.zeros(0, np.uint16)), seen, known)
        batch = env.batch
        self._state = b"" if batch.done else env.save()[0]
        self._env = env
        if batch.done:
            points = [float(points) for points in batch.endings.observations.points[-1]]
            return _Position(b"", int(pyspiel.PlayerId.TERMINAL), [], points, seen, known)
        legal = np.flatnonzero(batch.masks[0]).tolist()
        return _Position(self._state, int(batch.seats[0]), legal, [0.0] * env.sizes.players, seen, known)


def _every_deal(sizes: Sizes, opening: int) -> tuple[list[pb.ScriptedShift], list[float]]:
    """Returns all deals of the first Shift and their probabilities: docs/rules.md §3.1.

    Raises:
        ValueError: there are more than `_MAX_DEALS`, or a drawn seat opens.
    """
    if opening != pb.OPENING_GOLDEN:
        raise ValueError("deals 0 needs rules by which the Golden card opens: choose the number of deals")
    # The Golden card, which is dealt in any case, is a kind of its own, the last one.
    deck = (*range(1, sizes.faces), sizes.faces - 1, sizes.jokers, 1)

    def chosen(left: tuple[int, ...], cards: int) -> Iterator[tuple[int, ...]]:
        if not left:
            yield ()
            return
        # As many of the first kind that the others can make up the rest.
        for count in range(max(0, cards - sum(left[1:])), min(left[0], cards) + 1):
            for others in chosen(left[1:], cards - count):
                yield (count, *others)

    def hands(left: tuple[int, ...], seats: int) -> Iterator[tuple[tuple[tuple[int, ...], ...], int]]:
        if seats == 0:
            if left[-1] == 0:
                yield (), 1
            return
        for hand in chosen(left, sizes.hand_size):
            ways = math.prod(map(math.comb, left, hand))
            rest = tuple(have - taken for have, taken in zip(left, hand, strict=True))
            for others, count in hands(rest, seats - 1):
                yield (hand, *others), ways * count

    found = list(itertools.islice(hands(deck, sizes.players), _MAX_DEALS + 1))
    if len(found) > _MAX_DEALS:
        raise ValueError(f"there are more than {_MAX_DEALS} deals: choose fewer faces or players, or the number of deals")
    scripts = []
    for dealt, _ in found:
        script = pb.ScriptedShift(shift=1)
        for seat, (*counts, jokers, golden) in enumerate(dealt):
            counts[-1] += golden
            cards = np.repeat(np.arange(1, sizes.faces + 2), [*counts, jokers]).tolist()
            script.hands.add(seat=seat, cards=cards, golden=bool(golden))
        scripts.append(script)
    total = sum(ways for _, ways in found)
    return scripts, [ways / total for _, ways in found]


def _since(current: int, before: dict[int, dict[int, _T]], drawn: dict[int, dict[int, _T]]) -> dict[int, dict[int, _T]]:
    """Returns what each player has of each Shift: of the current one what was drawn, though a player may have nothing of it."""
    players = [*before, *(player for player in drawn if player not in before)]
    earlier = {player: {number: of for number, of in before.get(player, {}).items() if number != current} for player in players}
    return {player: {**shifts, **drawn.get(player, {})} for player, shifts in earlier.items()}


def _look(batch: Batch, seen: dict[int, dict[int, tuple[Situations, int]]], known: dict[int, dict[int, _Shift]]) -> None:
    # The end of a Shift comes before the first decision of the next.
    for situations in (batch.endings, batch):
        for row, player in enumerate(situations.seats.tolist()):
            if situations is batch or batch.done:
                seen.setdefault(player, {})[int(situations.observations.shifts[row])] = situations, row
            _learn(known.setdefault(player, {}), situations, row)


def _learn(known: dict[int, _Shift], situations: Situations, row: int) -> None:
    observed = situations.observations
    golden = bool(observed.golden[row])
    number = int(observed.shifts[row])
    shift = known.get(number, _Shift(observed.hands[row], golden, golden, np.zeros(0, np.uint16)))
    new = int(observed.history_counts[row]) - len(shift.actions)
    actions = np.concatenate([shift.actions, observed.history[row, _WIDTH - new :]])
    known[number] = replace(shift, got_golden=shift.got_golden | golden, actions=actions)


class ChefsHatGame(pyspiel.Game):  # type: ignore[misc]  # OpenSpiel has no types.
    """The game.

    Its parameters are `rules` (a preset), `shifts` (the number of Shifts), `deals` (0: all), `history`, and rules that differ from
    the preset's: `players` (2 to 6), `faces` (4 to 15), `jokers` (0 to 2), `max_idle_pizzas` and `max_turns`, as in `RuleSet`.

    Attributes:
        sizes: of the columns of observations.
        texts: the words of each action.
        games: what takes decisions.
        starts: with `deals` 0, all deals; otherwise none.
        chances: the probability of each outcome of chance.

    Raises:
        ChefsHatError: RULE_SET_REFUSED: there is no such rule set.
        ValueError: `deals` is negative, or 0 with several Shifts or too many deals; or `history` is less than 1.
    """

    def __init__(self, params: Mapping[str, Any] | None = None) -> None:
        given = {**_PARAMETERS, **(params or {})}
        rules = {name: given[name] for name, unset in _RULES.items() if given[name] != unset}
        options: dict[str, Any] = {"games": 1, "rules": {"preset": given["rules"], "target_shifts": given["shifts"], **rules}}
        self.deals, self.shifts, self.history = (int(given[name]) for name in ("deals", "shifts", "history"))
        if self.history < 1:
            raise ValueError(
                f"history is the number of actions in the tensor of an information state, 1 or more, not {self.history}"
            )
        with VectorEnv(seed=0, **options) as env:
            self.sizes = env.sizes
            points, turns, self.texts = list(env.rules.points), env.rules.max_turns, env.action_texts
            opening = env.rules.opening
        self.games = _Games(options, self.sizes)
        shifts = self.shifts
        if self.deals < 0 or (self.deals == 0 and shifts > 1):
            raise ValueError("choose 1 or more deals; 0, for all of them, is for one Shift")
        self.starts, self.chances = ([], [1 / self.deals] * self.deals) if self.deals else _every_deal(self.sizes, opening)
        info = pyspiel.GameInfo(
            num_distinct_actions=self.sizes.num_actions,
            max_chance_outcomes=len(self.chances),
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
        self._games, self._texts = game.games, game.texts
        self.position: _Position | None = None

    def current_player(self) -> int:
        """Returns the player who decides."""
        if self.position is None:
            return int(pyspiel.PlayerId.CHANCE)
        return self.position.player

    def is_terminal(self) -> bool:
        """Returns whether the game is over."""
        return self.position is not None and not self.position.state

    def chance_outcomes(self) -> list[tuple[int, float]]:
        """Returns the deals and their probabilities."""
        return list(enumerate(self.get_game().chances))

    def returns(self) -> list[float]:
        """Returns the points of each player; zeros before the end."""
        return [0.0] * self.num_players() if self.position is None else self.position.points

    def _legal_actions(self, player: int) -> list[int]:
        assert self.position is not None, "a player decides after the deal"
        return list(self.position.legal)

    def resample_from_infostate(self, player: int, uniform: Callable[[], float]) -> "ChefsHatState":
        """Returns a state that a player cannot tell from this one, with its cards of the others drawn: see the module.

        Its history is still that of this state, with the chance outcome of the true deal.

        Args:
            player: the player, who has to be the one who decides.
            uniform: draws numbers from [0, 1).

        Raises:
            ValueError: another player decides.
        """
        if self.position is None or player != self.position.player:
            raise ValueError(f"player {player} does not decide here: resample for current_player(), {self.current_player()}")
        state: ChefsHatState = self.clone()
        state.position = self._games.drawn(self.position, int(uniform() * 2**53))
        return state

    def _apply_action(self, action: int) -> None:
        if self.position is None:
            starts = self.get_game().starts
            self.position = self._games.begun(seed=action, starts=[(starts[action], [])] if starts else None)
        else:
            self.position = self._games.after(self.position, action)

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
            shifts = state.position.known.get(player, {}).values()
            for row, shift in zip(self.dict["shifts"], shifts, strict=False):
                row[:] = shift.tensor(player, self._game.sizes, self._game.history)
        elif seen := state.position.seen.get(player):
            situations, row = list(seen.values())[-1]
            self.tensor[:] = features.table_of(situations)[row]

    def string_from(self, state: ChefsHatState, player: int) -> str:
        """Returns the observation or information state as text."""
        if self._has_recall:
            known = {} if state.position is None else state.position.known.get(player, {})
            return "\n".join([f"player {player}", *(shift.text(self._game.sizes, self._game.texts) for shift in known.values())])
        self.set_from(state, player)
        return " ".join(f"{number:g}" for number in self.tensor)


pyspiel.register_game(_TYPE, ChefsHatGame)
