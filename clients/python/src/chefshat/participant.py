"""What a session remembers of a participant of a tournament, who is given a seat in each of its games.

What it remembers of a seat is in `seat_session`; what changes either, and why, in `session`.
"""

from collections.abc import Callable
from typing import TypeAlias

from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.requests import attach

# Request id of a participant's attachment, far from those of seats.
REQUEST_ID = 2**32 - 1

MakeAgent: TypeAlias = Callable[[SeatInfo], Agent]
"""Gives the agent of a game that the participant is seated in. A subclass of `Agent` whose constructor takes the seat is one."""

OnEntered: TypeAlias = Callable[[pb.Entered], None]
"""Is told, on each connection, of the tournament that a participant takes part in, and of its number there."""


class Participant:
    """One participant's part of a session; it outlives connections."""

    def __init__(self, ticket: str, make_agent: MakeAgent, entropy: bytes, on_entered: OnEntered | None = None) -> None:
        self.ticket = ticket
        self.make_agent = make_agent
        self._on_entered = on_entered
        # One for all games of the participant, as the protocol has it.
        self.entropy = entropy
        # Handle on the present connection; None while not attached.
        self.handle: int | None = None
        # Whether it will be seated no more, and why if not because the tournament is over.
        self.over = False
        self.error: ChefsHatError | None = None

    def attach(self, delivery: pb.EventDelivery.ValueType) -> pb.SeatCommand:
        """The command that attaches a new connection to it."""
        self.handle = None
        return attach(self.ticket, REQUEST_ID, 0, self.entropy, delivery)

    def told(self, update: pb.SeatUpdate) -> None:
        """What the server says on a handle that is no seat's."""
        if update.HasField("entered"):
            self.handle = update.handle
            if self._on_entered is not None:
                self._on_entered(update.entered)
        elif update.HasField("detached") and update.handle == self.handle:
            self._detached(update.detached.reason)

    def end(self, error: ChefsHatError | None = None) -> None:
        """It will be seated no more."""
        self.handle = None
        if not self.over:
            self.over, self.error = True, error

    def _detached(self, reason: pb.DetachReason.ValueType) -> None:
        """The server has dismissed it."""
        if reason == pb.DETACH_REASON_TOURNAMENT_OVER:
            self.end()
        elif reason == pb.DETACH_REASON_SUPERSEDED:
            self.end(ChefsHatError("SUPERSEDED", "a newer connection takes part in the tournament in its place"))
        else:
            self.end(ChefsHatError("DETACHED", "the participant has left the stream"))
