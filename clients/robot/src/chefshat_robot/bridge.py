"""The bridge: reports what perception sees to the table of a physical room, and brings answers back.

Perception is certain about cards and places; what they mean (whose turn, a play or an addition to one) is decided here and by the
referee in the server. Nothing is guessed: what perception or the bridge cannot decide becomes a question of the table, which an
attendant answers on the page, in the terminal, or by the robot's voice.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import aclosing
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol, TypeAlias

import cv2
from chefshat import ChefsHatError, pb

from chefshat_robot.deck import FACES, Card
from chefshat_robot.vision import (
    Cleared,
    Doubt,
    DoubtResolved,
    FieldChanged,
    FieldState,
    Frame,
    Laid,
    Observed,
    Picture,
    SourceError,
    TakenBack,
)
from chefshat_robot.vision import PassShown as PassSeen
from chefshat_robot.vision import PassWithdrawn as PassGone
from chefshat_robot.vision.hand import HandReader
from chefshat_robot.vision.perception import Perception

LOG = logging.getLogger("chefshat_robot")
MAX_PICTURE_BYTES = 32 * 1024
"""The largest picture a question may have."""

SIDES = 4
"""At tables with so many seats or fewer, each has a side of the field of its own."""

AWAY_S = 5.0
"""Seconds that a report takes until a warning says that the server is away."""

WITHDRAW_S = 3.0
"""Seconds for withdrawing open questions at the end: the server may be away."""

OnAnswer: TypeAlias = Callable[[int | None], Awaitable[None]]
"""What is done with the index of the right option of a question; None if somebody withdrew it."""

_QUESTION_IDS = "bridge-"
"""Ids of the questions of bridges begin so. A table has one bridge."""

_COUNTS = (pb.REPORT_VERDICT_ACCEPTED, pb.REPORT_VERDICT_KNOWN, pb.REPORT_VERDICT_HELD)


class Table(Protocol):
    """The calls that a bridge makes, as `chefshat.aio.Client.tables` has them."""

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        """Reports something that happened. Repeats it while the server is away."""

    def watch(self, table_ticket: str) -> AsyncIterator[pb.TableState]:
        """Iterates over the states of the table."""


def seen_cards(cards: list[Card]) -> pb.SeenCards:
    """The cards as a report states them."""
    return pb.SeenCards(cards=sorted(card.face for card in cards), golden=any(card.is_golden for card in cards))


def face_name(face: int) -> str:
    """How a question names a face: its number, or "Joker"."""
    return "Joker" if face > FACES else str(face)


@dataclass
class _Play:
    """The cards laid last.

    Attributes:
        cards: The cards.
        places: Where they lie, 1..11.
        report: The number of the report; 0 if it does not count.
        seat: Who laid them; None if that is not known.
        complete: Whether they are what a remote seat decided, or what the table knew: nothing can be added.
    """

    cards: list[Card]
    places: set[int]
    report: int
    seat: int | None
    complete: bool


@dataclass(frozen=True)
class _Question:
    """An open question.

    Attributes:
        number: Its id, which no other question has.
        on_answer: What is done with the answer.
    """

    number: str
    on_answer: OnAnswer


@dataclass
class Bridge:
    """Joins perception and a physical table.

    Args:
        table: The calls about tables of the connection to the server.
        ticket: The ticket of the table.
        perception: What watches the field.
        on_report: Called with each report and its response, for a display or a log.

    Attributes:
        state: The newest state of the table; None before the first.
    """

    table: Table
    ticket: str
    perception: Perception
    on_report: Callable[[pb.TableReport, pb.ReportResponse], None] = lambda _report, _response: None
    state: pb.TableState | None = None
    _session: str = field(default_factory=lambda: secrets.token_hex(4))
    _reports: int = 0
    _play: _Play | None = None
    _questions: int = 0
    _asked: dict[str, _Question] = field(default_factory=dict)
    """The open questions, by their names."""
    _found: dict[Card, int] = field(default_factory=dict)
    """The cards that are asked about because they were found, and the place of each."""
    _held: list[Observed] = field(default_factory=list)
    """What happened since the open questions about plays."""
    _known: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when the state of the table is known."""
    _perceiving: asyncio.Lock = field(default_factory=asyncio.Lock)
    _seen: asyncio.Queue[list[Observed]] = field(default_factory=asyncio.Queue)
    """What is to be reported, in the order in which it happened."""

    async def run(self, frames: Iterator[Frame], after: Callable[[Frame], Awaitable[None]] | None = None) -> None:
        """Watches until the frames or the game end. Frames are watched also while a report waits for the server.

        Args:
            frames: The frames of the camera.
            after: Called after each frame has been reported; the next one then waits for it.

        Raises:
            ChefsHatError: The server refused a report or could not be reached any more.
        """
        self._seen = asyncio.Queue()
        watching, seeing = asyncio.create_task(self._watch()), asyncio.create_task(self._see(frames, after))
        for task in (watching, seeing):
            # Its end is noticed below.
            task.add_done_callback(lambda _: self._seen.put_nowait([]))
        try:
            # What the last answers lead to is reported, too.
            while not self._is_over() and not (seeing.done() and self._seen.empty()):
                for event in await self._seen.get():
                    await self.observed(event)
                await self._take_answers()
                await self._release()
                self._seen.task_done()
                for task in (watching, seeing):
                    if task.done():
                        task.result()
        except ChefsHatError as error:
            # A remote seat may end the game before its last cards are laid.
            if error.reason != "GAME_OVER":
                raise
        finally:
            for task in (watching, seeing):
                task.cancel()
            await asyncio.gather(watching, seeing, return_exceptions=True)
            await self._withdraw_all()

    async def _see(self, frames: Iterator[Frame], after: Callable[[Frame], Awaitable[None]] | None) -> None:
        """Watches the frames."""
        await self._known.wait()
        await self._withdraw_orphans()
        while (frame := await asyncio.to_thread(next, frames, None)) is not None:
            await self._perceived(partial(self.perception.see, frame))
            if after is not None:
                await self._seen.join()
                await after(frame)

    async def _perceived(self, perceive: Callable[[], list[Observed]]) -> None:
        """Lets perception see or hear something, and reports what it makes of it after all that it has told before."""
        async with self._perceiving:
            self._seen.put_nowait(await asyncio.to_thread(perceive))

    async def watch_hand(self, seat: int, reader: HandReader, frames: Iterator[Frame]) -> None:
        """Watches the hand of a seat and reports it whenever the table waits for it.

        Args:
            seat: The seat, from 0.
            reader: Reads the frames.
            frames: The frames of the camera at the hand strip.

        Raises:
            ChefsHatError: The server refused a report or could not be reached any more.
        """
        hand: list[Card] = []
        reported: tuple[int, list[Card]] | None = None
        reason = "they have ended"
        try:
            while not self._is_over() and (frame := await asyncio.to_thread(next, frames, None)) is not None:
                seen = await asyncio.to_thread(reader.see, frame)
                if seen is not None:
                    hand = list(seen.cards)
                # One that was refused is not reported again in the same Shift.
                if self._awaits_hand(seat, len(hand)) and (now := (self._shift(), hand)) != reported:
                    reported = now
                    await self._report(pb.TableReport(hand=pb.HandSeen(seat=seat, cards=seen_cards(hand))))
        except SourceError as error:
            # The attendant can type the hand, so the camera above the table is still watched.
            reason = str(error)
        if not self._is_over():
            LOG.warning("the camera at the hand of %s gives no more pictures: %s", self._name(seat), reason)

    def _shift(self) -> int:
        """The number of the Shift; 0 before the first state."""
        return self.state.observation.shift if self.state is not None else 0

    def _awaits_hand(self, seat: int, size: int) -> bool:
        """Whether the table waits for the hand of a seat, and as many cards are seen as it has."""
        state = self.state
        if state is None or state.stage != pb.TABLE_STAGE_HAND or state.seat != seat:
            return False
        return state.observation.cards_left[seat] == size

    async def observed(self, event: Observed) -> None:
        """Reports an event of perception. While a question about a play is open, what happens at the table waits for the answer."""
        match event:
            case PassGone() if f"found-pass-{event.seat}" in self._asked:
                await self._withdraw(f"found-pass-{event.seat}")
            case Cleared() if not self._held and "added" not in self._asked:
                await self._withdraw("taken-back")
                await self._withdraw("found")
                self._found = {}
                await self._report_event(event)
            case Laid() | TakenBack() | Cleared() | PassSeen() | PassGone() if self._asks_about_play() and not _is_found(event):
                self._held.append(event)
            case _:
                await self._report_event(event)
        await self._release()

    async def _release(self) -> None:
        """Reports what waited, until a question about a play is open."""
        while self._held and not self._asks_about_play():
            await self._report_event(self._held.pop(0))

    def _asks_about_play(self) -> bool:
        """Whether a question is open whose answer decides what was played: its place in the order is before what happens now."""
        return any(name in ("added", "taken-back") or name.startswith("found") for name in self._asked)

    async def _report_event(self, event: Observed) -> None:
        if self._is_over():
            return
        match event:
            case Laid(found=True) if self._may_be_old():
                await self._ask_about(dict(zip(event.cards, event.places, strict=True)))
            case Laid():
                seat = None if event.found else self._seat_at(event.side)
                await self._laid(list(event.cards), set(event.places), seat)
            case TakenBack():
                await self._taken_back(list(event.cards))
            case Cleared():
                self._play = None
                await self._report(pb.TableReport(cleared=pb.BoardCleared()))
            case PassSeen(found=True) if not self._has_passed(event.seat):
                await self._ask_about_pass(event.seat)
            case PassSeen():
                await self._passed(event.seat)
            case PassGone() if self._has_passed(event.seat):
                await self._report(pb.TableReport(pass_withdrawn=pb.PassWithdrawn(seat=event.seat)))
            case PassGone():
                pass  # The pizza is over: all take their pass cards back.
            case Doubt():
                await self._doubt(event)
            case DoubtResolved():
                await self._withdraw(f"doubt-{event.number}")
            case FieldChanged(state=FieldState.LOST):
                text = "The camera does not see the four corners of the field. Uncover them, or turn the camera back."
                await self._ask("field", text, ["Done", "The camera is broken"], self._look_again)
            case FieldChanged():
                await self._withdraw("field")

    def _seat_at(self, side: int | None) -> int | None:
        """The seat that laid cards from a side of the field; None if it is not sure: those of remote seats come from anywhere."""
        state = self.state
        if side is None or state is None or len(state.seats) > SIDES or any(wanted.pizza for wanted in state.to_lay):
            return None
        return side if side < len(state.seats) and state.seats[side].at_table else None

    def _may_be_old(self) -> bool:
        """Whether cards that were found may be of a pizza that is over: perhaps no play of this one lies there yet."""
        state = self.state
        return state is None or not state.observation.board_size or any(wanted.pizza for wanted in state.to_lay)

    async def _ask_about(self, found: dict[Card, int]) -> None:
        """Asks whether cards that were found, and those found just before, are a new play."""
        self._found.update(found)
        cards = list(self._found)

        async def answer(option: int | None) -> None:
            places, self._found = set(self._found.values()), {}
            if option == 0:
                await self._new_play(cards, places, None)

        text = f"{_names(cards)} found on the field: is it a new play?"
        await self._ask("found", text, ["Yes, a new play", "No, it lies there from before"], answer)

    async def _ask_about_pass(self, seat: int) -> None:
        """Asks whether a pass card that was found is shown in this pizza."""

        async def answer(option: int | None) -> None:
            if option == 0:
                await self._passed(seat)

        text = f"The pass card of {self._name(seat)} lies at its place: is it shown in this pizza?"
        await self._ask(f"found-pass-{seat}", text, ["Yes", "No, it lies there from before"], answer)

    async def _passed(self, seat: int) -> None:
        """Reports a pass."""
        report = pb.TableReport()
        # `pass` is a keyword of Python.
        getattr(report, "pass").CopyFrom(pb.PassShown(seat=seat))
        await self._report(report)

    async def _laid(self, cards: list[Card], places: set[int], seat: int | None) -> None:
        """Reports cards on the board: a play, or perhaps an addition to the last one."""
        play = self._play
        if play is None or play.complete or play.places & places or not _may_belong(cards, play.cards):
            await self._new_play(cards, places, seat)
            return

        async def add(option: int | None) -> None:
            if option == 1:
                await self._new_play(cards, places, seat)
            elif option == 0 and self._play is play:
                play.cards, play.places = play.cards + cards, play.places | places
                await self._replace(play)

        if not play.report:
            await add(0)
            return
        text = f"{_names(cards)} laid beside {_names(play.cards)}: do they belong to this play?"
        await self._ask("added", text, ["Yes, it is one play", "No, somebody else laid them"], add)

    async def _new_play(self, cards: list[Card], places: set[int], seat: int | None) -> None:
        seen = seen_cards(cards)
        decided = [wanted.cards.cards for wanted in self.state.to_lay if wanted.pizza] if self.state is not None else []
        response = await self._report(pb.TableReport(laid=pb.CardsLaid(seat=seat, cards=seen)))
        number = response.report if response.verdict in (pb.REPORT_VERDICT_ACCEPTED, pb.REPORT_VERDICT_HELD) else 0
        complete = response.verdict == pb.REPORT_VERDICT_KNOWN or list(seen.cards) in [list(faces) for faces in decided]
        self._play = _Play(cards, places, number, seat, complete)

    async def _taken_back(self, cards: list[Card]) -> None:
        """Cards were taken back. A play that counts is taken back only if somebody says so."""
        play = self._play
        if play is None or play.complete or not set(cards) & set(play.cards):
            return

        async def take_back(option: int | None) -> None:
            if option == 0 and self._play is play:
                play.cards = [card for card in play.cards if card not in cards]
                await self._replace(play)

        if not play.report:
            await take_back(0)
            return
        text = f"{_names(cards)} taken from the board: is it taken back?"
        await self._ask("taken-back", text, ["Yes, it does not count", "No, it stands"], take_back)

    async def _look_again(self, _option: int | None) -> None:
        """Perception looks for the field all the time."""

    async def _replace(self, play: _Play) -> None:
        """Reports that the last play has other cards than reported."""
        if not play.report:
            self._play = None
            if play.cards:
                await self._new_play(play.cards, play.places, play.seat)
            return
        instead = pb.TableReport(laid=pb.CardsLaid(seat=play.seat, cards=seen_cards(play.cards))) if play.cards else None
        try:
            response = await self._report(pb.TableReport(correction=pb.ReportCorrection(report=play.report, instead=instead)))
        except ChefsHatError as error:
            if error.reason != "NOT_CORRECTABLE":
                raise
            LOG.warning("the table refused a correction: %s", error)
        else:
            if play.cards and response.verdict not in _COUNTS:
                LOG.warning("the table refused a correction: %s", response.detail)
        if not play.cards:
            self._play = None

    async def _doubt(self, doubt: Doubt) -> None:
        """Asks what lies at a place."""
        readings: list[Card | bool]
        if doubt.place.startswith("pass "):
            readings, names = [True, False], ["Yes", "No"]
            text = f"Does the pass card of {self._name(int(doubt.place.removeprefix('pass ')))} lie at its place?"
        else:
            cards = list(doubt.options) if len(doubt.options) > 1 else self.perception.answers(int(doubt.place))
            readings, names = [*cards, False], [face_name(card.face) for card in cards]
            text = f"{' or '.join(names) if len(names) <= 3 else 'Which card lies'} at place {doubt.place}?"
            names.append("No new card")

        def tell(reading: Card | bool | None) -> list[Observed]:
            # The camera may have read the place while the answer was on its way.
            return self.perception.answer(doubt.number, reading) if self.perception.is_open(doubt.number) else []

        async def answer(option: int | None) -> None:
            await self._perceived(partial(tell, None if option is None else readings[option]))

        await self._ask(f"doubt-{doubt.number}", text, names, answer, doubt.picture)

    async def _ask(self, name: str, text: str, options: list[str], on_answer: OnAnswer, picture: Picture | None = None) -> None:
        """Asks the people at the table. A question of the same name that is still open is withdrawn."""
        await self._withdraw(name)
        self._questions += 1
        number = f"{_QUESTION_IDS}{self._session}-{name}-{self._questions}"
        self._asked[name] = _Question(number, on_answer)
        question = pb.TableQuestion(question_id=number, text=text, options=options, picture=_encoded(picture))
        await self._report(pb.TableReport(question=question))

    async def _withdraw(self, name: str) -> None:
        """Withdraws a question that needs no answer any more."""
        question = self._asked.pop(name, None)
        if question is not None:
            await self._report(pb.TableReport(answer=pb.QuestionAnswered(question_id=question.number)))

    async def _withdraw_orphans(self) -> None:
        """Withdraws the questions of a bridge that ended without doing so: nobody would hear the answers."""
        for question in self.state.questions if self.state is not None else ():
            if question.question_id.startswith(_QUESTION_IDS):
                await self._report(pb.TableReport(answer=pb.QuestionAnswered(question_id=question.question_id)))

    async def _withdraw_all(self) -> None:
        """Withdraws the open questions: nobody would hear the answers. The next bridge withdraws what this one cannot."""
        with contextlib.suppress(ChefsHatError, TimeoutError):
            async with asyncio.timeout(WITHDRAW_S):
                for name in list(self._asked):
                    await self._withdraw(name)

    async def _take_answers(self) -> None:
        """Does what the answers that arrived ask for."""
        answers = {answer.question_id: answer for answer in self.state.answers} if self.state is not None else {}
        for name, question in list(self._asked.items()):
            answer = answers.get(question.number)
            # What an earlier answer led to may have withdrawn it.
            if answer is None or self._asked.get(name) is not question:
                continue
            del self._asked[name]
            await question.on_answer(answer.option if answer.HasField("option") else None)

    async def _report(self, report: pb.TableReport) -> pb.ReportResponse:
        """Reports something. The table repeats it while the server is away."""
        report.source = pb.REPORT_SOURCE_CAMERA
        self._reports += 1
        late = asyncio.get_running_loop().call_later(
            AWAY_S, LOG.warning, "the server is away; a report is tried again until it is back"
        )
        try:
            response = await self.table.report(self.ticket, report, report_id=f"{self._session}-{self._reports}")
        finally:
            late.cancel()
        self._newer(response.state)
        self.on_report(report, response)
        return response

    async def _watch(self) -> None:
        async with aclosing(self.table.watch(self.ticket)) as states:  # type: ignore[type-var]
            async for state in states:
                self._newer(state)

    def _newer(self, state: pb.TableState) -> None:
        if self.state is None or state.version >= self.state.version:
            self.state = state
        self._known.set()

    def _is_over(self) -> bool:
        return self.state is not None and self.state.stage == pb.TABLE_STAGE_OVER

    def _has_passed(self, seat: int) -> bool:
        """Whether a seat is out of the pizza in progress."""
        return self.state is not None and seat < len(self.state.observation.passed) and self.state.observation.passed[seat] == 1

    def _name(self, seat: int) -> str:
        seats = self.state.room.seats if self.state is not None else ()
        return seats[seat].name if seat < len(seats) else f"seat {seat}"


def _is_found(event: Observed) -> bool:
    """Whether something was found."""
    return isinstance(event, Laid | PassSeen) and event.found


def _may_belong(cards: list[Card], to: list[Card]) -> bool:
    """Whether cards may be an addition to a play: they have its face, or are jokers. A new play must have a lower face."""
    faces = {card.face for card in to if not card.is_joker}
    return bool(faces) and all(card.is_joker or card.face in faces for card in cards)


def _names(cards: list[Card]) -> str:
    """The faces of cards, for a question."""
    return ", ".join(face_name(card.face) for card in cards)


def _encoded(picture: Picture | None) -> bytes:
    """The picture as JPEG within the limit; empty if there is none."""
    if picture is None:
        return b""
    for quality in (85, 60, 30):
        done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if done and data.nbytes <= MAX_PICTURE_BYTES:
            return data.tobytes()
    return b""
