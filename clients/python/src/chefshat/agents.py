"""What plays: the base class of agents and the random agent. How agents reach a server is not here (see `client` and `aio`)."""

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
    exception in any of them ends the run and reaches the caller. An instance plays one seat; give every seat its own.
    """

    @abstractmethod
    def decide(self, request: Decision) -> int | Awaitable[int]:
        """Chooses an action.

        Called again for the same `decision_id` if the answer was invalid: `request.invalid_attempts_left` says how often still.

        Args:
            request: what is asked and what the seat may know.

        Returns:
            The index of the action, one of `request.legal_actions`. Under `chefshat.aio` this method may be `async`.
        """

    def on_attached(self, seat: SeatInfo) -> None:
        """The seat is attached: at the start, and again after every reconnection."""

    def on_event(self, event: pb.GameEvent) -> None:
        """Something happened in the game. Every event comes once and in order, at the latest before the seat's next decision."""

    def on_snapshot(self, snapshot: pb.Snapshot) -> None:
        """The server sent where the game stands instead of the events so far."""

    def on_result(self, result: pb.AnswerResult) -> None:
        """The server's word on an answer: accepted, invalid or too late, and the time it took."""

    def on_refused(self, refused: pb.Refused) -> None:
        """The server refused a command of this seat that is not an answer."""

    def on_game_over(self, result: SeatResult) -> None:
        """The seat's game is over, finished or aborted."""

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """The seat is gone before its game was over, for good: nothing more is heard of it. In place of `on_game_over`."""


class RandomAgent(Agent):
    """Plays uniformly among the legal actions. The same seed and the same decisions give the same answers."""

    def __init__(self, seed: int | None = None) -> None:
        self._chance = random.Random(seed)

    def decide(self, request: Decision) -> int:
        """Draws one of the set bits of the mask."""
        bits = int.from_bytes(request.request.action_mask, "little")
        # Clearing the lowest set bit so often is several times faster than unpacking the mask into an array.
        for _ in range(int(self._chance.random() * bits.bit_count())):
            bits &= bits - 1
        return (bits & -bits).bit_length() - 1
