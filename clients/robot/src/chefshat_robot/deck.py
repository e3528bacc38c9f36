"""The printed deck: what each physical card is, and the codes printed on it.

Every piece has an AprilTag of the family 36h11 (587 tags). Each deck uses `TAGS_PER_DECK` of them, so that seven decks can be
distinguished on one table; the tags after the last deck mark the playing field. A card also has a small QR code for phones:
`CHEFSHAT/1/DECK/PIECE`, for instance `CHEFSHAT/1/0/C17`, where 1 is the version of the codes. Nothing here depends on how pieces
are printed or seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

CODES_VERSION = 1
"""Version of the numbering of tags and of the text in QR codes."""

FACES = 11
JOKERS = 2
CARDS = 68
"""Cards of a deck: face f in f copies (1..11), then two jokers. The last card of face 11 is the Golden one (docs/rules.md §1)."""

TAGS_PER_DECK = 80
DECKS = 7
ROLE_TAGS = 68
"""First of the six tags of role cards within a deck."""
PASS_TAGS = 74
"""First of the six tags of pass cards within a deck: one for each seat."""
FIELD_TAGS = DECKS * TAGS_PER_DECK
"""First of the tags of the playing field: its four corners, clockwise from the top left."""
HAND_TAGS = FIELD_TAGS + 4
"""First of the four tags of the corners of a hand stand, clockwise from the top left."""

ROLES = ("chef", "sous-chef", "waiter", "dishwasher", "cook", "cook")


class PieceKind(Enum):
    """What a printed piece is."""

    CARD = "card"
    ROLE = "role"
    PASS = "pass"


@dataclass(frozen=True, order=True)
class Card:
    """A physical card of one deck.

    Attributes:
        deck: Number of the deck, 0..6.
        index: Number of the card in its deck, 0..67: the faces ascending, then the jokers.
    """

    deck: int
    index: int

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not (0 <= self.deck < DECKS and 0 <= self.index < CARDS):
            raise ValueError(f"no card {self.index} in deck {self.deck}: decks are 0..{DECKS - 1}, cards 0..{CARDS - 1}")

    @property
    def face(self) -> int:
        """The face, 1..11; 12 for a joker."""
        face, last = 1, 0
        while self.index > last and face <= FACES:
            face += 1
            last += face
        return face

    @property
    def is_joker(self) -> bool:
        """Whether it is a joker."""
        return self.index >= CARDS - JOKERS

    @property
    def is_golden(self) -> bool:
        """Whether it is the Golden card."""
        return self.index == CARDS - JOKERS - 1

    @property
    def tag(self) -> int:
        """Its AprilTag."""
        return self.deck * TAGS_PER_DECK + self.index

    @property
    def qr_text(self) -> str:
        """The text of its QR code."""
        return f"CHEFSHAT/{CODES_VERSION}/{self.deck}/C{self.index}"


@dataclass(frozen=True)
class Piece:
    """A printed piece of one deck: a card, the card of a role, or the pass card of a seat.

    Attributes:
        kind: What it is.
        deck: Number of the deck, 0..6.
        number: Of a card 0..67, of a role card its index in `ROLES`, of a pass card the seat 0..5.
    """

    kind: PieceKind
    deck: int
    number: int

    @property
    def tag(self) -> int:
        """Its AprilTag."""
        first = {PieceKind.CARD: 0, PieceKind.ROLE: ROLE_TAGS, PieceKind.PASS: PASS_TAGS}[self.kind]
        return self.deck * TAGS_PER_DECK + first + self.number

    @property
    def qr_text(self) -> str:
        """The text of its QR code."""
        letter = {PieceKind.CARD: "C", PieceKind.ROLE: "R", PieceKind.PASS: "P"}[self.kind]
        return f"CHEFSHAT/{CODES_VERSION}/{self.deck}/{letter}{self.number}"

    @property
    def card(self) -> Card | None:
        """The card, if it is one."""
        return Card(self.deck, self.number) if self.kind is PieceKind.CARD else None


def piece_of_tag(tag: int) -> Piece | None:
    """The piece with this AprilTag; None for a tag of the field or of no piece."""
    if not 0 <= tag < FIELD_TAGS:
        return None
    deck, number = divmod(tag, TAGS_PER_DECK)
    if number >= PASS_TAGS:
        return Piece(PieceKind.PASS, deck, number - PASS_TAGS)
    if number >= ROLE_TAGS:
        return Piece(PieceKind.ROLE, deck, number - ROLE_TAGS)
    return Piece(PieceKind.CARD, deck, number)


def deck(number: int) -> list[Card]:
    """All cards of a deck, in order."""
    return [Card(number, index) for index in range(CARDS)]
