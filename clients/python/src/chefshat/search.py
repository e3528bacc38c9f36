"""Search from what one seat knows: possible deals, rollouts, and what actions are worth. docs/search.md says how it works.

`position` describes a decision of an environment or of a live game. A state of an environment has the cards of all seats: those
that the seat may not know are dropped before anything is computed, so two games that look the same to the seat give the same
results. The computation needs the package `chefshat-native`; `Client.evaluate` estimates a live decision on a server without it.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import pb
from chefshat.decision import Decision
from chefshat.errors import ChefsHatError
from chefshat.estimates import Estimates, Outcomes, checked_prior, mean_and_error, scores
from chefshat.opponents import selected
from chefshat.vector import Batch, VectorEnv
from chefshat.vector_setup import is_network_file, network_content, thread_count, whole

if TYPE_CHECKING:
    import chefshat_native

#: Steps of counting the possible deals, 8 bytes each. More are needed with five or six players, early in a Shift.
MAX_STEPS = 4_000_000
#: The most deals of a call.
MAX_DEALS = 100_000
_MAX_SEED = 2**64 - 1
# Deals that are played to leaves at a time.
_LEAF_GAMES = 4096


class Wrapper(Protocol):
    """An environment around a `VectorEnv`: those of Gymnasium and PettingZoo."""

    @property
    def unwrapped(self) -> "Wrapper":
        """The innermost environment, which has an attribute `vector`."""


At: TypeAlias = "VectorEnv | Wrapper | Decision | bytes"

Agent: TypeAlias = str | Path
"""Who plays on: "random", "greedy", "trained", or the path of a network file."""

Leaf: TypeAlias = Callable[[Batch], ArrayLike]
"""Values decisions: given the R rows of a batch at which the seat decides, returns (R,) the points it expects of the Shift."""


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
    with _engine() as native:
        if isinstance(at, Decision):
            return Position(native.Position.of_situation(at.situation().SerializeToString(), max_steps))
        return Position(native.Position.of_state(_state(at, row), max_steps))


def play_on(
    states: Sequence[bytes], agent: Agent | Sequence[Agent] = "greedy", *, threads: int = 0, seed: int = 0
) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
    """Plays games on from their states to the end of the Shift, built-in agents or networks on all seats.

    The agents see what their seats may; the caller who has the states knows the cards of all.

    Args:
        states: S states, as `VectorEnv.save` returns them, of games with the same numbers of seats, faces and cards dealt.
        agent: who plays: one for all N seats, or one for each.
        threads: at most 256; 0: one for each core. The result does not depend on them.
        seed: of the agents' random choices; those of each state are others.

    Returns:
        (S, N) points and (S, N) places, from 1, of every seat.

    Raises:
        ChefsHatError: STATES_REFUSED or ANALYSIS_REFUSED says what is wrong with a state or an agent.
    """
    agents = list(agent) if isinstance(agent, Sequence) and not isinstance(agent, str) else [agent]
    with _engine() as native:
        points, places = native.play_states(
            list(states), [_policy(one) for one in agents], threads=thread_count(threads), seed=_seed(seed)
        )
    shape = (len(states), -1 if len(states) else 0)
    return points.reshape(shape), places.reshape(shape)


def choose(states: Sequence[bytes], agent: Agent = "greedy", *, seed: int = 0) -> NDArray[np.uint16]:
    """Returns what an agent would do at the decision of each state, for instance to imitate it, or to compare it with another.

    It sees what its seat may.

    Args:
        states: S states, as `VectorEnv.save` returns them, of games with the same numbers of seats, faces and cards dealt.
        agent: "random", "greedy", "trained", or the path of a network file.
        seed: of its random choices; those at each state are others.

    Returns:
        (S,) actions.

    Raises:
        ChefsHatError: STATES_REFUSED or ANALYSIS_REFUSED says what is wrong with a state or the agent.
    """
    with _engine() as native:
        return native.choose_actions(list(states), _policy(agent), seed=_seed(seed))  # type: ignore[no-any-return]


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
        return self._starts(0, _checked(deals), seed)

    def expected_hands(self, deals: int = 500, seed: int = 0) -> NDArray[np.float64]:
        """Returns (N, F+1): the cards that each seat holds on average over the deals that `sample` draws."""
        hands = self._native.expected_hands(_checked(deals), _seed(seed))
        return hands.reshape(self.rules.players, self.rules.faces + 1)

    def log_likelihoods(self, deals: int, agent: Agent = "trained", seed: int = 0) -> NDArray[np.float64]:
        """Says how likely the other seats would have decided as they did in this Shift, for each of these deals.

        The exponentials are `weights` of `evaluate`: `np.exp(t * (logs - logs.max()))`, where a t below 1 believes less.

        Args:
            deals: D: those that `sample(deals, seed)` draws.
            agent: the others decide about as "trained" or the network of this path does: with the probabilities of its softmax, of
                which 1 % is an error that makes any action possible.
            seed: of the deals.

        Returns:
            (D,) natural logarithms, 0 or less; 0 if no other seat had a choice.

        Raises:
            ChefsHatError: ANALYSIS_REFUSED if the agent is no network for these rules.
        """
        with _engine():
            return self._native.log_likelihoods(_checked(deals), _seed(seed), _policy(agent))

    def evaluate(
        self,
        rollouts: int | None = None,
        *,
        time_ms: int | None = None,
        deals: int | None = None,
        agent: Agent = "greedy",
        actions: Sequence[int] | None = None,
        halving: bool = False,
        prior: ArrayLike | None = None,
        considered: int = 16,
        weights: ArrayLike | None = None,
        leaf: Leaf | None = None,
        threads: int = 0,
        seed: int = 0,
    ) -> Estimates:
        """Estimates what actions are worth, by playing on from possible deals to the end of the Shift.

        The budget is `rollouts`, `time_ms`, both, or `deals`.

        Args:
            rollouts: the budget in all: the result depends on the seed and not on the threads. It is only exceeded because every
                action that is tried at all is tried in 4 deals at least.
            time_ms: the budget in milliseconds: with one thread, on Linux, time of the processor, or else the time that passes.
            deals: every action is tried in the deals that `sample(deals, seed)` draws. See `outcomes`, whose means these are.
            agent: who plays all seats in the rollouts: "random", "greedy", "trained", or the path of a network file.
            actions: the A actions to try; gains refer to the first of them. Default: all legal ones.
            halving: whether the worse half of the actions is dropped again and again (sequential halving); the first one stays.
            prior: (A,) probabilities of the actions, for instance of a network (`learn.network.Network.logits_of`). Needs
                `rollouts`, at most 100,000: those `considered` actions that are likeliest share them by sequential halving, and the
                likeliest stays; gains refer to it. What is dropped is decided by points and prior as in `Estimates.improved`.
            considered: how many actions a `prior` lets in.
            weights: (deals,) how likely each of the `deals` is, see `Outcomes.estimates`.
            leaf: with `deals`, values the seat's next decision instead of playing on, see `outcomes`.
            threads: at most 256; 0: one for each core.
            seed: of the deals and of the agents' random choices.
        """
        if deals is None and (weights is not None or leaf is not None):
            raise ValueError("weights and leaf need deals: a number of deals, in which every action is tried")
        if deals is not None:
            if rollouts or time_ms or halving or prior is not None:
                raise ValueError("deals is a budget of its own: leave out rollouts, time_ms, halving and prior")
            tried = self.outcomes(deals, agent=agent, actions=actions, leaf=leaf, threads=threads, seed=seed)
            return tried.estimates(weights)
        if not (rollouts or time_ms) or (rollouts or 0) < 0 or (time_ms or 0) < 0:
            raise ValueError("give a budget: a number of rollouts, time_ms, or both, above 0; or deals")
        if prior is not None:
            if time_ms or halving:
                raise ValueError("a prior shares rollouts by halving: leave out time_ms and halving")
            if not rollouts or considered < 1:
                raise ValueError("a prior needs rollouts, and considers 1 action or more")
            rollouts = whole("the number of rollouts with a prior", rollouts, 1, MAX_DEALS)
            chosen = self._chosen(actions)
            return self._by_prior(rollouts, chosen, checked_prior(prior, len(chosen)), considered, agent, threads, seed)
        with _engine():
            columns = self._native.evaluate(
                self._chosen(actions).tolist(),
                _policy(agent),
                rollouts=rollouts or 0,
                time_ms=time_ms or 0,
                halving=halving,
                threads=thread_count(threads),
                seed=_seed(seed),
            )
        return Estimates(**columns)

    def outcomes(
        self,
        deals: int,
        *,
        agent: Agent = "greedy",
        actions: Sequence[int] | None = None,
        leaf: Leaf | None = None,
        threads: int = 0,
        seed: int = 0,
    ) -> Outcomes:
        """Tries every action in the same deals, and returns what each brought in each of them.

        Args:
            deals: D: those that `sample(deals, seed)` draws.
            agent: who plays all seats.
            actions: the A actions to try. Default: all legal ones.
            leaf: values the seat's next decision among several actions in the Shift, with what the seat then may know but the
                history; no deal is played further. (From a position with one action, its next decision.) The agents' random choices
                are others than without it.
            threads: at most 256; 0: one for each core.
            seed: of the deals and of the agents' random choices.
        """
        chosen = self._chosen(actions)
        if leaf is not None:
            return self._to_leaves(leaf, chosen, _checked(deals), agent, threads, seed)
        points, places = self._shifts(chosen, 0, _checked(deals), agent, threads, seed)
        return Outcomes(chosen, points, places)

    def _chosen(self, actions: Sequence[int] | None) -> NDArray[np.uint16]:
        if actions is None:
            return self.legal_actions
        chosen = np.asarray(actions)
        if chosen.ndim != 1 or not len(chosen) or chosen.dtype.kind not in "iu" or not np.isin(chosen, self.legal_actions).all():
            raise ChefsHatError("ANALYSIS_REFUSED", "actions: give a list of at least one action, and only legal ones")
        return chosen.astype(np.uint16)

    def _shifts(
        self, actions: NDArray[np.uint16], first: int, deals: int, agent: Agent, threads: int, seed: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns points and places, (deals, A) each, in deals from `first` on."""
        with _engine():
            found = self._native.outcomes(
                actions.tolist(), _policy(agent), first=first, deals=deals, threads=thread_count(threads), seed=_seed(seed)
            )
        points, places = (column.reshape(deals, len(actions)).astype(np.float64) for column in found)
        return points, places

    def _to_leaves(self, leaf: Leaf, actions: NDArray[np.uint16], deals: int, agent: Agent, threads: int, seed: int) -> Outcomes:
        """Plays to the seat's next decision."""
        points, places = np.full((2, deals, len(actions)), np.nan)
        worth = np.array(self.rules.points, np.float64)
        for first in range(0, deals, _LEAF_GAMES):
            count = min(deals - first, _LEAF_GAMES)
            options: Any = {"client_seats": [self.seat], "opponents": agent, "rules": self.rules, "threads": threads}
            options["skip_forced"] = len(self.legal_actions) > 1
            seeds = [_seed(seed).to_bytes(8, "little") + deal.to_bytes(24, "little") for deal in range(first, first + count)]
            with VectorEnv(games=count, seed=seeds, starts=self._starts(first, count, seed), **options) as env:
                states = env.save()
                for column, action in enumerate(actions):
                    part = slice(first, first + count), column
                    batch = env.step(np.full(count, action))
                    # A game may need several steps, if the other seats have many decisions.
                    while not self._take_leaves(leaf, batch, worth, points[part], places[part]):
                        batch = env.step(np.zeros(len(batch), np.uint16), leave_open=np.ones(len(batch), np.bool_))
                    env.restore(np.arange(count), states)
        return Outcomes(actions, points, places)

    def _take_leaves(
        self, leaf: Leaf, batch: Batch, worth: NDArray[np.float64], points: NDArray[np.float64], places: NDArray[np.float64]
    ) -> bool:
        """Sets points and places of the games that have come to a leaf, or to the end of the Shift. Returns whether all have."""
        endings = batch.endings.first_of_each_game()
        new = np.isnan(points[endings.games])
        ended, reached = endings.games[new], endings.places_taken[new]
        places[ended], points[ended] = reached, worth[reached - 1]
        rows = np.flatnonzero(np.isnan(points[batch.games]))
        if len(rows):
            values = np.asarray(leaf(selected(batch, rows)), np.float64)
            if values.shape != (len(rows),) or not np.isfinite(values).all():
                raise ValueError(f"leaf has to return a finite number for each of the {len(rows)} rows")
            points[batch.games[rows]] = values
        return not np.isnan(points).any()

    def _starts(self, first: int, deals: int, seed: int) -> list[tuple[pb.ScriptedShift, list[int]]]:
        listed = map(pb.ListedStart.FromString, self._native.starts(deals, _seed(seed), first=first))
        return [(start.hands, np.frombuffer(start.actions, "<u2").tolist()) for start in listed]

    def _by_prior(
        self,
        rollouts: int,
        chosen: NDArray[np.uint16],
        prior: NDArray[np.float64],
        considered: int,
        agent: Agent,
        threads: int,
        seed: int,
    ) -> Estimates:
        """Shares rollouts among the likeliest actions by sequential halving."""
        likeliest = np.argsort(-prior, kind="stable")[:considered]
        # The actions that are still tried, by their place among the likeliest.
        active = np.arange(len(likeliest))
        rounds = max(1, int(np.ceil(np.log2(len(active)))))
        # An action is tried in the first deals, as many as its round lets it.
        points, places = np.empty((2, 0, len(likeliest)))
        spent = 0
        for left in range(rounds, 0, -1):
            more = max(0 if spent else 4, (rollouts - spent) // (left * len(active)))
            # The budget may be spent, or too small for a deal of all these actions: of fewer, it may not be.
            if more:
                new = np.full((2, more, len(likeliest)), np.nan)
                new[:, :, active] = self._shifts(chosen[likeliest[active]], len(points), more, agent, threads, seed)
                points, places = np.concatenate([points, new[0]]), np.concatenate([places, new[1]])
                spent += more * len(active)
            if left > 1:
                means = points[:, active].mean(axis=0)
                by_score = np.argsort(-scores(means, prior[likeliest[active]], len(points)), kind="stable")
                others = by_score[by_score > 0]
                active = active[[0, *others[: max(2, (len(active) + 1) // 2) - 1]]]
        columns = np.full((5, len(chosen)), np.nan)
        rollouts_of = np.zeros(len(chosen), np.uint64)
        for place, action in enumerate(likeliest):
            tried = slice(0, np.isfinite(points[:, place]).sum())
            share = np.full(tried.stop, 1 / tried.stop)
            gains = points[tried, place] - points[tried, 0]
            means_of = mean_and_error(points[tried, place], share), mean_and_error(gains, share)
            columns[:, action] = *means_of[0], *means_of[1], share @ places[tried, place]
            rollouts_of[action] = tried.stop
        points_of, errors, gains_of, gain_errors, places_of = columns
        return Estimates(chosen, points_of, errors, gains_of, gain_errors, places_of, rollouts_of)


@contextmanager
def _engine() -> Iterator[ModuleType]:
    """Provides the native module, and raises what it refuses as `ChefsHatError`."""
    try:
        import chefshat_native
    except ModuleNotFoundError as error:
        words = (
            "search needs the package chefshat-native: pip install ./chefshat_native-*.whl (a file of each release), or ask a "
            "server for the estimates of a live decision with Client.evaluate"
        )
        raise ChefsHatError("NATIVE_MISSING", words) from error
    try:
        yield chefshat_native
    except chefshat_native.Refused as error:
        raise ChefsHatError(*error.args) from None


def _policy(agent: Agent) -> str | bytes:
    """Returns an agent as the engine takes it."""
    return network_content(agent) if is_network_file(agent) else str(agent)


def _state(at: VectorEnv | Wrapper | bytes, row: int) -> bytes:
    """Returns the state of the game of a row."""
    if isinstance(at, bytes):
        return at
    env = at if isinstance(at, VectorEnv) else getattr(getattr(at, "unwrapped", None), "vector", None)
    if not isinstance(env, VectorEnv):
        raise TypeError(f"a position is that of an environment, a Decision or a state (bytes), not of a {type(at).__name__}")
    if not 0 <= row < len(env.batch):
        raise ValueError(f"there is no row {row}: the latest batch has {len(env.batch)}")
    return env.save(env.batch.games[row : row + 1])[0]


def _checked(deals: int) -> int:
    return whole("the number of deals", deals, 1, MAX_DEALS)


def _seed(seed: int) -> int:
    return whole("a seed", seed, 0, _MAX_SEED)
