"""`chefshat-robot print`: the printable game as a PDF."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from chefshat_robot.deck import DECKS
from chefshat_robot.printing import sheets, surfaces
from chefshat_robot.printing.canvas import PAPERS, Canvas, Paper

EXAMPLE = """\
Writes the game as a PDF in real millimetres: print it at 100 % (actual size), on thick paper, and check the ruler on each sheet.

Example, the whole game on A4, with backs for printing on both sides (flip on the long edge):
  chefshat-robot print --backs --out chefshat.pdf
A second deck, which the camera tells apart from the first:
  chefshat-robot print --only cards,roles,passes --deck 1 --out deck-1.pdf
"""

SECTIONS: dict[str, Callable[[Canvas, int, bool], None]] = {
    "cards": lambda canvas, deck, backs: sheets.draw_pieces(canvas, sheets.cards(deck), "cards", backs=backs),
    "roles": lambda canvas, deck, backs: sheets.draw_pieces(canvas, sheets.roles(deck), "role cards", backs=backs),
    "passes": lambda canvas, deck, backs: sheets.draw_pieces(canvas, sheets.passes(deck), "pass cards", backs=backs),
    "field": lambda canvas, deck, backs: surfaces.draw_field(canvas),
    "hand": lambda canvas, deck, backs: surfaces.draw_hand(canvas),
    "calibration": lambda canvas, deck, backs: surfaces.draw_calibration(canvas),
}
"""What can be printed, in the order of the pages: functions of the canvas, the number of the deck, and whether to add backs."""


def print_game(paper: Paper, deck: int = 0, only: Sequence[str] = tuple(SECTIONS), *, backs: bool = False) -> Canvas:
    """Draws the printable game.

    Args:
        paper: One of `PAPERS`.
        deck: Number of the deck, 0..6.
        only: Names of `SECTIONS`.
        backs: Whether each sheet of cards is followed by that of their backs.

    Returns:
        The document, to be saved.
    """
    canvas = Canvas(paper)
    for name, draw in SECTIONS.items():
        if name in only:
            draw(canvas, deck, backs)
    return canvas


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = EXAMPLE
    parser.add_argument("--out", type=Path, default=Path("chefshat.pdf"), metavar="FILE", help="the PDF (default: %(default)s)")
    parser.add_argument("--paper", choices=PAPERS, default="a4", help="the paper (default: %(default)s)")
    parser.add_argument(
        "--deck", type=int, choices=range(DECKS), default=0, help="number of the deck, to have several different ones (default: 0)"
    )
    parser.add_argument(
        "--only",
        type=_sections,
        default=list(SECTIONS),
        metavar="PARTS",
        help=f"parts to print, of {','.join(SECTIONS)} (default: all)",
    )
    parser.add_argument(
        "--backs", action="store_true", help="follow each sheet of cards with its backs, for printing on both sides"
    )


def run(arguments: argparse.Namespace) -> int:
    """Writes the PDF and says what to do with it."""
    canvas = print_game(PAPERS[arguments.paper], arguments.deck, arguments.only, backs=arguments.backs)
    canvas.save(arguments.out)
    print(f"{arguments.out}: {canvas.pages} pages. Print at 100 % (actual size) and check the ruler: 100 mm.")
    return 0


def _sections(text: str) -> list[str]:
    """The parts named in a list separated by commas."""
    names = text.split(",")
    for name in names:
        if name not in SECTIONS:
            raise argparse.ArgumentTypeError(f"{name!r} is not one of {', '.join(SECTIONS)}")
    return names
