"""What a robot does at the table: the acts for its seat's turns and for the events of the game, and what happens when an act fails.

Acts are performed one after another by one task. Two queues feed it: acts that the game needs (cards and what is said with them),
all of which are performed, and reactions (looking, small talk), which are dropped when there is something more urgent. Who decides
is elsewhere: an agent in `player`, a person on the page in `wizard`.
"""

from __future__ import annotations

import asyncio
import dataclasses
import logging
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import NamedTuple, Self

from chefshat import pb

from chefshat_robot import layout
from chefshat_robot.drivers.driver import (
    Act,
    CardMove,
    Driver,
    Express,
    Failed,
    Gaze,
    Outcome,
    Pick,
    Point,
    Say,
    attempt,
    describe,
)
from chefshat_robot.layout import Stand
from chefshat_robot.table import TableState, follow, observe, plays_golden
from chefshat_robot.words import Words

LOG = logging.getLogger("chefshat_robot")
# Reactions that wait; beyond that the oldest are dropped.
MAX_REACTIONS = 4
# Events that wait to be shown to the robot; beyond that the oldest are dropped.
MAX_FORWARDS = 1000
# Seconds in which acts still waiting may be finished at the end.
FINISH_S = 30.0


@dataclass(frozen=True)
class Times:
    """How long acts may take, in seconds; for `Pick` per piece.

    Attributes:
        say: speaking a sentence.
        pick: carrying one piece.
        point: pointing.
        gaze: looking.
        express: showing a feeling.
    """

    say: float = 15.0
    pick: float = 20.0
    point: float = 8.0
    gaze: float = 4.0
    express: float = 8.0

    def times(self, factor: float) -> Times:
        """Returns these limits multiplied."""
        return Times(*(limit * factor for limit in dataclasses.astuple(self)))

    def of(self, act: Act) -> float:
        """Returns the limit for an act."""
        match act:
            case Say():
                return self.say
            case Pick(moves):
                return self.pick * len(moves)
            case Point():
                return self.point
            case Gaze():
                return self.gaze
            case Express():
                return self.express


@dataclass(frozen=True)
class Notice:
    """A message to the attendant.

    Attributes:
        kind: "help": a person has to do something; "unsaid": the robot could not say the text.
        text: what to do, or what was to be said, in the robot's language.
        reason: why.
        cards: for "help" with cards: the pieces and where they go.
    """

    kind: str
    text: str
    reason: str
    cards: tuple[CardMove, ...] = ()


class Turn(NamedTuple):
    """A play, or a pass if all are 0."""

    face: int = 0
    quantity: int = 0
    jokers: int = 0

    @property
    def is_pass(self) -> bool:
        """Whether it is a pass."""
        return not (self.quantity or self.jokers)


PASS = Turn()


@dataclass
class _Job:
    """Acts performed in order. If a `Pick` among them fails, `plea` asks a person to do it, aloud and on the attendant's screen."""

    acts: tuple[Act, ...]
    plea: str = ""
    done: asyncio.Event = field(default_factory=asyncio.Event)


class Body:
    """A robot at the table. An asynchronous context manager: entering connects the robot, leaving waits for acts in progress.

    Attributes:
        state: what the robot's seat knows of the game.
        live_from: events with a lower number are of the past: they change the state, but the robot does not react.
    """

    def __init__(
        self,
        driver: Driver,
        words: Words,
        *,
        seat: int | None = None,
        notify: Callable[[Notice], None] = lambda notice: None,
        on_act: Callable[[Act, Outcome], None] = lambda act, outcome: None,
        times: Times | None = None,
        stand: Stand | None = None,
        handles_cards: bool = True,
        small_talk: bool = True,
        announces: bool = True,
        finish_s: float = FINISH_S,
    ) -> None:
        """Creates the body.

        Args:
            driver: the robot; the body connects and closes it.
            words: what it says.
            seat: its seat; None: `seat_at` sets it.
            notify: called with messages to the attendant.
            on_act: called after each act with its outcome.
            times: limits of acts.
            stand: where its cards are; None: in front of its seat.
            handles_cards: whether there are real cards. Otherwise it only speaks, looks and expresses.
            small_talk: whether it comments on the game, and shows what it feels about it.
            announces: whether it says what it plays.
            finish_s: seconds for acts that still wait at the end.
        """
        self.driver = driver
        self.words = words
        self.state = TableState(seat=seat)
        self.live_from = 0
        self._notify = notify
        self._on_act = on_act
        self._times = times or Times()
        self._stand = stand
        self._handles_cards = handles_cards
        self._small_talk = small_talk
        self._announces = announces
        self._finish_s = finish_s
        self._pass_is_down = False
        # The own turn that is being performed and that the game has not confirmed yet.
        self._announced: Turn | None = None
        # Of the Shift: the state before each event, by its number, and the own turns. Corrections at physical tables need them.
        self._past: list[tuple[int, TableState]] = []
        self._turns: list[tuple[int, Turn]] = []
        # Own turns that a correction has made void, and whose events come again.
        self._repeated: list[Turn] = []
        # Pieces that were given in the exchange, which is not complete yet.
        self._given: list[str] = []
        # Whether the own gifts of the Shift have been handed over.
        self._has_given = False
        # Whether the Shift began before the robot was there.
        self._joined_in_shift = False
        self._needed: deque[_Job] = deque()
        self._reactions: deque[_Job] = deque(maxlen=MAX_REACTIONS)
        self._forwards: deque[tuple[pb.GameEvent, TableState]] = deque(maxlen=MAX_FORWARDS)
        self._work = asyncio.Event()
        self._idle = asyncio.Event()
        self._idle.set()
        self._worker: asyncio.Task[None] | None = None
        self._forwarder: asyncio.Task[None] | None = None
        self._forward_work = asyncio.Event()
        self._all_forwarded = asyncio.Event()
        self._all_forwarded.set()

    async def __aenter__(self) -> Self:
        await self.driver.__aenter__()
        self._worker = asyncio.create_task(self._run(), name="robot acts")
        self._forwarder = asyncio.create_task(self._forward(), name="robot events")
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            if error is None:
                async with asyncio.timeout(self._finish_s):
                    await self.idle()
        except TimeoutError:
            LOG.warning("the robot did not finish its last acts within %g s", self._finish_s)
        finally:
            # Also after Ctrl-C while it finished them.
            for task in (self._worker, self._forwarder):
                if task is not None:
                    task.cancel()
                    await asyncio.gather(task, return_exceptions=True)
            await self.driver.__aexit__(kind, error, trace)

    def seat_at(self, seat: int, live_from: int = 0) -> None:
        """Sets the robot's seat, and the number of the first event to react to."""
        if self.state.seat is None:
            self.live_from = live_from
            self.state = replace(self.state, seat=seat)

    def observe(self, seen: pb.Observation) -> None:
        """Corrects what the robot knows, by the observation of one of its decisions."""
        if self._joined_in_shift and not self._given and not seen.received:
            # Like its turns of the past, the gifts that its seat has already chosen have been carried.
            self._given = layout.pieces_of(seen.gave, self.state.golden and not seen.golden)
        self.state = observe(self.state, seen)
        if self._stand is not None:
            self._stand.settle(tuple(seen.hand), seen.golden)

    def take_turn(self, turn: Turn) -> asyncio.Event:
        """Starts to perform an own turn. Returns an event that is set when its acts have ended."""
        self._announced = turn
        return self._need_turn(turn, self.state)

    def give(self, face: int, receiver: int) -> asyncio.Event:
        """Starts to give a card in the exchange; face F+1 is a joker. Returns as `take_turn`. What the card is is not said."""
        state, stand = self.state, self._stand
        if stand is None or not self._handles_cards:
            return self._need(_Job(()))
        piece = layout.piece_of(face, state.faces)
        if piece not in stand.slots and face == state.faces:
            piece = "golden"  # It is given after the others of its face.
        self._given.append(piece)
        return self._need(self._gift_job([piece], receiver, stand))

    def say(self, text: str, language: str | None = None) -> None:
        """Says a line, before anything less urgent; in the robot's language unless another is given."""
        self._need(_Job((Say(text, language or self.words.language),)))

    def express(self, label: str, valence: float = 0.0, arousal: float = 0.0) -> None:
        """Shows an expression, before anything less urgent."""
        self._need(_Job((Express(label, valence, arousal),)))

    async def idle(self) -> None:
        """Waits until nothing is left to perform and to show."""
        await self._idle.wait()
        await self._all_forwarded.wait()

    def on_event(self, event: pb.GameEvent) -> None:
        """Follows the game, and queues what the robot does about it. Call it for every event, in order."""
        before = self.state
        after = self.state = self._follow(before, event)
        live = event.sequence >= self.live_from
        if self._handles_cards:
            self._follow_cards(event, after, live)
        self._forwards.append((event, after))
        self._all_forwarded.clear()
        self._forward_work.set()
        self._follow_turns(event, before, after, live)
        if not live:
            return
        if self._small_talk:
            self._react(event, after)
        if after.to_act is not None and after.to_act != before.to_act and after.to_act != after.seat:
            face = layout.face_of(after.to_act, after.players)
            self._reaction(Gaze(face.x, face.y, face.z))

    def _follow(self, before: TableState, event: pb.GameEvent) -> TableState:
        """Returns the state after an event; after a correction, the state before the first void event."""
        if event.HasField("shift_started"):
            self._past.clear()
            self._turns.clear()
            self._repeated.clear()
        if not event.HasField("correction"):
            self._past.append((event.sequence, before))
            return follow(before, event)
        first = event.correction.first_void
        if not first:
            return before
        self._repeated = [turn for sequence, turn in self._turns if sequence >= first]
        self._turns = [entry for entry in self._turns if entry[0] < first]
        return next((state for sequence, state in self._past if sequence >= first), before)

    # Cards.

    def _follow_cards(self, event: pb.GameEvent, after: TableState, live: bool) -> None:
        """Keeps the stand as the game has it, and moves the own cards that no decision has moved yet."""
        own = after.seat
        if own is None:
            return
        if self._stand is None and after.players:
            self._stand = Stand.at(own, after.players)
        stand = self._stand
        if stand is None:
            return
        kind = event.WhichOneof("kind")
        if kind == "shift_started":
            stand.fill(after.hand, after.golden)
            self._pass_is_down = False
            self._announced = None
            self._given.clear()
            self._has_given = False
            self._joined_in_shift = not live
        elif kind == "hand_reported":
            stand.settle(after.hand, after.golden)
        elif kind == "cards_exchanged" and event.cards_exchanged.giver == own:
            self._exchanged(event.cards_exchanged, after, stand, live)
        elif kind == "cards_exchanged" and event.cards_exchanged.receiver == own and after.hand:
            # A seat that chooses its gifts receives the others' first. But its own have left the rack before those are put in.
            if self._has_given:
                stand.settle(after.hand, after.golden)
        elif kind in ("pizza_done", "shift_ended"):  # The last pizza of a Shift may not be done.
            self._take_pass_back(after, live)

    def _take_pass_back(self, state: TableState, live: bool = True) -> None:
        """Takes the own pass card back, if it lies on the field."""
        own = state.seat
        if own is None or not self._pass_is_down:
            return
        self._pass_is_down = False
        place = layout.pass_place(own)
        if live and place is not None:
            move = CardMove("pass", place, layout.pass_rest(own, state.players))
            self._need(_Job((Pick((move,)),), self.words.say("please_return_pass")))

    def _exchanged(self, given: pb.CardsExchanged, after: TableState, stand: Stand, live: bool) -> None:
        """Carries the gifts that no decision has carried: those without a choice, and what a default decision gave instead."""
        pieces = [layout.piece_of(face, after.faces) for face in given.cards]
        if given.golden:
            pieces[pieces.index(str(after.faces))] = "golden"
        wrong = []
        for piece in self._given:
            if piece in pieces:
                pieces.remove(piece)
            else:
                wrong.append(piece)
        self._given.clear()
        self._has_given = True
        if live and wrong:
            text = self.words.say("please_take_back", cards=self.words.some_cards(len(wrong)))
            self.say(text)
            self._notify(Notice("help", text, "the decision was too late, and the default decision counted"))
        if pieces:
            job = self._gift_job(pieces, given.receiver, stand)
            if live:
                self._need(job)
        stand.settle(after.hand, after.golden)

    def _gift_job(self, pieces: Sequence[str], receiver: int, stand: Stand) -> _Job:
        """Returns how gifts are carried to their receiver, and takes them out of the rack."""
        state, words = self.state, self.words
        moves = stand.take(pieces, [layout.gift_place(receiver, state.players)] * len(pieces))
        name, count = state.name(receiver), words.some_cards(len(moves))
        spoken = Say(words.say("give", count=count, name=name), words.language)
        return _Job((spoken, Pick(moves)), words.say("please_give", count=count, name=name))

    def _need_turn(self, turn: Turn, state: TableState, live: bool = True) -> asyncio.Event:
        """Queues what the robot does for a turn in a state. A turn of the past only changes where its cards are."""
        if not turn.is_pass:
            self._take_pass_back(state, live)
        job = self._turn_job(turn, state)
        return self._need(job) if live else job.done

    def _turn_job(self, turn: Turn, state: TableState) -> _Job:
        """Returns what the robot does for a turn in a state, and takes the cards out of its stand."""
        words = self.words
        if turn.is_pass:
            said = words.say("pass")
            plea = words.say("please_pass")
        else:
            cards = words.cards(turn.face, turn.quantity, turn.jokers)
            last = bool(state.hand) and sum(state.hand) == turn.quantity + turn.jokers
            said = words.say("last_cards" if last else "play", cards=cards)
            plea = words.say("please_lay", cards=words.my_cards(turn.face, turn.quantity, turn.jokers))
        acts: list[Act] = [Say(said, words.language)] if self._announces else []
        if self._handles_cards and (moves := self._moves(turn, state)):
            end = moves[0].end
            acts += [Gaze(end.x, end.y), Pick(moves)]
        return _Job(tuple(acts), plea)

    def _moves(self, turn: Turn, state: TableState) -> tuple[CardMove, ...]:
        own = state.seat
        if own is None:
            return ()
        if turn.is_pass:
            place = layout.pass_place(own)
            if place is None or self._pass_is_down:
                return ()
            self._pass_is_down = True
            return (CardMove("pass", layout.pass_rest(own, state.players), place),)
        golden = plays_golden(state, turn.face, turn.quantity)
        if not state.hand:  # A spectator sees no hand, only that the opening includes the Golden card.
            golden = state.opening and state.golden_opening and turn.face == state.faces
        pieces = layout.pieces_of_play(turn.face, turn.quantity, turn.jokers, golden)
        stand = self._stand if self._stand is not None else Stand.at(own, state.players)
        return stand.take(pieces, layout.play_places(len(pieces)))

    def _own_turn(self, sequence: int, turn: Turn, before: TableState, after: TableState, live: bool) -> None:
        """Confirms the announced turn, or performs the one that counted instead."""
        self._turns.append((sequence, turn))
        if self._repeated:
            if self._repeated.pop(0) == turn:
                return  # It has been performed: only what happened before it was corrected.
            self._repeated.clear()
        announced, self._announced = self._announced, None
        if announced == turn:
            return
        if announced is not None and not announced.is_pass and self._handles_cards:
            # The decision was too late: its cards lie on the table, but something else counted.
            cards = self.words.my_cards(announced.face, announced.quantity, announced.jokers)
            text = self.words.say("please_take_back", cards=cards)
            self.say(text)
            self._notify(Notice("help", text, "the decision was too late, and the default decision counted"))
        self._need_turn(turn, before, live)
        if self._stand is not None and after.hand:
            self._stand.settle(after.hand, after.golden)

    def _follow_turns(self, event: pb.GameEvent, before: TableState, after: TableState, live: bool) -> None:
        """Performs what the own seat did, unless it is of the past."""
        own = after.seat
        match event.WhichOneof("kind"):
            case "play" if event.play.seat == own:
                play = event.play
                turn = Turn(play.face if play.quantity else 0, play.quantity, play.jokers)
                self._own_turn(event.sequence, turn, before, after, live)
            case "pass" if getattr(event, "pass").seat == own:
                self._own_turn(event.sequence, PASS, before, after, live)
            case "special_action_declared" if event.special_action_declared.seat == own and live and self._announces:
                food_fight = event.special_action_declared.action == pb.SPECIAL_ACTION_FOOD_FIGHT
                self.say(self.words.say("food_fight" if food_fight else "dinner"))

    # Reactions.

    def _react(self, event: pb.GameEvent, after: TableState) -> None:
        """Comments on the game, and shows what the robot feels about it."""
        own = after.seat
        match event.WhichOneof("kind"):
            case "game_started" if own is not None:
                self._reaction(Express("joy", 0.6, 0.4), self._line("hello", name=after.name(own)))
            case "special_action_declared" if event.special_action_declared.seat == own:
                self.express("amusement", 0.6, 0.7)
            case "special_action_declared":
                self._reaction(Express("surprise", 0.1, 0.8))
            case "pizza_done" if event.pizza_done.HasField("last_to_play"):
                if own is not None and event.pizza_done.last_to_play == own == after.to_act:
                    self._reaction(self._line("lead"))
            case "shift_ended" if own is not None:
                self._place(list(event.shift_ended.order).index(own) + 1, after.players)
            case "game_ended" if own is not None:
                best = event.game_ended.standings[0].seat
                if best == own:
                    self._reaction(Express("joy", 0.9, 0.8), self._line("win"))
                else:
                    self._reaction(self._line("lose", name=after.name(best)), Express("sadness", -0.3, -0.2))
            case "game_aborted":
                self._reaction(self._line("aborted"))

    def _place(self, place: int, players: int) -> None:
        """Reacts to the own place in a Shift."""
        if place == 1:
            self._reaction(Express("joy", 0.8, 0.6), self._line("finish_first"))
        elif place == players:
            self._reaction(Express("sadness", -0.6, -0.3), self._line("finish_last"))
        else:
            self._reaction(self._line("finish_middle", place=place))

    def _line(self, key: str, **values: object) -> Say:
        return Say(self.words.say(key, **values), self.words.language)

    # The queues.

    def _need(self, job: _Job) -> asyncio.Event:
        self._needed.append(job)
        self._reactions.clear()
        self._wake()
        return job.done

    def _reaction(self, *acts: Act) -> None:
        self._reactions.append(_Job(acts))
        self._wake()

    def _wake(self) -> None:
        self._idle.clear()
        self._work.set()

    async def _run(self) -> None:
        """Performs jobs in order, the needed ones first."""
        while True:
            if job := self._next():
                await self._perform(job)
            else:
                self._work.clear()
                self._idle.set()
                await self._work.wait()

    def _next(self) -> _Job | None:
        waiting = self._needed or self._reactions
        return waiting.popleft() if waiting else None

    async def _perform(self, job: _Job) -> None:
        try:
            for act in job.acts:
                outcome = await self._attempt(act)
                if isinstance(outcome, Failed):
                    await self._failed(act, outcome.reason, job.plea)
        except Exception:
            LOG.exception("an act could not be performed")
        finally:
            job.done.set()

    async def _attempt(self, act: Act) -> Outcome:
        outcome = await attempt(self.driver, act, self._times.of(act))
        self._on_act(act, outcome)
        return outcome

    async def _failed(self, act: Act, reason: str, plea: str) -> None:
        """Reports a failed act to the attendant; for cards, also asks the people at the table, and points at the place.

        Other failures are only logged.
        """
        LOG.info("%s failed: %s", type(act).__name__, reason)
        if isinstance(act, Say):
            self._notify(Notice("unsaid", act.text, reason))
        if isinstance(act, Pick):
            self._notify(Notice("help", plea, reason, act.moves))
            outcome = await self._attempt(Say(plea, self.words.language))
            if isinstance(outcome, Failed):
                self._notify(Notice("unsaid", plea, outcome.reason))
            end = act.moves[0].end
            await self._attempt(Point(end.x, end.y))

    async def _forward(self) -> None:
        """Shows events and states to the driver, independently of acts."""
        while True:
            if not self._forwards:
                self._all_forwarded.set()
            await self._forward_work.wait()
            self._forward_work.clear()
            while self._forwards:
                event, state = self._forwards.popleft()
                try:
                    async with asyncio.timeout(self._times.gaze):
                        await self.driver.show_event(event)
                        await self.driver.show_state(state)
                except Exception as error:
                    LOG.debug("the robot was not shown event %d: %s", event.sequence, describe(error))
