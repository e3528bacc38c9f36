"""Deep Q agents at the seats of a `VectorEnv`: pairs their decisions with the outcomes and learns from them, step by step.

Every client seat of every game has its own agent: the agent at the k-th client seat of game g is number g * seats + k of the
stack. Agents of different games never meet, so that repetitions of an experiment run in parallel. Deciding and learning are in
`deep_q`; the statistics of a Shift come from the server.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from chefshat import pb
from chefshat.learn import features
from chefshat.vector import Batch, VectorEnv

from chefshat_paper.learn import deep_q
from chefshat_paper.learn.deep_q import Agents, DeepQConfig, Transitions

Ids: TypeAlias = npt.NDArray[np.int32]
Floats: TypeAlias = npt.NDArray[np.float32]
Mask: TypeAlias = npt.NDArray[np.bool_]

# Statistics of a Shift, and of each seat in it.
OF_SHIFTS = ("starters", "pizzas", "laps", "turns", "adjudicated")
OF_SEATS = ("places", "points", "valid", "wrong", "passes", "reward_sums")
# Shifts for whose statistics there is room at first.
FIRST_SHIFTS = 1024


class LockStep:
    """A stack of agents, with the open decision of each: the one whose outcome is not known yet.

    Attributes:
        agents: the stack. May be replaced between calls.
    """

    def __init__(self, config: DeepQConfig, agents: Agents, rows: int, *, explore: bool = True, learn: bool = True) -> None:
        """Takes ownership of the agents.

        Args:
            config: their hyper-parameters.
            agents: the stack.
            rows: maximum number of agents that decide at a time. Calls with fewer are padded.
            explore: whether they explore.
            learn: whether they learn.
        """
        self.agents = agents
        self._config = config
        self._rows = rows
        self._explore = explore
        self._learn = learn
        number = len(agents.epsilon)
        self._states = np.zeros((number, config.inputs), np.float32)
        self._actions = np.zeros(number, np.int32)
        self._open = np.zeros(number, np.bool_)

    def end(self, ids: Ids, rewards: Floats) -> None:
        """Ends the episodes of agents, with their rewards since their last decision.

        Ignores episodes without a decision of the agent, and so also a second one of the same agent.
        """
        ids, first = np.unique(ids, return_index=True)
        rewards = rewards[first]
        for begin in range(0, len(ids), self._rows):
            part = slice(begin, begin + self._rows)
            self._close(ids[part], rewards[part], None, None)

    def decide(self, ids: Ids, rewards: Floats, states: Floats, masks: Mask, attempts: Ids) -> npt.NDArray[np.int32]:
        """Lets agents learn from their last decisions and take the next ones.

        Args:
            ids: (rows,) the agents, each once, at most as many as `rows` of the constructor.
            rewards: (rows,) since their last decision of the episode.
            states: (rows, inputs) their observations.
            masks: (rows, outputs) the legal actions.
            attempts: (rows,) illegal actions at this decision so far.

        Returns:
            (rows,) the actions.
        """
        self._close(ids, rewards, states, masks)
        count = len(ids)
        padded = _filled(self._rows, states), _filled(self._rows, masks), _filled(self._rows, attempts)
        keys, chosen = deep_q.act(self._config, self.agents, self._padded(ids), *padded, explore=self._explore)
        self.agents = self.agents._replace(keys=keys)
        actions: npt.NDArray[np.int32] = np.asarray(chosen)[:count]
        self._states[ids] = states
        self._actions[ids] = actions
        self._open[ids] = True
        return actions

    def _close(self, ids: Ids, rewards: Floats, states: Floats | None, masks: Mask | None) -> None:
        """Learns from the open decisions of agents; without next states their episodes have ended."""
        rows = np.flatnonzero(self._open[ids])
        if len(rows) == 0 or not self._learn:
            self._open[ids] = False
            return
        closed = ids[rows]
        config = self._config
        # Ended episodes have no next state.
        next_states = np.zeros((0, config.inputs), np.float32) if states is None else states[rows]
        next_masks = np.zeros((0, config.outputs), np.bool_) if masks is None else masks[rows]
        transitions = Transitions(
            states=_filled(self._rows, self._states[closed]),
            actions=_filled(self._rows, self._actions[closed]),
            rewards=_filled(self._rows, rewards[rows]),
            next_states=_filled(self._rows, next_states),
            next_masks=_filled(self._rows, next_masks),
            done=_filled(self._rows, np.full(len(rows), states is None)),
        )
        self.agents = deep_q.learn(config, self.agents, self._padded(closed), transitions)
        self._open[ids] = False

    def _padded(self, ids: Ids) -> Ids:
        """Pads the ids with an agent that does not exist."""
        padded = np.full(self._rows, len(self._open), np.int32)
        padded[: len(ids)] = ids
        return padded


@dataclass(frozen=True)
class Played:
    """The statistics of every Shift. G games of S Shifts with N seats.

    Attributes:
        of_shifts: (G, S) arrays by the names in `OF_SHIFTS`.
        of_seats: (G, S, N) arrays by the names in `OF_SEATS`.
        rules: the rule set, every field set.
        most_attempts: maximum number of illegal actions at one decision of a learning agent.
    """

    of_shifts: Mapping[str, npt.NDArray[Any]]
    of_seats: Mapping[str, npt.NDArray[Any]]
    rules: pb.RuleSet
    most_attempts: int


def play(
    env: VectorEnv,
    config: DeepQConfig,
    agents: Agents,
    *,
    explore: bool = True,
    learn: bool = True,
    idle_pass_is_wrong: bool = False,
    advance: Callable[[int], object] = lambda shifts: None,
    on_decision: Callable[[Agents, int], bool] = lambda agents, decisions: False,
) -> tuple[Agents, Played]:
    """Plays the games of an env, to their ends unless `on_decision` ends them, and lets the agents learn.

    Args:
        env: fresh, with decisions "turns", episode "shift", Shift statistics, a reward scheme, `total_games` equal to `games`, and
            a fixed number of Shifts. Agents without a mask need invalid "ask_again".
        config: the agents' hyper-parameters.
        agents: one for each client seat of each game.
        explore: whether they explore.
        learn: whether they learn.
        idle_pass_is_wrong: whether passing counts as illegal where another action is legal. Needs invalid "ask_again".
        advance: called with the number of Shifts that have ended since the last call.
        on_decision: called before the decisions of each batch, with the agents and the decisions that they have taken among
            several legal actions. Learning consumes the agents, so it must not keep them. It returns whether to end the run.

    Returns:
        The agents, and the statistics of the Shifts that have ended in all games.

    Raises:
        ValueError: env, config and agents do not fit each other.
    """
    _check(env, config, agents)
    seats = len(env.client_seats)
    seat_index = np.zeros(env.players, np.int32)
    seat_index[list(env.client_seats)] = np.arange(seats)
    stack = LockStep(config, agents, env.games, explore=explore, learn=learn)
    log = ShiftLog(env)
    batch = env.reset()
    decisions = 0
    while True:
        advance(log.add(batch))
        endings = batch.endings
        if len(endings):
            stack.end(_ids(endings.games, seat_index[endings.seats], seats), endings.rewards)
        if batch.done:
            return stack.agents, log.played()
        if on_decision(stack.agents, decisions):
            return stack.agents, log.played(ended_early=True)
        states = features.classic_of(batch)
        masks = states[:, -config.outputs :] != 0
        # A decision that is asked again is the same one.
        decisions += int(((masks.sum(axis=1) > 1) & (batch.attempts == 0)).sum())
        if idle_pass_is_wrong:
            masks = without_idle_passes(masks)
        actions = stack.decide(
            _ids(batch.games, seat_index[batch.seats], seats), batch.rewards, states, masks, batch.attempts.astype(np.int32)
        )
        # To the server an idle pass is legal.
        batch = env.step(_wrong_as_illegal(actions, masks) if idle_pass_is_wrong else actions)


class ShiftLog:
    """Collects the statistics of every Shift of an env with Shift statistics and `total_games` equal to `games`."""

    def __init__(self, env: VectorEnv) -> None:
        self._env = env
        self._shifts = env.rules.target_shifts
        # A budget of decisions allows for more Shifts than are played.
        shape = (env.games, min(self._shifts, FIRST_SHIFTS))
        self._of_shifts = {name: np.zeros(shape, np.int64) for name in OF_SHIFTS}
        self._of_seats = {name: np.zeros((*shape, env.players), np.int64) for name in OF_SEATS}
        self._of_seats["reward_sums"] = np.zeros((*shape, env.players), np.float32)
        self._ended = np.zeros(shape, np.bool_)
        self._most_attempts = 0

    def add(self, batch: Batch) -> int:
        """Adds the Shifts of a batch. Returns their number."""
        if len(batch):
            self._most_attempts = max(self._most_attempts, int(batch.attempts.max()))
        ended = batch.shifts
        if ended is None or len(ended) == 0:
            return 0
        while ended.shifts.max() > self._ended.shape[1]:
            self._grow()
        at = (ended.games.astype(np.intp), ended.shifts.astype(np.intp) - 1)
        for name, array in (*self._of_shifts.items(), *self._of_seats.items()):
            array[at] = getattr(ended, name)
        self._ended[at] = True
        return len(ended)

    def _grow(self) -> None:
        """Makes room for twice as many Shifts."""

        def grown(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.concatenate([array, np.zeros_like(array)], axis=1)

        self._of_shifts = {name: grown(array) for name, array in self._of_shifts.items()}
        self._of_seats = {name: grown(array) for name, array in self._of_seats.items()}
        self._ended = grown(self._ended)

    def played(self, *, ended_early: bool = False) -> Played:
        """Returns the statistics of all Shifts; of games that were ended early, of those that have ended in all of them."""
        shifts = int(self._ended.all(axis=0).sum()) if ended_early else self._shifts
        if (ended := int(self._ended[:, :shifts].sum())) < len(self._ended) * shifts:
            raise RuntimeError(f"only {ended} of {len(self._ended) * shifts} Shifts ended")
        of_shifts, of_seats = (
            {name: array[:, :shifts] for name, array in arrays.items()} for arrays in (self._of_shifts, self._of_seats)
        )
        return Played(of_shifts, of_seats, self._env.rules, self._most_attempts)


def _check(env: VectorEnv, config: DeepQConfig, agents: Agents) -> None:
    wanted = env.games * len(env.client_seats)
    if len(agents.epsilon) != wanted:
        raise ValueError(
            f"{len(agents.epsilon)} agents for {env.games} games of {len(env.client_seats)} seats: {wanted} are required"
        )
    width = features.classic_width(env.faces, env.hand_size)
    if (config.inputs, config.outputs) != (width, env.turn_actions):
        raise ValueError(
            f"agents have {config.inputs} inputs and {config.outputs} outputs, but this rule set requires {width} and "
            f"{env.turn_actions}"
        )
    if env.rules.target_shifts < 1:
        raise ValueError("the rule set must end the game after a number of Shifts (target_shifts)")


def without_idle_passes(masks: Mask) -> Mask:
    """Removes the pass from the legal actions where another action is legal."""
    right = masks.copy()
    right[:, -1] &= masks.sum(axis=1) == 1
    return right


def _wrong_as_illegal(actions: npt.NDArray[np.int32], right: Mask) -> npt.NDArray[np.int32]:
    """Replaces each action that is not right by an illegal one. There is one, because no hand makes every play legal."""
    chosen = np.take_along_axis(right, actions[:, np.newaxis], axis=1)[:, 0]
    return np.where(chosen, actions, np.argmin(right, axis=1)).astype(np.int32)


def _ids(games: npt.NDArray[np.uint32], seat_index: Ids, seats: int) -> Ids:
    ids: Ids = games.astype(np.int32) * np.int32(seats) + seat_index
    return ids


def _filled(rows: int, array: npt.NDArray[Any]) -> Any:  # noqa: ANN401 - a numpy array where jax's types want one of jax
    """Returns a copy padded with zeros to `rows` rows."""
    filled = np.zeros((rows, *array.shape[1:]), array.dtype)
    filled[: len(array)] = array
    return filled
