"""What is decided from sightings, without pictures: what is hidden or unreadable at the wrong moment never changes the events."""

from __future__ import annotations

import random

import pytest

from chefshat_robot import field
from chefshat_robot.deck import Card, Piece, PieceKind
from chefshat_robot.vision import Cleared, Doubt, DoubtResolved, Laid, Observed, PassShown, TakenBack
from chefshat_robot.vision.decider import DOUBT_SECONDS, TAKEN_SECONDS, Decider
from chefshat_robot.vision.reader import SPOTS, STILL_FRAMES, SeenPlace, SeenTag, Sighting

FPS = 15
DOUBTED = round(DOUBT_SECONDS * FPS) + 3
"""Frames after which a place that cannot be read is asked about."""
PASS_1 = 12
"""The pass place of seat 1, as an index of `SPOTS`."""
PASS_3 = 14
UNREADABLE = None


class Table:
    """A table whose places are set one by one, and what a decider says about it."""

    def __init__(self) -> None:
        self.decider = Decider()
        self.events: list[Observed] = []
        self.reaching = False
        self.sides: tuple[int, ...] = ()
        self._frame = 0
        self._still = [9] * len(SPOTS)
        self._looks = [1] * len(SPOTS)
        self._before = [1] * len(SPOTS)
        self._empty = [True] * len(SPOTS)
        self._tops: list[Piece | None] = [None] * len(SPOTS)

    def wait(self, frames: int = 8, beneath: list[SeenTag] | None = None) -> None:
        """Shows the table for some frames, with tags of cards beneath others that can be read."""
        for _ in range(frames):
            places = tuple(
                SeenPlace(still, look if still >= STILL_FRAMES else before, empty if still >= STILL_FRAMES else None, True)
                for still, look, before, empty in zip(self._still, self._looks, self._before, self._empty, strict=True)
            )
            tops = (tag for spot, piece in enumerate(self._tops) if piece for tag in tags_of(piece, spot))
            tags = (*(beneath or ()), *tops)
            self.events += self.decider.see(Sighting(self._frame, self._frame / FPS, None, tags, self.reaching, places, self.sides))
            self._frame += 1
            self._still = [still + 1 for still in self._still]

    def read(self, spot: int, card: Card) -> None:
        """From now on the card that lies at a place can be read."""
        self._tops[spot] = Piece(PieceKind.CARD, card.deck, card.index)

    def skip(self, frames: int) -> None:
        """The camera is away for some frames."""
        self._frame += frames

    def put(self, *spots: int, cards: tuple[Card, ...] | None = None, look: int | None = None) -> None:
        """Lays cards at places, or something without a tag that can be read."""
        for number, spot in enumerate(spots):
            card = cards[number] if cards else None
            piece = Piece(PieceKind.CARD, card.deck, card.index) if card else None
            self.change(spot, piece, look=look)

    def change(self, spot: int, piece: Piece | None, empty: bool = False, look: int | None = None) -> None:
        """Something moves at a place, and then it has another look."""
        self._still[spot], self._before[spot] = 0, self._looks[spot]
        self._looks[spot] = look if look is not None else self._looks[spot] + 1
        self._empty[spot], self._tops[spot] = empty, piece

    def sweep(self, *spots: int) -> None:
        """Empties places."""
        for spot in spots:
            self.change(spot, None, empty=True)

    def said(self) -> list[Observed]:
        """The new events."""
        events, self.events = self.events, []
        return events


def tags_of(piece: Piece, spot: int) -> list[SeenTag]:
    """The two tags of a piece that lies exactly at a place, upright."""
    right, down = field.CARD_WIDTH / 2 - field.CARD_TAG_CENTRE[0], field.CARD_HEIGHT / 2 - field.CARD_TAG_CENTRE[1]
    place = SPOTS[spot]
    return [
        SeenTag(piece.tag, place.x - right, place.y - down, 0.0, 0, 60.0),
        SeenTag(piece.tag, place.x + right, place.y + down, 180.0, 0, 60.0),
    ]


def kinds(events: list[Observed]) -> list[type[Observed]]:
    return [type(event) for event in events]


def outline(events: list[Observed]) -> list[object]:
    """What was laid, each with whether it was found, and the kinds of the other events."""
    return [(event.cards, event.found) if isinstance(event, Laid) else type(event) for event in events]


def doubt_of(table: Table) -> Doubt:
    """The doubt that is the only new event."""
    (doubt,) = table.said()
    assert isinstance(doubt, Doubt)
    return doubt


NINES = (Card(0, 36), Card(0, 37), Card(0, 38))
FOURS = (Card(0, 6), Card(0, 7), Card(0, 8))


def laid(table: Table, *cards: Card) -> None:
    """Lays cards on the first places and checks that this is said."""
    table.put(*range(len(cards)), cards=cards)
    table.wait()
    assert outline(table.said()) == [(cards, True)]


def test_a_place_that_never_looks_empty_does_not_turn_clearing_into_taking_back() -> None:
    table = Table()
    laid(table, *NINES)
    table.sweep(0, 1)
    table.change(2, None)
    table.wait(6)
    assert table.said() == []
    table.put(0, 1, 2, cards=FOURS)
    table.wait()
    assert kinds(table.said()) == [Cleared, Laid]
    assert table.decider.on_table == {card: place for place, card in enumerate(FOURS, start=1)}


def test_cards_under_an_arm_that_rests_over_them_are_neither_cleared_nor_laid_again() -> None:
    table = Table()
    laid(table, *NINES)
    table.reaching = True
    # A sleeve without a pattern looks as an empty place does.
    table.sweep(0, 1, 2)
    table.wait(5 * FPS)
    assert table.said() == []
    table.put(0, 1, 2, cards=NINES)
    table.wait()
    table.reaching = False
    table.wait(5 * FPS)
    assert table.said() == []
    # Without them, they were cleared when the arm leaves.
    table.reaching = True
    table.sweep(0, 1, 2)
    table.wait(FPS)
    table.reaching = False
    table.wait(1)
    assert kinds(table.said()) == [Cleared]


def test_cards_that_a_hand_sweeps_before_it_lays_others_were_cleared() -> None:
    table = Table()
    laid(table, *NINES)
    table.reaching = True
    table.sweep(0, 1, 2)
    table.wait()
    table.put(0, 1, 2, cards=FOURS)
    table.wait()
    table.reaching = False
    table.wait()
    assert kinds(table.said()) == [Cleared, Laid]


def test_a_play_that_a_hand_lays_card_by_card_is_reported_when_it_has_left() -> None:
    table = Table()
    table.wait()
    table.reaching = True
    for spot, card in enumerate(NINES):
        table.put(spot, cards=(card,))
        table.wait(2 * FPS)
        assert table.said() == []
    table.reaching = False
    table.wait(1)
    assert outline(table.said()) == [(NINES, False)]


def test_what_lies_there_from_the_first_frame_was_found() -> None:
    table = Table()
    table.put(0, 1, cards=NINES[:2])
    table.change(PASS_1, Piece(PieceKind.PASS, 0, 1))
    table.wait()
    assert [(type(event), getattr(event, "found", None)) for event in table.said()] == [(Laid, True), (PassShown, True)]
    table.put(0, 1, 2, cards=FOURS)
    table.change(PASS_3, Piece(PieceKind.PASS, 0, 3))
    table.wait()
    assert [(type(event), getattr(event, "found", None)) for event in table.said()] == [(Laid, False), (PassShown, False)]


def test_cards_laid_beside_cards_that_were_found_are_another_event() -> None:
    table = Table()
    table.put(0, 1, cards=NINES[:2])
    table.wait()
    table.put(2, cards=NINES[2:])
    table.wait()
    assert outline(table.said()) == [(NINES[:2], True), (NINES[2:], False)]


@pytest.mark.parametrize("first_read", [True, False])
def test_a_play_in_the_middle_of_which_perception_begins_is_found_as_a_whole(first_read: bool) -> None:
    table = Table()
    table.reaching = True
    table.put(0, cards=NINES[:1] if first_read else None)
    table.change(1, None, empty=True)
    table.change(2, None, empty=True)
    table.wait(STILL_FRAMES + 1)
    table.put(2, cards=NINES[2:])
    table.wait(STILL_FRAMES + 1)
    table.put(1, cards=NINES[1:2])
    table.wait()
    table.read(0, NINES[0])
    table.wait()
    table.reaching = False
    table.wait()
    assert outline(table.said()) == [(NINES, True)]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_the_play_after_the_one_that_was_found_is_not_mixed_with_it(order: tuple[int, ...]) -> None:
    table = Table()
    table.reaching = True
    table.put(0, 1, cards=NINES[:2])
    table.change(2, None, empty=True)
    table.wait()
    for spot in order:
        table.put(spot, cards=FOURS[spot : spot + 1])
        table.wait(STILL_FRAMES + 3)
    table.reaching = False
    table.wait()
    assert outline(table.said()) == [(NINES[:2], True), (FOURS, False)]


def test_a_play_laid_beneath_an_arm_that_never_leaves_is_whole() -> None:
    table = Table()
    table.reaching = True
    for spot in range(4):
        table.change(spot, None, empty=True)
    table.wait()
    table.put(0, 1, cards=NINES[:2])
    table.wait()
    table.put(0, 1, 2, cards=FOURS)
    table.wait()
    table.sweep(0, 1, 2)
    table.reaching = False
    table.wait()
    assert outline(table.said()) == [(NINES[:2], True), (FOURS, False), Cleared]


def test_cards_that_are_swept_away_while_perception_begins_were_found() -> None:
    table = Table()
    table.reaching = True
    for spot in range(3):
        table.change(spot, None, empty=True)
    table.change(2, Piece(PieceKind.CARD, NINES[2].deck, NINES[2].index))
    table.wait()
    table.sweep(2)
    table.reaching = False
    table.wait()
    assert outline(table.said()) == [(NINES[2:], True), Cleared]


def test_a_play_laid_by_the_arm_that_swept_the_field_as_perception_began_is_whole() -> None:
    table = Table()
    table.reaching = True
    for spot in range(2):
        table.change(spot, None, empty=True)
    table.put(2, cards=NINES[2:])
    table.wait()
    table.sweep(2)
    table.wait()
    table.put(0, 1, 2, cards=FOURS)
    table.wait()
    table.reaching = False
    table.wait()
    assert outline(table.said()) == [(NINES[2:], True), Cleared, (FOURS, False)]


def test_nobody_waited_for_anything_while_the_camera_was_away() -> None:
    table = Table()
    table.wait()
    table.put(0, 1, cards=NINES[:2])
    table.put(2)
    table.wait(STILL_FRAMES)
    table.skip(60)
    table.wait(1)
    table.read(2, NINES[2])
    table.wait()
    assert outline(table.said()) == [(NINES, False)]


def test_of_a_pile_that_was_found_the_play_is_what_lies_on_top() -> None:
    table = Table()
    table.put(0, cards=FOURS[:1])
    beneath = tags_of(Piece(PieceKind.CARD, NINES[0].deck, NINES[0].index), 0)[:1]
    table.wait(8, beneath)
    assert outline(table.said()) == [(FOURS[:1], True)]


def test_a_card_that_cannot_be_read_from_the_first_frame_is_asked_about() -> None:
    table = Table()
    table.put(4)
    table.wait(DOUBTED)
    doubt = doubt_of(table)
    assert doubt.place == "5"
    table.events += table.decider.answer(doubt.number, NINES[0])
    assert outline(table.said()) == [DoubtResolved, (NINES[:1], True)]


@pytest.mark.parametrize(
    ("sides", "expected"), [([(2,)], 2), ([()], None), ([(0, 1)], None), ([(3,), (3,)], 3), ([(1,), (2,)], None)]
)
def test_who_laid_cards_is_seen_by_the_arm_that_reached_in(sides: list[tuple[int, ...]], expected: int | None) -> None:
    table = Table()
    for place, reached in enumerate(sides):
        table.reaching, table.sides = True, reached
        table.wait(3)
        table.put(place, cards=(NINES[place],))
        table.wait(2)
    # The arm leaves, and that of another comes before the cards were read.
    table.sides = (1, 3)
    table.wait(8)
    table.reaching, table.sides = False, ()
    table.wait(4)
    (event,) = table.said()
    assert isinstance(event, Laid)
    assert event.side == expected


def test_a_place_that_looked_empty_for_a_moment_is_cleared_with_the_others() -> None:
    table = Table()
    laid(table, *NINES)
    table.sweep(0, 1)
    table.change(2, None)
    table.wait(6)
    table.change(0, None)
    table.sweep(2)
    table.wait(4)
    table.put(0, cards=(FOURS[0],))
    table.wait()
    assert kinds(table.said()) == [Cleared, Laid]


def test_cards_that_are_still_read_stay_as_new_ones_come() -> None:
    table = Table()
    laid(table, *NINES)
    table.sweep(2)
    table.wait(6)
    table.put(2, cards=(FOURS[0],))
    table.wait()
    assert kinds(table.said()) == [TakenBack, Laid]
    assert table.decider.on_table == {NINES[0]: 1, NINES[1]: 2, FOURS[0]: 3}


def test_cards_gone_for_long_were_taken_back() -> None:
    table = Table()
    laid(table, *NINES)
    table.sweep(1)
    table.wait(round(TAKEN_SECONDS * FPS) + 5)
    (event,) = table.said()
    assert isinstance(event, TakenBack)
    assert (event.cards, event.places) == ((NINES[1],), (2,))


def test_a_pass_is_not_told_before_an_earlier_one_that_is_being_asked_about() -> None:
    table = Table()
    table.change(PASS_1, UNREADABLE)
    table.wait(8)
    table.change(PASS_3, Piece(PieceKind.PASS, 0, 3))
    table.wait(8)
    assert table.said() == []
    table.wait(DOUBTED)
    doubt = doubt_of(table)
    assert doubt.place == "pass 1"
    events = table.decider.answer(doubt.number, True)
    assert kinds(events) == [DoubtResolved, PassShown, PassShown]
    assert [event.seat for event in events if isinstance(event, PassShown)] == [1, 3]


def test_a_card_covered_before_it_was_read_is_asked_about_as_it_was() -> None:
    table = Table()
    table.put(0, 1, cards=(NINES[0], NINES[1]))
    table.put(2)
    table.wait(10)
    table.put(0, 1, 2, cards=FOURS)
    table.wait()
    doubt = doubt_of(table)
    assert (doubt.place, round(doubt.seen * FPS)) == ("3", 9)
    events = table.decider.answer(doubt.number, NINES[2])
    assert [event.cards for event in events if isinstance(event, Laid)] == [NINES, FOURS]


def test_a_hand_that_rests_over_a_card_is_nothing() -> None:
    table = Table()
    laid(table, NINES[0])
    table.change(0, None, look=7)
    table.wait(8)
    table.change(0, None, look=2)
    table.wait(40)
    assert table.said() == []


def test_cards_laid_after_something_rested_over_a_place_are_one_play() -> None:
    table = Table()
    laid(table, NINES[0], NINES[1])
    table.change(1, None)
    table.wait(15)
    table.put(0, 2, cards=(FOURS[0], FOURS[2]))
    table.wait(4)
    table.put(1, cards=(FOURS[1],))
    table.wait(12)
    doubt = doubt_of(table)
    events = table.decider.answer(doubt.number, False)
    assert [event.cards for event in events if isinstance(event, Laid)] == [FOURS]


def test_each_of_two_cards_that_cannot_be_read_is_asked_about() -> None:
    table = Table()
    table.put(0)
    table.wait(10)
    table.put(0)
    table.wait(DOUBTED)
    below, above = table.said()
    assert isinstance(below, Doubt)
    assert isinstance(above, Doubt)
    assert below.place == above.place == "1"
    assert below.seen < above.seen
    answers = table.decider.answer(above.number, FOURS[0]) + table.decider.answer(below.number, NINES[0])
    assert [event.cards for event in answers if isinstance(event, Laid)] == [(NINES[0],), (FOURS[0],)]
    assert list(table.decider.on_table) == [NINES[0], FOURS[0]]


def test_a_card_that_was_covered_for_a_moment_is_asked_about_once() -> None:
    table = Table()
    table.put(0)
    table.wait(10)
    table.put(0, look=2)
    table.wait(DOUBTED)
    doubt_of(table)


def answer_by_chance(table: Table, doubts: dict[int, Doubt], chance: random.Random) -> None:
    """Answers one of the open doubts, rightly or not, as somebody may who looks at the table later."""
    number = chance.choice(list(doubts))
    doubt = doubts.pop(number)
    if doubt.place.startswith("pass "):
        table.events += table.decider.answer(number, chance.random() < 0.5)
    else:
        cards: list[Card | bool] = [*doubt.options, *table.decider.answers(int(doubt.place)), False]
        table.events += table.decider.answer(number, chance.choice(cards))


def note(table: Table, doubts: dict[int, Doubt]) -> None:
    """Keeps the doubts that are open."""
    for event in table.said():
        if isinstance(event, Doubt):
            doubts[event.number] = event
        elif isinstance(event, DoubtResolved):
            doubts.pop(event.number, None)


@pytest.mark.parametrize("seed", range(200))
def test_whatever_happens_and_whenever_it_is_answered_every_doubt_is_closed(seed: int) -> None:
    chance = random.Random(seed)
    table, doubts = Table(), dict[int, Doubt]()
    for _ in range(40):
        spots = chance.sample(range(4), chance.randint(1, 3))
        match chance.choice(["lay", "lay", "cover", "sweep", "sweep all", "pass", "answer", "answer"]):
            case "lay":
                cards = tuple(chance.sample([*NINES, *FOURS], len(spots)))
                table.put(*spots, cards=cards)
            case "cover":
                table.put(*spots)
            case "sweep":
                table.sweep(*spots)
            case "sweep all":
                table.sweep(*range(4))
            case "pass":
                table.change(PASS_1, chance.choice([None, Piece(PieceKind.PASS, 0, 1)]), empty=chance.random() < 0.3)
            case _ if doubts:
                answer_by_chance(table, doubts, chance)
        table.wait(chance.choice([1, 4, 8, DOUBTED]))
        note(table, doubts)
    table.sweep(*range(4))
    table.change(PASS_1, None, empty=True)
    table.wait(2 * DOUBTED)
    note(table, doubts)
    while doubts:
        answer_by_chance(table, doubts, chance)
        table.wait(2 * DOUBTED)
        note(table, doubts)
    # Nothing waits any more: what is laid now is said.
    table.put(5, cards=(Card(0, 20),))
    table.wait()
    assert any(isinstance(event, Laid) and Card(0, 20) in event.cards for event in table.said())
