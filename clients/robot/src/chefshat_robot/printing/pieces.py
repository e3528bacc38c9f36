"""What is printed on a card, a role card, a pass card, and on the back of them all.

Each function draws one piece of `CARD_WIDTH` x `CARD_HEIGHT` mm with its top left corner at the canvas's origin.
"""

from __future__ import annotations

from collections.abc import Sequence

from chefshat_robot.deck import JOKERS, ROLES, Card, Piece, PieceKind
from chefshat_robot.field import CARD_HEIGHT, CARD_TAG_CENTRE, CARD_TAG_SIZE, CARD_WIDTH
from chefshat_robot.printing.canvas import CAP_HEIGHT, INK, POINT, SOFT, Canvas

INGREDIENTS = (
    "truffle",
    "shrimp",
    "anchovy",
    "artichoke",
    "chilli",
    "basil",
    "olive",
    "pepper",
    "mushroom",
    "tomato",
    "mozzarella",
)
"""Names of the faces 1 to 11 (docs/rules.md §2.1)."""

BACK = "#1f5f5b"
BACK_LINE = "#f3d9a4"
GOLD = "#e0a100"
JOKER = "#cc79a7"

FACE_COLOURS = (
    "#5b463d",
    "#f08a5d",
    "#56b4e9",
    "#6a994e",
    "#d1362a",
    "#009e73",
    "#4b4a7d",
    "#f0c419",
    "#b9855a",
    "#d55e00",
    "#a8a08c",
)
SEAT_COLOURS = ("#0072b2", "#a84300", "#00664b", "#8a3f6b", "#6b5600", "#3b3b3b")
ROLE_COLOURS = {"chef": GOLD, "sous-chef": "#b9855a", "cook": "#6b6f76", "waiter": "#56b4e9", "dishwasher": "#0072b2"}
ROLE_RULES = {
    "chef": ("gets the Dishwasher's", "2 rarest, gives any 2"),
    "sous-chef": ("gets the Waiter's", "rarest, gives any 1"),
    "cook": ("neither gives", "nor receives"),
    "waiter": ("gives the rarest", "to the Sous-Chef, gets 1"),
    "dishwasher": ("gives the 2 rarest", "to the Chef, gets 2"),
}

QR_SIZE = 11.0
QR_CORNER = (5.5, CARD_HEIGHT - 5.5 - QR_SIZE)
"""Where the QR code lies on a card, in mm: its size without the quiet zone, and its top left corner."""

MIDDLE = (CARD_WIDTH / 2, CARD_HEIGHT / 2)
DISC = 16.0
"""Radius of the coloured disc behind a drawing, in mm."""
DRAWING = 27.0
INDEX = 36
"""Size of the number beside the tags, in points."""


def draw_piece(canvas: Canvas, piece: Piece) -> None:
    """Draws the front of a piece."""
    if piece.card is not None:
        _card(canvas, piece.card)
    elif piece.kind is PieceKind.ROLE:
        _role(canvas, ROLES[piece.number])
    else:
        _pass(canvas, piece.number)
    _codes(canvas, piece)


def draw_back(canvas: Canvas, deck: int) -> None:
    """Draws the back of a piece: the same for all pieces of a deck, whichever way round."""
    canvas.rect(0, 0, CARD_WIDTH, CARD_HEIGHT, fill=BACK)
    canvas.rect(4, 4, CARD_WIDTH - 8, CARD_HEIGHT - 8, line=BACK_LINE, line_width=0.6, radius=3)
    canvas.rect(5.4, 5.4, CARD_WIDTH - 10.8, CARD_HEIGHT - 10.8, line=BACK_LINE, line_width=0.2, radius=2.2)
    for angle in (0, 180):
        with canvas.at(*MIDDLE, angle):
            canvas.symbol("joker", -12.5, -30, 25)
            canvas.text(0, 35.5, f"deck {deck}", 6, colour=BACK_LINE, align="middle")
    canvas.line(12, MIDDLE[1], CARD_WIDTH - 12, MIDDLE[1], colour=BACK_LINE, width=0.4)
    canvas.circle(*MIDDLE, 2.2, fill=BACK, line=BACK_LINE, line_width=0.4)


def name_of(card: Card) -> str:
    """The name of a card, as printed on it."""
    if card.is_joker:
        return "Joker"
    name = INGREDIENTS[card.face - 1].capitalize()
    return f"Golden {name}" if card.is_golden else name


def _card(canvas: Canvas, card: Card) -> None:
    """The card without its codes."""
    if card.is_joker:
        colour, drawing, index, copies = JOKER, "joker", "J", JOKERS
    else:
        colour = GOLD if card.is_golden else FACE_COLOURS[card.face - 1]
        drawing = "golden" if card.is_golden else f"face-{card.face}-{INGREDIENTS[card.face - 1]}"
        index, copies = str(card.face), card.face
    title = name_of(card).split()
    remark = "starts the Shift" if card.is_golden else "counts as any face" if card.is_joker else f"{copies} in the deck"
    _front(canvas, colour, drawing, index, title, remark)
    if card.is_golden:
        canvas.circle(*MIDDLE, DISC, line=GOLD, line_width=0.8)


def _role(canvas: Canvas, role: str) -> None:
    """The role card without its codes."""
    _front(canvas, ROLE_COLOURS[role], f"role-{role}", "", [role.title()], "role")
    for line, text in enumerate(ROLE_RULES[role]):
        canvas.text(QR_CORNER[0], QR_CORNER[1] - 6.4 + 2.8 * line, text, 7)


def _pass(canvas: Canvas, seat: int) -> None:
    """The pass card without its codes."""
    _front(canvas, SEAT_COLOURS[seat], "plate", "", ["Pass"], f"seat {seat}")
    canvas.text(MIDDLE[0], MIDDLE[1] + 1.65, "PASS", 14, bold=True, align="middle", colour=SEAT_COLOURS[seat])


def _front(canvas: Canvas, colour: str, drawing: str, index: str, title: Sequence[str], remark: str) -> None:
    """What all fronts share: the drawing on its disc, the index beside each tag, the title opposite the first."""
    canvas.circle(*MIDDLE, DISC, fill=tint(colour))
    canvas.symbol(drawing, MIDDLE[0] - DRAWING / 2, MIDDLE[1] - DRAWING / 2, DRAWING)
    baseline = 26.5 + INDEX * POINT * CAP_HEIGHT
    for angle in (0, 180):
        with canvas.at(*MIDDLE, angle), canvas.at(-MIDDLE[0], -MIDDLE[1]):
            canvas.text(11, baseline, index, INDEX, bold=True, align="middle")
            # Upside down, a 6 would be a 9.
            if index in ("6", "9"):
                canvas.rect(8, baseline + 1.2, 6, 0.9, fill=INK)
    right = CARD_WIDTH - 5
    for line, word in enumerate(title):
        canvas.text(right, 8.4 + 5 * line, word, 14, bold=True, align="right")
    bottom = 8.4 + 5 * (len(title) - 1) + 1.8
    canvas.rect(right - 12, bottom, 12, 0.9, fill=colour)
    canvas.text(right, bottom + 4, remark, 7.5, colour=SOFT, align="right")


def _codes(canvas: Canvas, piece: Piece) -> None:
    """The two tags, the QR code, and the number in words."""
    for angle in (0, 180):
        with canvas.at(*MIDDLE, angle), canvas.at(-MIDDLE[0], -MIDDLE[1]):
            canvas.tag(piece.tag, *CARD_TAG_CENTRE, CARD_TAG_SIZE)
    canvas.qr(piece.qr_text, *QR_CORNER, QR_SIZE)
    for line, text in enumerate(("Chef's Hat", f"deck {piece.deck}", f"tag {piece.tag}")):
        canvas.text(QR_CORNER[0] + QR_SIZE + 2.4, QR_CORNER[1] + QR_SIZE - 5 + 2.4 * line, text, 5.5, colour=SOFT)


def tint(colour: str, part: float = 0.22) -> str:
    """A colour mixed with white, `part` of it being the colour."""
    mixed = (round(255 + (int(colour[start : start + 2], 16) - 255) * part) for start in (1, 3, 5))
    return "#" + "".join(f"{value:02x}" for value in mixed)
