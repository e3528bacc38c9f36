"""The base class of agents, and the random agent. Connections are in `client` and `aio`."""

import random
from abc import ABC, abstractmethod
from collections.abc import Awaitable

from chefshat import pb
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult


class Agent(ABC):
    """A player for one seat. Subclass it with `decide`; the other methods are hooks that do nothing unless overridden.

    In the blocking client all methods run in one thread (not the caller's), in `aio` in the event loop, so they need no locks. An
    exception in any of them ends the run and propagates to the caller. Use one instance for each seat.
    """

    @abstractmethod
    def decide(self, request: Decision) -> int | Awaitable[int | None] | None:
        """Chooses an action.

        Called again with the same `decision_id` if the answer was invalid, up to `request.invalid_attempts_left` times.

        Args:
            request: the decision, with the observation of the seat.

        Returns:
            The index of the action, one of `request.legal_actions`; or None, which leaves the decision open until its time is over:
            then the server decides as the policy of the room says, and a substitute that takes the seat over for it keeps it. Under
            `chefshat.aio` this method may be `async`.
        """

    def on_attached(self, seat: SeatInfo) -> None:
        """Called when the seat is attached: at the start, and after every reconnection."""

    def on_event(self, event: pb.GameEvent) -> None:
        """Called for every event of the game, once and in order, at the latest before the seat's next decision."""

    def on_snapshot(self, snapshot: pb.Snapshot) -> None:
        """Called when the server sends the current state instead of the events so far."""

    def on_awaited(self, awaited: pb.Awaited) -> None:
        """Called when the game waits for a different seat among the others, or for none of them (no `seat`).

        Only with events delivered at once.
        """

    def on_result(self, result: pb.AnswerResult) -> None:
        """Called with the result of an answer: accepted, invalid or too late, and the time it took."""

    def on_refused(self, refused: pb.Refused) -> None:
        """Called when the server refuses a command of this seat other than an answer."""

    def on_game_over(self, result: SeatResult) -> None:
        """Called when the seat's game is over, finished or aborted."""

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """Called instead of `on_game_over` when the seat is lost for good before its game was over."""


class RandomAgent(Agent):
    """Chooses uniformly among the legal actions. The same seed and the same decisions give the same answers."""

    def __init__(self, seed: int | None = None) -> None:
        self._rng = random.Random(seed)

    def decide(self, request: Decision) -> int:
        """Draws one of the set bits of the mask."""
        bits = int.from_bytes(request.request.action_mask, "little")
        # Clearing the lowest set bit repeatedly is several times faster than unpacking the mask into an array.
        for _ in range(int(self._rng.random() * bits.bit_count())):
            bits &= bits - 1
        return (bits & -bits).bit_length() - 1
