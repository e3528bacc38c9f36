"""An agent with a body: an agent of `chefshat` decides, and a robot does at the table what it decided.

What the robot does is in `body`. A decision is answered when the robot has finished its turn, or when the time of the decision is
nearly used up, whichever comes first: a robot that is slow, fails or is gone never costs its seat a decision. At a physical table
it is answered at once, and then laid. An agent that computes for a while stops neither the body nor the connection: it has a
thread of its own. If its time runs out meanwhile, the default decision is performed, and not what the agent answers later.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import time
from collections import deque
from collections.abc import Awaitable, Callable
from concurrent.futures import Future, ThreadPoolExecutor

import chefshat
from chefshat import ChefsHatError, Decision, SeatInfo, SeatResult, pb

from chefshat_robot.body import PASS, Body, Turn
from chefshat_robot.drivers.driver import LOG, RobotEvent

# The part of a decision's time that is left for the answer to travel, and the least of it, in seconds.
MARGIN = 0.15
MIN_MARGIN_S = 1.0
# Events of the game, which waits while a decision is open: each says that the decision has closed. Events of the room do not.
GAME_EVENTS = frozenset(
    (
        "shift_started",
        "roles_assigned",
        "special_action_declared",
        "cards_exchanged",
        "play",
        "pass",
        "pizza_done",
        "seat_finished",
        "shift_ended",
        "game_ended",
        "game_aborted",
        "correction",
    )
)


class RobotPlayer(chefshat.Agent):
    """Plays a seat with an agent's decisions and a robot's body. For `chefshat.aio`, inside `async with` of its body."""

    def __init__(
        self,
        agent: chefshat.Agent,
        body: Body,
        *,
        hold_s: float | None = None,
        on_robot_event: Callable[[RobotEvent], None] = lambda event: None,
        says_violations: bool = False,
    ) -> None:
        """Creates the player.

        Args:
            agent: decides. Unless its `decide` is a coroutine, all its methods are called in one thread of its own, in order.
            body: acts.
            hold_s: most seconds by which the robot's acts may delay an answer; None: as long as the decision's time allows.
            on_robot_event: called with what the robot hears, reads in faces, and with its buttons.
            says_violations: whether it says what is wrong when a physical table's referee finds a violation.
        """
        self._agent = _Aside(agent)
        self._body = body
        self._hold_s = hold_s
        self._on_robot_event = on_robot_event
        self._says_violations = says_violations
        self._listener: asyncio.Task[None] | None = None
        # The last decision; None once it has closed.
        self._open: Decision | None = None
        # The gift decided last at a physical table: number of the decision, face and receiver.
        self._gift: tuple[int, int, int] | None = None

    async def decide(self, request: Decision) -> int | None:
        """Lets the agent decide, and the robot act.

        Illegal actions of the agent are answered at once, without an act, and so are decisions that have closed meanwhile.
        """
        asked = time.monotonic()
        self._open = request
        action = await self._agent.decide(request)
        if self._open is request and action is not None and action in request.legal_actions:
            self._body.observe(request.request.observation)
            await self._act(request, action, asked)
        return action

    async def _act(self, request: Decision, action: int, asked: float) -> None:
        """Lets the robot act, as long as the decision allows."""
        gift = request.gift_requirement
        face = action - request.turn_actions + 1
        if self._body.state.real_cards:
            # The referee expects a decision before its cards. A turn's event lets the body act, but the event of a gift comes only
            # when the exchange is complete.
            self._gift = (request.decision_id, face, gift.receiver) if gift is not None else None
            return
        if request.kind == pb.DECISION_KIND_TURN:
            done = self._body.take_turn(turn_of(action, request.faces))
        elif gift is not None:
            done = self._body.give(face, gift.receiver)
        else:
            return
        limit = limit_s(request.time_left_ms, time.monotonic() - asked)
        limit = limit if self._hold_s is None else min(limit, self._hold_s)
        if limit > 0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(done.wait(), limit)

    def on_attached(self, seat: SeatInfo) -> None:
        """Sets the robot's seat."""
        self._body.seat_at(seat.seat, seat.live_from)
        if self._listener is None:
            self._listener = asyncio.get_running_loop().create_task(self._listen(), name="robot perceives")
        self._agent.tell(lambda agent: agent.on_attached(seat))

    def on_event(self, event: pb.GameEvent) -> None:
        """Lets the agent and the robot follow the game."""
        if event.WhichOneof("kind") in GAME_EVENTS:
            self._open = None
        self._agent.tell(lambda agent: agent.on_event(event))
        self._body.on_event(event)
        if self._says_violations and event.HasField("violation") and event.sequence >= self._body.live_from:
            self._body.say(event.violation.text, "en")

    def on_snapshot(self, snapshot: pb.Snapshot) -> None:
        """Passes it to the agent."""
        self._agent.tell(lambda agent: agent.on_snapshot(snapshot))

    def on_awaited(self, awaited: pb.Awaited) -> None:
        """Passes it to the agent."""
        self._agent.tell(lambda agent: agent.on_awaited(awaited))

    def on_result(self, result: pb.AnswerResult) -> None:
        """Passes it to the agent. Lets the robot carry a gift at a physical table."""
        if self._gift is not None and self._gift[0] == result.decision_id and result.status == pb.ANSWER_STATUS_ACCEPTED:
            _, face, receiver = self._gift
            self._body.give(face, receiver)
        self._agent.tell(lambda agent: agent.on_result(result))

    def on_refused(self, refused: pb.Refused) -> None:
        """Passes it to the agent."""
        self._agent.tell(lambda agent: agent.on_refused(refused))

    def on_game_over(self, result: SeatResult) -> None:
        """Passes it to the agent."""
        self._end()
        self._agent.tell_last(lambda agent: agent.on_game_over(result))

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """Passes it to the agent."""
        self._end()
        self._agent.tell_last(lambda agent: agent.on_seat_lost(error))

    async def _listen(self) -> None:
        async for event in self._body.driver.events():
            try:
                self._on_robot_event(event)
            except Exception:
                LOG.exception("the agent failed at %s", event)

    def _end(self) -> None:
        if self._listener is not None:
            self._listener.cancel()


class _Aside:
    """An agent in a thread of its own, which hears everything in order. One whose `decide` is a coroutine stays in the loop."""

    def __init__(self, agent: chefshat.Agent) -> None:
        self._agent = agent
        is_coroutine = inspect.iscoroutinefunction(agent.decide)
        self._thread = None if is_coroutine else ThreadPoolExecutor(1, thread_name_prefix="agent")
        # What it is still to hear, and the decision that it computes.
        self._told: deque[Future[None]] = deque()
        self._deciding: Future[int | Awaitable[int | None] | None] | None = None

    async def decide(self, request: Decision) -> int | None:
        """Lets it decide, after it has heard everything.

        Raises:
            Exception: what the agent raises, also when it heard something.
        """
        if self._thread is None:
            answer = self._agent.decide(request)
        else:
            self._deciding = self._thread.submit(self._agent.decide, request)
            answer = await asyncio.wrap_future(self._deciding)
        self._raise()
        action = await answer if isinstance(answer, Awaitable) else answer
        return None if action is None else int(action)

    def tell(self, what: Callable[[chefshat.Agent], None]) -> None:
        """Tells it something. What it raised before is raised here."""
        if self._thread is None:
            what(self._agent)
        else:
            self._raise()
            self._told.append(self._thread.submit(what, self._agent))

    def tell_last(self, what: Callable[[chefshat.Agent], None]) -> None:
        """Tells it the last thing of a game, and waits until it has heard it, unless it still computes a decision."""
        self.tell(what)
        if self._deciding is None or self._deciding.done():
            while self._told:
                self._told.popleft().result()

    def _raise(self) -> None:
        while self._told and self._told[0].done():
            self._told.popleft().result()


def limit_s(time_left_ms: int, used_s: float) -> float:
    """Returns for how many seconds an answer may be held back: the decision's time without its bank, less a margin.

    Args:
        time_left_ms: milliseconds that the decision had when it arrived.
        used_s: seconds that have passed since.
    """
    left = time_left_ms / 1000
    return left - used_s - max(left * MARGIN, MIN_MARGIN_S)


def turn_of(action: int, faces: int) -> Turn:
    """Converts the index of a turn's action (docs/rules.md §8.1) for decks of `faces` faces."""
    passing = 3 * faces * (faces + 1) // 2 + 1
    if action == passing:
        return PASS
    if action == passing - 1:
        return Turn(jokers=1)
    cards, jokers = divmod(action, 3)
    face = 1
    while cards >= face:
        cards -= face
        face += 1
    return Turn(face, cards + 1, jokers)
