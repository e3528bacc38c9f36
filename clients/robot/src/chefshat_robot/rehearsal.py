"""A rehearsal: a game at a synthetic table, for trying everything without cards, camera or robot.

Simulated people hold the cards of a printed deck and play them under a simulated camera; perception and the bridge read the frames
and report to a physical room of a real server, in which remote agents, robots and people on the page play along. The people here
know the rules only from what the table's state says (`PlayRequirement`), as people at a table do who ask the referee.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from chefshat import pb

from chefshat_robot.bridge import face_name, seen_cards
from chefshat_robot.deck import FACES, Card, deck
from chefshat_robot.synthetic import Act, Clear, LayCards, ShowPass, SyntheticTable, TakeBack, WithdrawPass
from chefshat_robot.vision.frames import Frame

PAUSE_S = 0.8
"""Time between the end of one act and the start of the next, by the clock of the frames."""
PATIENCE_S = 6.0
"""How long people wait for the table to notice what they did, by the clock of the frames, before they do something else."""
AGAIN_S = 12.0
"""How long they wait before they lay the same cards again."""
UP_S = 2.0
"""Time to take cards up before they are laid again."""
MAX_PLACES = 11


class Attendant(Protocol):
    """How the people at the table report what no camera sees, as `chefshat.aio.Client.tables` does."""

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        """Reports something that happened."""


@dataclass
class Rehearsal:
    """Simulated people at a synthetic table, the cards of all seats, and an attendant.

    The cards of remote seats lie before the attendant, who lays what these seats decide.

    Args:
        table: The synthetic table; its frames are taken by `frames`.
        attendant: The calls about tables of the connection to the server.
        ticket: The ticket of the table.
        players: Number of seats, 2..4.
        deck_number: The deck on the table.
        seed: Decides the deals and what people play.
        mistakes: How often a person first plays a card that the rules do not allow, 0..1.
        face_down: How often a card is laid with its back up, 0..1, so that the camera must ask.
        answers: Whether the attendant answers questions; otherwise somebody else does, on the page for instance.

    Attributes:
        hands: The cards of each seat.
        plays: What was truly played, in order: the seat and its cards.
        violations: How many plays were against the rules on purpose.
    """

    table: SyntheticTable
    attendant: Attendant
    ticket: str
    players: int = 4
    deck_number: int = 0
    seed: int = 0
    mistakes: float = 0.0
    face_down: float = 0.0
    answers: bool = True
    hands: list[list[Card]] = field(default_factory=list)
    plays: list[tuple[int, list[Card]]] = field(default_factory=list)
    violations: int = 0
    _dealt: int = 0
    _gifts: dict[int, list[Card]] = field(default_factory=dict)
    _exchanged: bool = True
    _expected: tuple[int, float] | None = None
    _mistake: LayCards | None = None
    _carried_out: pb.CardsToLay | None = None
    _lying: list[LayCards] = field(default_factory=list)
    _laid: tuple[int, int, int] | None = None
    """The Shift, the seat and the cards it had left, as the table knew them, when a person laid cards last."""
    _again: float = 0.0
    """When cards that were laid are laid again if the table has not noticed them, in s."""
    _shown: set[int] = field(default_factory=set)
    _pizza: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        """Seeds the people."""
        self._rng = random.Random(f"rehearsal {self.seed}")

    def frames(self) -> Iterator[Frame]:
        """The frames of the camera, without end."""
        self.table.duration = float("inf")
        for frame, _truth in self.table.frames():
            yield frame

    async def step(self, state: pb.TableState, time: float) -> None:
        """Does what people do next, if they are not waiting for the table to notice what they did.

        Args:
            state: The newest state of the table.
            time: Time of the last frame, in s.
        """
        if state.paused or time < self.table.busy_until + PAUSE_S or not state.HasField("observation"):
            return
        if self._expected is not None:
            version, until = self._expected
            if state.version <= version and time < until:
                return
            self._expected = None
        if state.observation.shift > self._dealt:
            self._deal(state)
        acts = await self._next(state, time)
        if acts is not None:
            self._do(acts, state)

    def _do(self, acts: Sequence[Act], state: pb.TableState) -> None:
        """Lets hands act, and waits for the table to notice it."""
        for act in acts:
            self.table.perform(act)
        self._expected = (state.version, self.table.busy_until + PATIENCE_S)

    def _deal(self, state: pb.TableState) -> None:
        """Shuffles and deals the cards of a Shift."""
        self._dealt = state.observation.shift
        cards = deck(self.deck_number)
        self._rng.shuffle(cards)
        size = len(cards) // self.players
        self.hands = [sorted(cards[seat * size : (seat + 1) * size]) for seat in range(self.players)]
        aside = cards[self.players * size :]
        golden = next((card for card in aside if card.is_golden), None)
        if golden is not None:
            # The Golden card is always dealt (docs/rules.md).
            self.hands[0][-1] = golden
        self._gifts = {}
        self._exchanged = self._dealt == 1

    async def _next(self, state: pb.TableState, time: float) -> list[Act] | None:
        """What happens next: acts of hands, or None if somebody else's turn has come or something was reported."""
        start = time + 0.05
        if state.questions:
            if self.answers:
                await self._answer(state, state.questions[0])
            return None
        if self._mistake is not None:
            act, counts = self._mistake, self._counts_mistake(state)
            if not (state.HasField("violation") or counts or start >= self._again):
                return None
            self._mistake = self._laid = None
            if not counts:
                # The table refuses it; or it says nothing for long, and the person thinks again.
                self._lying.remove(act)
                return [TakeBack(start, act.seat, act.places)]
            # It counts: the cards stay where they are.
            self._play(act.seat, list(act.cards))
        wanted = next(iter(state.to_lay), None)
        pizza = self._pizza_of(state)
        if (self._lying or self._shown) and pizza != self._pizza:
            return self._sweep(state, start)
        self._pizza = pizza
        if wanted is not None:
            return await self._carry_out(state, wanted, start)
        match state.stage:
            case pb.TABLE_STAGE_HAND:
                if not self._exchanged and self._gifts:
                    self._exchange(state)
                await self._report(hand=pb.HandSeen(seat=state.seat, cards=seen_cards(self.hands[state.seat])))
            case pb.TABLE_STAGE_SPECIAL_ACTION:
                await self._special(state)
            case pb.TABLE_STAGE_GIFT if state.seats[state.seat].at_table:
                await self._give(state)
            case pb.TABLE_STAGE_OPENING | pb.TABLE_STAGE_TURN:
                if not self._exchanged:
                    self._exchange(state)
                seat = self._opener() if state.stage == pb.TABLE_STAGE_OPENING else state.seat
                if state.seats[seat].at_table:
                    return self._take_turn(state, seat, start)
            case pb.TABLE_STAGE_CONFIRMATION:
                await self._report(end_confirmed=pb.EndConfirmed())
        return None

    @staticmethod
    def _pizza_of(state: pb.TableState) -> tuple[int, int]:
        """The Shift and pizza of which cards are laid next."""
        wanted = next(iter(state.to_lay), None)
        if wanted is not None and wanted.pizza:
            return wanted.shift, wanted.pizza
        return state.observation.shift, state.observation.pizza

    def _opener(self) -> int:
        """The seat with the Golden card."""
        return next(seat for seat, hand in enumerate(self.hands) if any(card.is_golden for card in hand))

    def _take_turn(self, state: pb.TableState, seat: int, start: float) -> list[Act] | None:
        """A person plays or passes, or waits for the table to notice its cards, and lays them again if it does not."""
        if self._laid == _left(state, seat):
            return self._lay_again(start)
        required = state.play_requirement
        if state.stage == pb.TABLE_STAGE_OPENING or required.golden_card:
            required = pb.PlayRequirement(lowest_face=FACES, highest_face=FACES, fewest_cards=1, golden_card=True)
        plays = _plays(self.hands[seat], required)
        if self._rng.random() < self.mistakes and required.highest_face < FACES and not required.golden_card:
            wrong = [card for card in self.hands[seat] if required.highest_face < card.face <= FACES]
            if wrong:
                self.violations += 1
                self._laid = _left(state, seat)
                self._mistake = self._lay(start, seat, [self._rng.choice(wrong)], face_down=False)
                return [self._mistake]
        if plays and (not required.may_pass or self._rng.random() < 0.85):
            cards = self._rng.choices(plays, weights=[len(play) ** 3 for play in plays])[0]
            self._play(seat, cards)
            self._laid = _left(state, seat)
            return [self._lay(start, seat, cards)]
        self._shown.add(seat)
        return [ShowPass(start, seat)]

    def _play(self, seat: int, cards: Sequence[Card]) -> None:
        self.plays.append((seat, list(cards)))
        self.hands[seat] = [card for card in self.hands[seat] if card not in cards]

    def _lay(self, start: float, seat: int, cards: Sequence[Card], face_down: bool | None = None) -> LayCards:
        """A hand lays cards on the first places, now and then a single card with its back up."""
        if face_down is None:
            face_down = len(cards) == 1 and self._rng.random() < self.face_down
        act = LayCards(start, seat, tuple(cards), tuple(range(1, len(cards) + 1)), face_down)
        self._again = start + AGAIN_S
        self._lying.append(act)
        return act

    def _lay_again(self, start: float) -> list[Act] | None:
        """The cards that were laid last are taken up and laid again, with their faces up, if they have lain there for long."""
        if start < self._again:
            return None
        act = self._lying.pop()
        again = replace(act, start=start + UP_S, face_down=False)
        self._lying.append(again)
        self._again = again.start + AGAIN_S
        return [TakeBack(start, act.seat, act.places), again]

    def _sweep(self, state: pb.TableState, start: float) -> list[Act]:
        """The pizza is over: the cards are swept away, and all take their pass cards back."""
        seat = state.seat if state.HasField("seat") else 0
        acts: list[Act] = [Clear(start, seat)] if self._lying else []
        acts += [WithdrawPass(start + 0.3 + 0.1 * number, shown) for number, shown in enumerate(sorted(self._shown))]
        self._lying, self._shown = [], set()
        return acts

    async def _carry_out(self, state: pb.TableState, wanted: pb.CardsToLay, start: float) -> list[Act] | None:
        """The attendant does what a remote seat decided."""
        seat = wanted.seat
        if wanted.kind == pb.DECISION_KIND_SPECIAL_ACTION:
            await self._report(special=pb.SpecialActionSeen(seat=seat))
        elif wanted.kind == pb.DECISION_KIND_EXCHANGE:
            self._gifts[seat] = self._take(seat, wanted.cards)
            await self._report(gift=pb.GiftSeen(seat=seat, cards=wanted.cards))
        elif wanted.cards.cards:
            if wanted == self._carried_out:
                # The cards lie there; the camera has not reported them yet.
                return self._lay_again(start)
            self._carried_out = wanted
            cards = self._take(seat, wanted.cards)
            self._play(seat, cards)
            return [self._lay(start, seat, cards)]
        else:
            self._shown.add(seat)
            return [ShowPass(start, seat)]
        return None

    def _take(self, seat: int, wanted: pb.SeenCards) -> list[Card]:
        """Finds cards of these faces in a hand; the Golden card only if it is wanted."""
        cards: list[Card] = []
        hand = sorted(self.hands[seat], key=lambda card: card.is_golden != wanted.golden)
        for face in wanted.cards:
            cards.append(next(card for card in hand if card.face == face and card not in cards))
        return cards

    async def _special(self, state: pb.TableState) -> None:
        """A person with two jokers declares the special action half of the time."""
        holder = next((seat for seat, hand in enumerate(self.hands) if sum(card.is_joker for card in hand) == 2), None)
        declares = holder is not None and state.seats[holder].at_table and self._rng.random() < 0.5
        await self._report(special=pb.SpecialActionSeen(seat=holder if declares else None))

    async def _give(self, state: pb.TableState) -> None:
        """A person chooses what to give; which cards, nobody else sees."""
        count = 2 if state.observation.roles[state.seat] == pb.ROLE_CHEF else 1
        self._gifts[state.seat] = self._rng.sample([card for card in self.hands[state.seat] if not card.is_golden], count)
        await self._report(gift=pb.GiftSeen(seat=state.seat))

    def _exchange(self, state: pb.TableState) -> None:
        """The cards change hands: the chosen ones, and the rarest of those who give without a choice."""
        seat_of = {role: seat for seat, role in enumerate(state.observation.roles)}
        for chooser_role, forced_role, count in ((pb.ROLE_CHEF, pb.ROLE_DISHWASHER, 2), (pb.ROLE_SOUS_CHEF, pb.ROLE_WAITER, 1)):
            chooser, forced = seat_of.get(chooser_role), seat_of.get(forced_role)
            if chooser is None or forced is None or chooser not in self._gifts:
                continue
            plain = [card for card in self.hands[forced] if not card.is_joker]
            rarest = self._gifts.get(forced) or sorted(plain, key=lambda card: (card.face, card.is_golden))[:count]
            given = self._gifts[chooser]
            self.hands[chooser] = sorted([card for card in self.hands[chooser] if card not in given] + rarest)
            self.hands[forced] = sorted([card for card in self.hands[forced] if card not in rarest] + given)
        self._exchanged = True

    async def _answer(self, state: pb.TableState, question: pb.TableQuestion) -> None:
        """The attendant, who sees everything, answers a question."""
        option = self.right_option(state, question)
        await self._report(answer=pb.QuestionAnswered(question_id=question.question_id, option=option))

    def right_option(self, state: pb.TableState, question: pb.TableQuestion) -> int | None:
        """The right answer to a question, as somebody knows who sees everything; None if no option is right."""
        options = list(question.options)
        place = question.text.rpartition("at place ")[2].rstrip("?")
        if place.isdigit():
            last = dict(zip(self._lying[-1].places, self._lying[-1].cards, strict=True)) if self._lying else {}
            new = None if self._counts(state) else last.get(int(place))
            lies = face_name(new.face) if new is not None else "No new card"
            return options.index(lies) if lies in options else None
        if question.text.endswith("is it a new play?"):
            return 1 if self._counts(state) else 0
        if question.text.endswith("is it shown in this pizza?"):
            asked = [seat for seat, taken in enumerate(state.room.seats) if taken.name in question.text]
            return 0 if self._shown.issuperset(asked) and self._pizza == self._pizza_of(state) else 1
        if question.text.endswith("belong to this play?"):
            return 0 if self._mistake is None else 1
        if question.text.startswith("Who opened"):
            return options.index(state.room.seats[self._lying[0].seat].name)
        if question.text.startswith("Did ") and question.text.endswith(" pass?"):
            asked = [seat for seat, taken in enumerate(state.room.seats) if taken.name in question.text]
            return 0 if self._shown.issuperset(asked) else 1
        if question.text.startswith("Is that a new play"):
            faces = [sorted(card.face for card in act.cards) for act in self._lying[-2:]]
            return 0 if len(faces) == 2 and faces[0] == faces[1] else 1
        return 0

    def _counts(self, state: pb.TableState) -> bool:
        """Whether the table knows the cards that lie on top, or none lie there."""
        if not self._lying:
            return True
        if self._mistake is not None:
            return state.HasField("violation") or self._counts_mistake(state)
        seat = self._lying[-1].seat
        if not state.seats[seat].at_table:
            return self._carried_out not in state.to_lay
        return state.observation.cards_left[seat] == len(self.hands[seat])

    def _counts_mistake(self, state: pb.TableState) -> bool:
        """Whether the table took the mistake of a person for a play."""
        assert self._mistake is not None, "somebody has just made one"
        return not state.HasField("violation") and self._laid != _left(state, self._mistake.seat)

    async def _report(self, **kind: object) -> None:
        report = pb.TableReport(source=pb.REPORT_SOURCE_ATTENDANT, **kind)  # type: ignore[arg-type]
        response = await self.attendant.report(self.ticket, report)
        self._expected = (response.state.version - 1, float("inf"))


def _left(state: pb.TableState, seat: int) -> tuple[int, int, int]:
    """The Shift, a seat and the number of its cards, as the table knows them."""
    return state.observation.shift, seat, state.observation.cards_left[seat]


def _plays(hand: list[Card], required: pb.PlayRequirement) -> list[list[Card]]:
    """The plays of a hand that the table allows, one for each face, number of cards and number of jokers."""
    jokers = [card for card in hand if card.is_joker]
    plays = [[joker] for joker in jokers[:1] if required.lone_joker]
    for face, count in Counter(card.face for card in hand if not card.is_joker).items():
        if not required.lowest_face <= face <= required.highest_face:
            continue
        of_face = sorted((card for card in hand if card.face == face), key=lambda card: not card.is_golden)
        for plain in range(1, count + 1):
            for wild in range(len(jokers) + 1):
                if required.fewest_cards <= plain + wild <= MAX_PLACES:
                    plays.append([*of_face[:plain], *jokers[:wild]])
    return plays
