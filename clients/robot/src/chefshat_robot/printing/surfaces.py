"""The playing field, the strip behind a robot's own hand, and the calibration sheet."""

from __future__ import annotations

from chefshat_robot import charuco, field
from chefshat_robot.deck import FIELD_TAGS, HAND_TAGS
from chefshat_robot.printing.canvas import FAINT, INK, MARGIN, SOFT, WHITE, Canvas
from chefshat_robot.printing.pieces import SEAT_COLOURS, tint
from chefshat_robot.printing.tiles import Tiling, draw_tiles

FIELD = Tiling("playing field", field.WIDTH, field.HEIGHT, columns=3, rows=2)
HAND = Tiling("hand strip", field.HAND_WIDTH, field.HAND_HEIGHT, columns=2, rows=1, landscape=True)

CRUST = "#d9a35a"
DOUGH = "#fdf4e3"
POINTS = (("chef", "Chef", 5), ("sous-chef", "Sous-Chef", 3), ("waiter", "Waiter", 1), ("dishwasher", "Dishwasher", 0))
"""The places of a Shift of four players: drawing, role in the next Shift, points (docs/rules.md §3.2, §5.1)."""


def draw_field(canvas: Canvas) -> None:
    """Adds the sheets of the playing field."""
    (left, top), (right, _), (_, bottom), _ = field.corner_tags()
    advice = (
        f"Check: from the middle of a corner code to the next, {right - left:g} mm across and {bottom - top:g} mm down.",
        "Fix it flat on the table, seat 0 on the side of the camera's lower edge.",
    )
    draw_tiles(canvas, FIELD, _field, advice)


def draw_hand(canvas: Canvas) -> None:
    """Adds the sheets of the strip behind a robot's own hand."""
    advice = (
        "Fix the strip to the board of a card rack, upright before the robot's second camera.",
        "Stand the cards in front of it from left to right, each over the right part of the one before.",
    )
    draw_tiles(canvas, HAND, _hand, advice)


def draw_calibration(canvas: Canvas) -> None:
    """Adds the calibration sheet."""
    width, height = charuco.COLUMNS * charuco.SQUARE_SIZE, charuco.ROWS * charuco.SQUARE_SIZE
    canvas.add_page(landscape=True)
    left, top = (canvas.width - width) / 2, MARGIN + 1.5
    canvas.calibration_board(left, top)
    parameters = (
        f"ChArUco board for OpenCV: {charuco.COLUMNS} x {charuco.ROWS} squares of {charuco.SQUARE_SIZE:g} mm, "
        f"markers of {charuco.MARKER_SIZE:g} mm from {charuco.DICTIONARY}"
    )
    canvas.text(left, top + height + 5, parameters, 10, bold=True)
    canvas.text(left, top + height + 8.8, "Glue it to a stiff, flat board; a bent sheet spoils the calibration.", 8, colour=SOFT)
    canvas.note(f"Chef's Hat · calibration sheet · {canvas.paper.name}")


def _field(canvas: Canvas) -> None:
    """The playing field, its top left corner at the origin."""
    canvas.rect(2.5, 2.5, field.WIDTH - 5, field.HEIGHT - 5, line=CRUST, line_width=0.5, radius=6)
    places = field.places()
    for edge, colour in ((8.5, CRUST), (7.2, DOUGH)):
        for row in (places[:6], places[6:]):
            x, y = row[0].x - field.CARD_WIDTH / 2 - edge, row[0].y - field.CARD_HEIGHT / 2 - edge
            width = row[-1].x - row[0].x + field.CARD_WIDTH + 2 * edge
            canvas.rect(x, y, width, field.CARD_HEIGHT + 2 * edge, fill=colour, radius=edge + 4)
    for place in places:
        _place(canvas, place, CRUST, WHITE)
        upper = place.y < field.HEIGHT / 2
        label_y = place.y + (-1 if upper else 1) * field.CARD_HEIGHT / 2 + (-1.5 if upper else 4.7)
        canvas.text(place.x, label_y, place.name, 11, bold=True, align="middle")
        canvas.text(place.x, place.y + 8, place.name, 64, bold=True, colour=tint(CRUST, 0.3), align="middle")
    for seat, place in enumerate(field.pass_places()):
        colour = SEAT_COLOURS[seat]
        _place(canvas, place, colour, WHITE)
        # The text faces its seat: seats sit clockwise from the bottom.
        with canvas.at(place.x, place.y, 90 * seat):
            canvas.text(0, 0, "Pass", 20, bold=True, colour=tint(colour, 0.6), align="middle")
            canvas.text(0, 7, f"seat {seat}", 11, colour=tint(colour, 0.8), align="middle")
    for number, (tag_x, tag_y) in enumerate(field.corner_tags()):
        canvas.tag(FIELD_TAGS + number, tag_x, tag_y, field.FIELD_TAG_SIZE)
    _title(canvas)
    _points(canvas)


def _title(canvas: Canvas) -> None:
    """The name of the game and what a play must be, in the upper corners of the field."""
    canvas.symbol("joker", 58, 26, 34)
    canvas.text(97, 46, "Chef's Hat", 34, bold=True)
    canvas.text(97.5, 55, "Play clockwise.", 12, colour=SOFT)
    x = 386
    for number, (text, bold) in enumerate(
        (("Play a lower face,", True), ("at least as many cards.", True), ("Or pass until the pizza is done.", False))
    ):
        canvas.text(x, 38 + 8 * number, text, 15 if bold else 12, bold=bold, colour=INK if bold else SOFT)


def _points(canvas: Canvas) -> None:
    """The roles and points of the places of a Shift, in the lower corners of the field."""
    for number, (role, name, points) in enumerate(POINTS):
        x = (78, 148, 388, 458)[number]
        canvas.symbol(f"role-{role}", x, 326, 24)
        canvas.text(x + 12, 359, name, 13, bold=True, align="middle")
        canvas.text(x + 12, 366, f"{points} point{'' if points == 1 else 's'}", 11, colour=SOFT, align="middle")


def _hand(canvas: Canvas) -> None:
    """The strip behind a hand of cards, its top left corner at the origin."""
    canvas.rect(1.5, 1.5, field.HAND_WIDTH - 3, field.HAND_HEIGHT - 3, line=CRUST, line_width=0.5, radius=4)
    places = field.hand_places()
    top, bottom = places[0].y - field.CARD_HEIGHT / 2, places[0].y + field.CARD_HEIGHT / 2
    left, right = places[0].x - field.CARD_WIDTH / 2, places[-1].x + field.CARD_WIDTH / 2
    canvas.rect(left, top, right - left, field.CARD_HEIGHT, fill=DOUGH, radius=3)
    step = places[1].x - places[0].x
    for number, place in enumerate(places, start=1):
        x = place.x - field.CARD_WIDTH / 2
        canvas.line(x, top, x, bottom, colour=CRUST, width=0.3, dash=2)
        canvas.text(x + step / 2, place.y + 4, str(number), 30, bold=True, colour=tint(CRUST, 0.45), align="middle")
    for number, (x, y) in enumerate(field.hand_tags()):
        canvas.tag(HAND_TAGS + number, x, y, field.CARD_TAG_SIZE)
    for x in (left / 2, (right + field.HAND_WIDTH) / 2):
        with canvas.at(x, field.HAND_HEIGHT / 2, -90):
            canvas.text(0, 1.2, "Chef's Hat", 10, bold=True, colour=FAINT, align="middle")


def _place(canvas: Canvas, place: field.Place, colour: str, fill: str) -> None:
    """The outline of a card on a place."""
    with canvas.at(place.x, place.y, place.angle):
        canvas.rect(
            -field.CARD_WIDTH / 2,
            -field.CARD_HEIGHT / 2,
            field.CARD_WIDTH,
            field.CARD_HEIGHT,
            fill=fill,
            line=colour,
            line_width=0.4,
            radius=3,
            dash=2,
        )
