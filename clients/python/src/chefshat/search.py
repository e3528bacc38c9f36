"""Search from what one seat knows: possible deals, rollouts, and what actions are worth. docs/search.md says how it works.

`position` describes a decision of an environment or of a live game. A state of an environment has the cards of all seats: those
that the seat may not know are dropped before anything is computed, so two games that look the same to the seat give the same
results. The computation needs the package `chefshat-native`; `Client.evaluate` estimates a live decision on a server without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.decision import Decision
from chefshat.errors import ChefsHatError
from chefshat.vector import VectorEnv
from chefshat.vector_setup import NETWORK_SUFFIX, network_content

if TYPE_CHECKING:
    import chefshat_native

#: Steps of counting the possible deals, 8 bytes each. More are needed with five or six players, early in a Shift.
MAX_STEPS = 4_000_000
#: The most deals of a call.
MAX_DEALS = 100_000
_MAX_SEED = 2**64 - 1


class Wrapper(Protocol):
    """An environment around a `VectorEnv`: those of Gymnasium and PettingZoo."""

    @property
    def unwrapped(self) -> "Wrapper":
        """The innermost environment, which has an attribute `vector`."""


At: TypeAlias = "VectorEnv | Wrapper | Decision | bytes"


def position(at: At, row: int = 0, *, max_steps: int = MAX_STEPS) -> "Position":
    """Returns what a seat knows at its decision.

    Args:
        at: an environment, created with `history=512` or as many actions as a Shift may have; a `Decision` of a live game; or a
            state, as `VectorEnv.save` returns it.
        row: the row of the environment's latest batch.
        max_steps: limit of the work of counting the possible deals.

    Raises:
        ChefsHatError: NATIVE_MISSING without `chefshat-native`; STATES_REFUSED if the state has no decision or a history that is
            too short; ANALYSIS_REFUSED if there are too many deals to count.
    """
    try:
        import chefshat_native
    except ModuleNotFoundError as error:
        words = (
            "search needs the package chefshat-native: pip install 'chefshat[native]', or ask a server for the estimates of a live "
            "decision with Client.evaluate"
        )
        raise ChefsHatError("NATIVE_MISSING", words) from error
    try:
        if isinstance(at, Decision):
            return Position(chefshat_native.Position.of_situation(at.situation().SerializeToString(), max_steps))
        return Position(chefshat_native.Position.of_state(_state(at, row), max_steps))
    except chefshat_native.Refused as error:
        raise ChefsHatError(*error.args) from None


@dataclass(frozen=True)
class Estimates:
    """What actions are worth, in their order. Every action was tried in the same deals.

    Attributes:
        actions: (A,) the actions.
        points: mean points of the Shift.
        standard_errors: of `points`; infinite after fewer than two rollouts.
        gains: mean of the points gained over the first action in the same deals.
        gain_errors: standard errors of `gains`.
        places: mean place in the Shift, from 1.
        rollouts: number of rollouts of each action, at least 4.
    """

    actions: NDArray[np.uint16]
    points: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    gains: NDArray[np.float64]
    gain_errors: NDArray[np.float64]
    places: NDArray[np.float64]
    rollouts: NDArray[np.uint64]

    @property
    def best(self) -> int:
        """The action with the most points among those with the most rollouts."""
        tried = self.rollouts == self.rollouts.max()
        return int(self.actions[np.where(tried, self.points, -np.inf).argmax()])


class Position:
    """What a seat knows at its decision, and all deals that are consistent with it. Threads may share it.

    N is the number of seats, F the number of faces: cards are F+1 counts, the jokers last.

    Attributes:
        seat: the seat that decides.
        rules: the rule set, every field set.
        deals: number of possible deals of the physical cards, with the gifts that the seat did not see.
        legal_actions: the legal actions, ascending.
    """

    def __init__(self, native: "chefshat_native.Position") -> None:
        self._native = native
        self.seat = native.seat
        self.rules = pb.RuleSet.FromString(native.rules)
        self.deals = native.deals
        self.legal_actions = native.legal_actions

    def __repr__(self) -> str:
        return f"Position(seat={self.seat}, {len(self.legal_actions)} legal actions, {self.deals:.3g} deals)"

    def sample(self, deals: int, seed: int = 0) -> NDArray[np.uint8]:
        """Draws possible deals, each equally likely.

        Returns:
            (deals, N, F+1): the cards that each seat holds now. Those of the seat itself are always the same.
        """
        hands = self._native.sample(_checked(deals), _seed(seed))
        return hands.reshape(deals, self.rules.players, self.rules.faces + 1)

    def starts(self, deals: int, seed: int = 0) -> list[tuple[pb.ScriptedShift, list[int]]]:
        """Draws the deals that `sample` draws, as `starts` of a `VectorEnv`, whose games begin at this decision.

        Create it with `rules=position.rules` and as many games as are needed: game i begins with the start `i % deals`.
        """
        listed = map(pb.ListedStart.FromString, self._native.starts(_checked(deals), _seed(seed)))
        return [(start.hands, np.frombuffer(start.actions, "<u2").tolist()) for start in listed]

    def expected_hands(self, deals: int = 500, seed: int = 0) -> NDArray[np.float64]:
        """Returns (N, F+1): the cards that each seat holds on average over the deals that `sample` draws."""
        hands = self._native.expected_hands(_checked(deals), _seed(seed))
        return hands.reshape(self.rules.players, self.rules.faces + 1)

    def evaluate(
        self,
        rollouts: int | None = None,
        *,
        time_ms: int | None = None,
        agent: str | Path = "greedy",
        actions: Sequence[int] | None = None,
        halving: bool = False,
        threads: int = 0,
        seed: int = 0,
    ) -> Estimates:
        """Estimates what actions are worth, by playing on from possible deals to the end of the Shift.

        Args:
            rollouts: the budget in all: the result depends on the seed and not on the threads. Every action is tried in 4 deals at
                least.
            time_ms: the budget in milliseconds; one of both has to be given.
            agent: who plays all seats in the rollouts: "random", "greedy", "trained", or the path of a network file.
            actions: the actions to try; gains refer to the first of them. Default: all legal ones.
            halving: whether the worse half of the actions is dropped again and again (sequential halving); the first one stays.
            threads: 0: one for each core.
            seed: of the deals and of the agents' random choices.
        """
        if not (rollouts or time_ms) or (rollouts or 0) < 0 or (time_ms or 0) < 0:
            raise ValueError("give a budget: a number of rollouts, time_ms, or both, above 0")
        is_file = isinstance(agent, Path) or agent.endswith(NETWORK_SUFFIX)
        policy = network_content(agent) if is_file else str(agent)
        chosen = self.legal_actions if actions is None else np.asarray(actions)
        import chefshat_native

        try:
            columns = self._native.evaluate(
                chosen.tolist(),
                policy,
                rollouts=rollouts or 0,
                time_ms=time_ms or 0,
                halving=halving,
                threads=threads,
                seed=_seed(seed),
            )
        except chefshat_native.Refused as error:
            raise ChefsHatError(*error.args) from None
        return Estimates(**columns)


def _state(at: VectorEnv | Wrapper | bytes, row: int) -> bytes:
    """Returns the state of the game of a row."""
    if isinstance(at, bytes):
        return at
    env: VectorEnv = at if isinstance(at, VectorEnv) else at.unwrapped.vector  # type: ignore[attr-defined] # See `Wrapper`.
    if not 0 <= row < len(env.batch):
        raise ValueError(f"there is no row {row}: the latest batch has {len(env.batch)}")
    return env.save(env.batch.games[row : row + 1])[0]


def _checked(deals: int) -> int:
    if not 1 <= deals <= MAX_DEALS:
        raise ValueError(f"draw 1..={MAX_DEALS} deals, not {deals}")
    return int(deals)


def _seed(seed: int) -> int:
    if not 0 <= seed <= _MAX_SEED:
        raise ValueError(f"a seed is 0..={_MAX_SEED}, not {seed}")
    return int(seed)
