"""The state of a tournament participant in a session. The server gives it a seat in each of its games.

The state of a seat is in `seat_session`; `session` changes both.
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
"""Creates the agent of a game from its seat, for example a subclass of `Agent` whose constructor takes the seat."""

OnEntered: TypeAlias = Callable[[pb.Entered], None]
"""Called on each connection with the tournament and the participant's number in it."""


class Participant:
    """One participant of a session. It outlives connections."""

    def __init__(self, ticket: str, make_agent: MakeAgent, entropy: bytes, on_entered: OnEntered | None = None) -> None:
        self.ticket = ticket
        self.make_agent = make_agent
        self._on_entered = on_entered
        # The protocol has one for all games of the participant.
        self.entropy = entropy
        # Handle on the current connection; None while not attached.
        self.handle: int | None = None
        # Whether no further seats follow, and the error if the tournament is not over.
        self.over = False
        self.error: ChefsHatError | None = None

    def attach(self, delivery: pb.EventDelivery.ValueType) -> pb.SeatCommand:
        """Returns the command that attaches it on a new connection."""
        self.handle = None
        return attach(self.ticket, REQUEST_ID, 0, self.entropy, delivery)

    def receive(self, update: pb.SeatUpdate) -> None:
        """Processes an update on a handle that is not a seat's."""
        if update.HasField("entered"):
            self.handle = update.handle
            if self._on_entered is not None:
                self._on_entered(update.entered)
        elif update.HasField("detached") and update.handle == self.handle:
            self._detached(update.detached.reason)

    def end(self, error: ChefsHatError | None = None) -> None:
        """Ends the participation."""
        self.handle = None
        if not self.over:
            self.over, self.error = True, error

    def _detached(self, reason: pb.DetachReason.ValueType) -> None:
        """Ends the participation at the server's request."""
        if reason == pb.DETACH_REASON_SERVER_STOPPING:
            # The end of the stream follows; the participant is attached again on the next one.
            return
        if reason == pb.DETACH_REASON_TOURNAMENT_OVER:
            self.end()
        elif reason == pb.DETACH_REASON_SUPERSEDED:
            self.end(ChefsHatError("SUPERSEDED", "a newer connection has replaced the participant"))
        else:
            self.end(ChefsHatError("DETACHED", "the participant has left the stream"))
