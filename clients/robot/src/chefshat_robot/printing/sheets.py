"""Sheets of pieces: nine to a page, edge to edge, with crop marks; their backs, mirrored for printing on both sides."""

from __future__ import annotations

from collections.abc import Sequence

from chefshat_robot.deck import CARDS, PASS_TAGS, ROLES, TAGS_PER_DECK, Piece, PieceKind
from chefshat_robot.field import CARD_HEIGHT, CARD_WIDTH
from chefshat_robot.printing.canvas import INK, MARGIN, Canvas
from chefshat_robot.printing.pieces import BACK, draw_back, draw_piece

COLUMNS = 3
ROWS = 3
PER_SHEET = COLUMNS * ROWS
BLEED = 2.0
"""How far the colour of backs reaches beyond the outer edges of the cards, in mm."""


def draw_pieces(canvas: Canvas, pieces: Sequence[Piece], label: str, *, backs: bool) -> None:
    """Adds the sheets of some pieces of one deck, each followed by the sheet of their backs if `backs`."""
    sheets = [pieces[first : first + PER_SHEET] for first in range(0, len(pieces), PER_SHEET)]
    for number, sheet in enumerate(sheets, start=1):
        left, top = corner(canvas.paper.width, canvas.paper.height)
        note = f"Chef's Hat · deck {sheet[0].deck} · {label} {number}/{len(sheets)} · {canvas.paper.name}"
        edge = "bottom" if top > left else "left"
        canvas.add_page()
        for slot, piece in enumerate(sheet):
            row, column = divmod(slot, COLUMNS)
            with canvas.at(left + column * CARD_WIDTH, top + row * CARD_HEIGHT):
                draw_piece(canvas, piece)
        _crop_marks(canvas, left, top, rows=-(-len(sheet) // COLUMNS))
        canvas.note(note, edge)
        if backs:
            canvas.add_page()
            corners = [
                (left + (COLUMNS - 1 - slot % COLUMNS) * CARD_WIDTH, top + slot // COLUMNS * CARD_HEIGHT)
                for slot in range(len(sheet))
            ]
            for x, y in corners:
                canvas.rect(x - BLEED, y - BLEED, CARD_WIDTH + 2 * BLEED, CARD_HEIGHT + 2 * BLEED, fill=BACK)
            for x, y in corners:
                with canvas.at(x, y):
                    draw_back(canvas, sheet[0].deck)
            canvas.note(f"{note} · backs", edge)


def corner(width: float, height: float) -> tuple[float, float]:
    """The top left corner of the grid of cards on a page of this size, in mm."""
    return (width - COLUMNS * CARD_WIDTH) / 2, (height - ROWS * CARD_HEIGHT) / 2


def _crop_marks(canvas: Canvas, left: float, top: float, rows: int) -> None:
    """Lines outside the first rows along which to cut: at most 3 mm long, 1 mm from the cards, within the margins."""
    right, bottom = canvas.width - left, top + rows * CARD_HEIGHT
    reach_x, reach_y = min(left - MARGIN - 0.2, 4.2), min(top - MARGIN - 0.2, 4.2)
    for column in range(COLUMNS + 1):
        x = left + column * CARD_WIDTH
        canvas.line(x, top - reach_y, x, top - 1, colour=INK)
        canvas.line(x, bottom + 1, x, bottom + reach_y, colour=INK)
    for row in range(rows + 1):
        y = top + row * CARD_HEIGHT
        canvas.line(left - reach_x, y, left - 1, y, colour=INK)
        canvas.line(right + 1, y, right + reach_x, y, colour=INK)


def cards(deck: int) -> list[Piece]:
    """The 68 cards of a deck."""
    return [Piece(PieceKind.CARD, deck, number) for number in range(CARDS)]


def roles(deck: int) -> list[Piece]:
    """The six role cards of a deck."""
    return [Piece(PieceKind.ROLE, deck, number) for number in range(len(ROLES))]


def passes(deck: int) -> list[Piece]:
    """The pass cards of a deck, one for each seat."""
    return [Piece(PieceKind.PASS, deck, seat) for seat in range(TAGS_PER_DECK - PASS_TAGS)]
