"""The state of one seat in a session, from its ticket to its result. `session` changes it."""

from typing import NamedTuple

from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult, Standing


class Ask(NamedTuple):
    """A decision for an agent."""

    seat: "SeatSession"
    decision: Decision

    @property
    def agent(self) -> Agent:
        """The agent that decides."""
        return self.seat.agent


class SeatSession:
    """One seat of a session. It outlives connections."""

    def __init__(self, ticket: str, request_id: int, agent: Agent, entropy: bytes) -> None:
        self.ticket = ticket
        self.request_id = request_id
        self.agent = agent
        # The same on every connection: the server uses the one it had when the game began.
        self.entropy = entropy
        self.info: SeatInfo | None = None
        # Handle on the current connection; None while not attached.
        self.handle: int | None = None
        # Number of the last event seen; 0 before the first.
        self.last_sequence = 0
        # Events below this number happened before the latest attachment.
        self.live_from = 0
        # A substitute plays for the connected seat, which has not resumed yet.
        self.substituted = False
        # The agent has left its last decision open.
        self.left_open = False
        # The same of any decision.
        self.has_left_open = False
        # The agent knows of somebody whom the game waits for.
        self.awaits = False
        # The decision that the agent is making.
        self.asked: Decision | None = None
        # The unacknowledged answer, and the decision it answers.
        self.unacknowledged: pb.Answer | None = None
        self.answered: Decision | None = None
        self.standings: tuple[Standing, ...] = ()
        self.reveal: pb.SeedReveal | None = None
        self.abort_reason = ""
        self.attachments = 0
        self.decisions = 0
        self.invalid = 0
        self.late = 0
        self.annotations_dropped = 0
        # Skips calls of hooks that the agent does not override.
        self.hears_events = type(agent).on_event is not Agent.on_event
        self.hears_results = type(agent).on_result is not Agent.on_result

    @property
    def game_is_over(self) -> bool:
        """Whether the event that ends the game has been seen."""
        return bool(self.standings or self.abort_reason)

    def finish(self, error: ChefsHatError | None) -> SeatResult:
        """Ends the seat. Returns its result, with the error if it was lost."""
        self.asked = None
        self.unacknowledged = None
        self.answered = None
        info = self.info
        return SeatResult(
            room_id=info.room_id if info else "",
            game_id=info.game_id if info else "",
            seat=info.seat if info else -1,
            standings=self.standings,
            reveal=self.reveal,
            abort_reason=self.abort_reason,
            decisions=self.decisions,
            invalid=self.invalid,
            late=self.late,
            annotations_dropped=self.annotations_dropped,
            reconnects=max(self.attachments - 1, 0),
            entropy=self.entropy,
            error=error,
        )

    def is_seat(self, seat: int) -> bool:
        """Whether this seat has the number `seat`; False before the first attachment."""
        return self.info is not None and self.info.seat == seat
