"""What a session remembers of one seat from its ticket to its result. What changes it, and why, is in `session`."""

from typing import NamedTuple

from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult, Standing


class Ask(NamedTuple):
    """A decision to be put to an agent."""

    place: "SeatSession"
    decision: Decision

    @property
    def agent(self) -> Agent:
        """Who is asked."""
        return self.place.agent


class SeatSession:
    """One seat's part of a session; it outlives connections."""

    def __init__(self, ticket: str, request_id: int, agent: Agent, entropy: bytes) -> None:
        self.ticket = ticket
        self.request_id = request_id
        self.agent = agent
        # The same on every connection: what counts is what the server had when the game began.
        self.entropy = entropy
        self.info: SeatInfo | None = None
        # Handle on the present connection; None while not attached.
        self.handle: int | None = None
        # Number of the last event seen; 0 before any.
        self.last_sequence = 0
        # Events below this number happened before the seat was attached last.
        self.live_from = 0
        # A substitute plays for the seat although its agent is here, and the server has not been told so yet.
        self.substituted = False
        # The decision the agent has been asked and has not answered yet.
        self.asked: Decision | None = None
        # The answer the server has not acknowledged yet, and the decision it answers.
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
        # Agents that do not listen cost no call per event.
        self.hears_events = type(agent).on_event is not Agent.on_event
        self.hears_results = type(agent).on_result is not Agent.on_result

    @property
    def game_is_over(self) -> bool:
        """Whether the event that ends the game has been seen."""
        return bool(self.standings or self.abort_reason)

    def finish(self, error: ChefsHatError | None) -> SeatResult:
        """Nothing more will come: what is left of the game, with why it was lost if it was."""
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
        """Whether that is the number of this seat; it is not known before the seat has been attached."""
        return self.info is not None and self.info.seat == seat
