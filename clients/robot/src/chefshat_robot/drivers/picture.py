"""The picture of the simulated robot: the table from above with its cards, the robot's arm, its gaze, its face and what it says.

`draw` returns an SVG, one unit for each millimetre; `to_png` needs the extra `frames`. What happens when is in `simulated`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cache
from importlib.resources import as_file, files
from xml.sax.saxutils import escape

from chefshat_robot import field, layout
from chefshat_robot.drivers.driver import CardMove, Express, Pose, require
from chefshat_robot.layout import Stand
from chefshat_robot.table import TableState

# The visible part of the table, mm: left, top, width, height.
VIEW = (-470.0, -440.0, 1500.0, 1320.0)
BUBBLE_CHARACTERS = 30
_ASSETS = files("chefshat_robot.printing") / "assets"
_SEAT_COLOURS = ("#0072b2", "#a84300", "#00664b", "#8a3f6b", "#6b5600", "#3b3b3b")
_SYMBOLS = {
    **{str(face): f"face-{face}-{name}.svg" for face, name in enumerate(
        ("truffle", "shrimp", "anchovy", "artichoke", "chilli", "basil", "olive", "pepper", "mushroom", "tomato", "mozzarella"), 1
    )},
    "golden": "golden.svg",
    "joker": "joker.svg",
}  # fmt: skip


@dataclass
class Scene:
    """What the picture shows.

    Attributes:
        state: the table.
        stand: the robot's rack.
        moved: pieces that the robot has carried since the last event, where they lie now.
        carried: the piece in its gripper.
        hand: where its gripper is, in mm; None: at rest.
        pointing: whether it points there.
        gaze: what it looks at, in mm.
        mood: its expression.
        speech: what it says; empty if it is silent.
    """

    state: TableState = dataclass_field(default_factory=TableState)
    stand: Stand | None = None
    moved: list[CardMove] = dataclass_field(default_factory=list)
    carried: str | None = None
    hand: tuple[float, float] | None = None
    pointing: bool = False
    gaze: tuple[float, float] = (field.WIDTH / 2, field.HEIGHT / 2)
    mood: Express = dataclass_field(default_factory=lambda: Express("calm"))
    speech: str = ""


def draw(scene: Scene) -> str:
    """Returns the picture as SVG."""
    left, top, width, height = VIEW
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:g} {top:g} {width:g} {height:g}"',
        f' width="{width:g}" height="{height:g}">',
        _DEFINITIONS,
        f'<rect x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}" fill="#efe3cc"/>',
        *_table(),
        *_board(scene),
        *_seats(scene),
        *_rack(scene),
        *_robot(scene),
        *_speech(scene),
        *_face(scene),
        "</svg>",
    ]
    return "\n".join(parts)


def to_png(svg: str, zoom: float = 1.0) -> bytes:
    """Renders a picture.

    Args:
        svg: from `draw`.
        zoom: pixels for each millimetre.

    Raises:
        RobotError: the extra `frames` is not installed.
    """
    resvg = require("resvg_py", "frames")
    with (
        as_file(_ASSETS / "AtkinsonHyperlegibleNext-Regular.ttf") as regular,
        as_file(_ASSETS / "AtkinsonHyperlegibleNext-Bold.ttf") as bold,
    ):
        rendered = resvg.svg_to_bytes(
            svg_string=svg,
            zoom=zoom,
            skip_system_fonts=True,
            font_files=[str(regular), str(bold)],
            font_family="Atkinson Hyperlegible Next",
        )
    return bytes(rendered)


_DEFINITIONS = """\
<defs>
  <style>
    text { font-family: "Atkinson Hyperlegible Next", sans-serif; fill: #2b2320; text-anchor: middle; }
    .bold { font-weight: 700; }
    .pale { fill: #fff9ec; }
    .round { fill: none; stroke-linecap: round; stroke-linejoin: round; }
    .screen { fill: none; stroke: #7fdcff; stroke-width: 6; stroke-linecap: round; }
    .ink { fill: none; stroke: #2b2320; stroke-width: 3; stroke-linecap: round; stroke-linejoin: round; }
  </style>
  <linearGradient id="wood" x1="0" y1="0" x2="1" y2="1">
    <stop offset="0" stop-color="#c98f55"/><stop offset="0.5" stop-color="#b87a42"/><stop offset="1" stop-color="#a56a36"/>
  </linearGradient>
  <radialGradient id="light" cx="0.45" cy="0.4" r="0.75">
    <stop offset="0" stop-color="#fff6df" stop-opacity="0.5"/><stop offset="1" stop-color="#fff6df" stop-opacity="0"/>
  </radialGradient>
  <linearGradient id="metal" x1="0" y1="0" x2="0" y2="1">
    <stop offset="0" stop-color="#fdfbf6"/><stop offset="1" stop-color="#c9c2b6"/>
  </linearGradient>
  <filter id="shadow" x="-30%" y="-30%" width="160%" height="160%">
    <feDropShadow dx="0" dy="5" stdDeviation="6" flood-color="#2b2320" flood-opacity="0.32"/>
  </filter>
</defs>"""


def _table() -> Iterator[str]:
    """The wooden table and the printed field."""
    yield '<rect x="-250" y="-250" width="1060" height="900" rx="70" fill="url(#wood)" filter="url(#shadow)"/>'
    for line in range(6):
        at = -115 + 126 * line
        grain = f"M-248 {at}C60 {at - 14} 480 {at + 16} 808 {at - 4}"
        yield f'<path class="round" d="{grain}" stroke="#8f5a2b" stroke-width="2.5" opacity="0.35"/>'
    yield '<rect x="-250" y="-250" width="1060" height="900" rx="70" fill="url(#light)"/>'
    yield (
        f'<rect width="{field.WIDTH:g}" height="{field.HEIGHT:g}" rx="10" fill="#fff9ec" stroke="#cdb899" stroke-width="2"'
        ' filter="url(#shadow)"/>'
    )
    yield f'<ellipse cx="{field.WIDTH / 2:g}" cy="{field.HEIGHT / 2:g}" rx="232" ry="152" fill="#f7dc9b"'
    yield ' stroke="#d9a35a" stroke-width="9" opacity="0.55"/>'
    for x, y in field.corner_tags():
        half = field.FIELD_TAG_SIZE / 2
        yield f'<rect x="{x - half:g}" y="{y - half:g}" width="{2 * half:g}" height="{2 * half:g}" fill="#2b2320"/>'
        yield f'<path d="M{x - 7:g} {y - 7:g}h7v7h7v7h-7v-7h-7z" fill="#fff9ec"/>'
    for place in [*field.places(), *field.pass_places()]:
        width, height = field.CARD_WIDTH, field.CARD_HEIGHT
        if place.angle:
            width, height = height, width
        yield (
            f'<rect x="{place.x - width / 2:g}" y="{place.y - height / 2:g}" width="{width:g}" height="{height:g}" rx="5"'
            ' fill="#fffdf8" fill-opacity="0.6" stroke="#8a7660" stroke-width="1.5" stroke-dasharray="5 4"/>'
        )
        label = place.name.split()[0]
        yield f'<text x="{place.x:g}" y="{place.y + 6:g}" font-size="18" opacity="0.45">{label}</text>'


def _board(scene: Scene) -> Iterator[str]:
    """The cards on the field."""
    state = scene.state
    if state.board_size:
        quantity = state.board_size - state.board_jokers
        pieces = layout.pieces_of_play(state.board_face, quantity, state.board_jokers, golden=False)
        for piece, pose in zip(pieces, layout.play_places(len(pieces)), strict=True):
            yield _card(piece, pose)
    moved_passes = {move.end for move in scene.moved if move.piece == "pass"}
    for seat, passed in enumerate(state.passed):
        place = layout.pass_place(seat)
        if passed and place is not None and place not in moved_passes:
            yield _card("pass", place)
    for move in scene.moved:
        yield _card(move.piece, move.end)


def _seats(scene: Scene) -> Iterator[str]:
    """Everybody at the table except the robot."""
    state = scene.state
    for seat in range(state.players):
        name = state.name(seat)
        face = layout.face_of(seat, state.players)
        colour = _SEAT_COLOURS[seat]
        if seat == state.to_act:
            yield f'<circle class="round" cx="{face.x:g}" cy="{face.y:g}" r="66" stroke="#e0a100" stroke-width="8"'
            yield ' stroke-dasharray="14 16"/>'
        if seat != state.seat:
            turn = layout.facing(seat, state.players)
            yield f'<g transform="translate({face.x:g} {face.y:g}) rotate({turn:g})" filter="url(#shadow)">'
            yield f'<ellipse cy="6" rx="62" ry="34" fill="{colour}"/>'
            yield '<circle r="33" fill="#5a4334"/><path d="M-20 -24a33 33 0 0 1 40 0l-6 14h-28z" fill="#e8bd93"/>'
            yield "</g>"
            yield from _backs(seat, state)
        points = f" · {state.points[seat]}" if seat < len(state.points) else ""
        role = _role(state, seat)
        label = f"{name[:18]}{points}"
        half = max(len(label) * 6.6 + 18, 46)
        at_side = abs(face.x - field.WIDTH / 2) > field.WIDTH / 2
        y = face.y + (112 if at_side and seat == state.seat else 84)
        yield f'<rect x="{face.x - half:g}" y="{y - 20:g}" width="{2 * half:g}" height="32" rx="16" fill="{colour}"/>'
        yield f'<text class="bold pale" x="{face.x:g}" y="{y + 3:g}" font-size="20">{escape(label)}</text>'
        if role:
            yield _symbol(role, face.x - half - 34, y - 20, 30)


def _backs(seat: int, state: TableState) -> Iterator[str]:
    """The hidden cards of a seat, as a fan in front of it, with their number."""
    count = state.cards_left[seat] if seat < len(state.cards_left) else 0
    if not count:
        return
    x, y = layout.beside(seat, state.players, 175)
    turn = layout.facing(seat, state.players)
    yield f'<g transform="translate({x:g} {y:g}) rotate({turn:g})" filter="url(#shadow)">'
    shown = min(count, 17)
    for number in range(shown):
        lean = (number - (shown - 1) / 2) * 4.2
        yield (
            f'<g transform="rotate({lean:g} 0 190)"><rect x="-24" y="-34" width="48" height="68" rx="5" fill="#1f5f5b"'
            ' stroke="#fff9ec" stroke-width="2"/></g>'
        )
    yield "</g>"
    yield f'<circle cx="{x:g}" cy="{y:g}" r="19" fill="#fff9ec" stroke="#2b2320" stroke-width="2"/>'
    yield f'<text class="bold" x="{x:g}" y="{y + 7:g}" font-size="20">{count}</text>'


def _rack(scene: Scene) -> Iterator[str]:
    """The robot's own cards, in their slots, and its pass card."""
    stand, state = scene.stand, scene.state
    if stand is None or state.seat is None:
        return
    yield f'<g transform="translate({stand.x:g} {stand.y:g}) rotate({stand.angle:g})">'
    width, height = field.HAND_WIDTH, field.HAND_HEIGHT
    yield f'<rect x="{-width / 2:g}" y="{-height / 2:g}" width="{width:g}" height="{height:g}"'
    yield ' rx="8" fill="#4a382c" filter="url(#shadow)"/></g>'
    for slot, piece in enumerate(stand.slots):
        if piece is not None:
            yield _card(piece, stand.pose(slot))
    if not state.passed[state.seat] and not any(move.piece == "pass" for move in scene.moved) and scene.carried != "pass":
        yield _card("pass", layout.pass_rest(state.seat, state.players))


def _robot(scene: Scene) -> Iterator[str]:
    """The robot from above: gaze, body, arm."""
    state = scene.state
    seat, players = state.seat or 0, max(state.players, 4)
    head = layout.face_of(seat, players)
    gaze_x, gaze_y = scene.gaze
    angle = math.degrees(math.atan2(gaze_y - head.y, gaze_x - head.x))
    distance = math.hypot(gaze_x - head.x, gaze_y - head.y)
    spread = 42.0
    yield f'<g transform="translate({head.x:g} {head.y:g}) rotate({angle:.1f})">'
    beam = f"M10 -10L{distance:.1f} {-spread}A{spread} {spread} 0 0 1 {distance:.1f} {spread}L10 10Z"
    yield f'<path d="{beam}" fill="#ffd95e" fill-opacity="0.28"/>'
    yield "</g>"
    yield f'<g transform="translate({head.x:g} {head.y:g}) rotate({layout.facing(seat, players):g})" filter="url(#shadow)">'
    yield '<rect x="-78" y="-34" width="156" height="74" rx="36" fill="url(#metal)" stroke="#2b2320" stroke-width="3"/>'
    yield '<circle cx="-62" cy="0" r="17" fill="#8a7660" stroke="#2b2320" stroke-width="3"/>'
    yield '<circle cx="62" cy="0" r="17" fill="#8a7660" stroke="#2b2320" stroke-width="3"/></g>'
    yield from _arm(scene, head.x, head.y, layout.facing(seat, players))
    yield f'<g transform="translate({head.x:g} {head.y:g}) rotate({angle + 90:.1f})">'
    yield '<circle r="38" fill="url(#metal)" stroke="#2b2320" stroke-width="3"/>'
    yield '<path d="M-26 -19A32 32 0 0 1 26 -19L20 -6H-20Z" fill="#2b2320"/>'
    yield '<circle cx="-11" cy="-17" r="5.5" fill="#7fdcff"/><circle cx="11" cy="-17" r="5.5" fill="#7fdcff"/>'
    yield '<path d="M0 18v10" class="ink"/><circle cy="31" r="5" fill="#c8552b"/></g>'


def _arm(scene: Scene, x: float, y: float, facing: float) -> Iterator[str]:
    """Two links and a gripper, from the robot's right shoulder."""
    turn = math.radians(facing)
    shoulder = (x + 62 * math.cos(turn), y + 62 * math.sin(turn))
    rest = (x + 130 * math.cos(turn) + 95 * math.sin(turn), y + 130 * math.sin(turn) - 95 * math.cos(turn))
    hand = scene.hand or rest
    reach = math.dist(shoulder, hand)
    link = max(reach / 2 * 1.04, 90)
    bend = math.acos(min(reach / 2 / link, 1.0))
    towards = math.atan2(hand[1] - shoulder[1], hand[0] - shoulder[0])
    elbow = (shoulder[0] + link * math.cos(towards + bend), shoulder[1] + link * math.sin(towards + bend))
    if scene.carried is not None:
        yield _card(scene.carried, Pose(hand[0], hand[1], facing), lifted=True)
    points = " ".join(f"{px:.1f},{py:.1f}" for px, py in (shoulder, elbow, hand))
    yield '<g filter="url(#shadow)">'
    yield f'<polyline class="round" points="{points}" stroke="#2b2320" stroke-width="30"/>'
    yield f'<polyline class="round" points="{points}" stroke="#e9e3d8" stroke-width="23"/>'
    for px, py in (shoulder, elbow):
        yield f'<circle cx="{px:.1f}" cy="{py:.1f}" r="16" fill="#c8552b" stroke="#2b2320" stroke-width="3"/>'
    direction = math.degrees(math.atan2(hand[1] - elbow[1], hand[0] - elbow[0]))
    yield f'<g transform="translate({hand[0]:.1f} {hand[1]:.1f}) rotate({direction:.1f})">'
    if scene.pointing:
        yield '<path class="round" d="M0 0H44" stroke="#2b2320" stroke-width="15"/>'
        yield '<path class="round" d="M0 0H43" stroke="#e9e3d8" stroke-width="9"/>'
    else:
        yield '<path d="M2 -16H24M2 16H24" stroke="#2b2320" stroke-width="11" stroke-linecap="round"/>'
    yield '<circle r="19" fill="#8a7660" stroke="#2b2320" stroke-width="3"/></g></g>'


def _speech(scene: Scene) -> Iterator[str]:
    """The speech bubble, beside the robot's head and inside the picture."""
    if not scene.speech:
        return
    seat, players = scene.state.seat or 0, max(scene.state.players, 4)
    head = layout.face_of(seat, players)
    lines = _wrap(scene.speech)
    width = max(max(map(len, lines)) * 13.2 + 56, 150)
    height = len(lines) * 33 + 34
    left, top, view_width, view_height = VIEW
    side = -1 if head.y < field.HEIGHT / 2 else 1
    x = min(max(head.x + side * (width / 2 + 110), left + width / 2 + 16), left + view_width - width / 2 - 16)
    y = min(
        max(head.y - 60 if head.y > field.HEIGHT / 2 else head.y + 20, top + height / 2 + 16), top + view_height - height / 2 - 16
    )
    if abs(head.x - field.WIDTH / 2) > field.WIDTH / 2:  # At a short side the bubble is above the robot.
        x = min(max(head.x, left + width / 2 + 16), left + view_width - width / 2 - 16)
        y = head.y - 110 - height / 2
    dx, dy = head.x - x, head.y - y
    length = math.hypot(dx, dy)
    tip_x, tip_y = head.x - dx / length * 56, head.y - dy / length * 56
    across_x, across_y = -dy / length * 20, dx / length * 20
    outline = 'fill="#fffdf8" stroke="#2b2320" stroke-width="3" stroke-linejoin="round"'
    tail = f"M{x + across_x:.1f} {y + across_y:.1f}L{tip_x:.1f} {tip_y:.1f}L{x - across_x:.1f} {y - across_y:.1f}Z"
    box = f'<rect x="{x - width / 2:.1f}" y="{y - height / 2:.1f}" width="{width:.1f}" height="{height:.1f}" rx="26"'
    yield f'<g filter="url(#shadow)"><path d="{tail}" {outline}/>{box} {outline}/></g>'
    yield f'<path d="{tail}" fill="#fffdf8"/>'
    for number, line in enumerate(lines):
        yield f'<text x="{x:.1f}" y="{y - height / 2 + 45 + 33 * number:.1f}" font-size="27">{escape(line)}</text>'


def _face(scene: Scene) -> Iterator[str]:
    """The robot's face, enlarged in a corner: mouth by valence, eyes and brows by arousal."""
    valence, arousal = scene.mood.valence, scene.mood.arousal
    left, top, width, _ = VIEW
    yield f'<g transform="translate({left + width - 128:g} {top + 122:g})" filter="url(#shadow)">'
    yield '<rect x="-100" y="-96" width="200" height="176" rx="52" fill="url(#metal)" stroke="#2b2320" stroke-width="4"/>'
    yield '<rect x="-80" y="-74" width="160" height="126" rx="34" fill="#22303a"/>'
    eye = 13 + 7 * arousal
    for side in (-1, 1):
        yield f'<ellipse cx="{side * 34}" cy="-22" rx="13" ry="{max(eye, 4):.1f}" fill="#7fdcff"/>'
        inner = -46 - 6 * arousal + (14 * -valence if valence < 0 else 0)
        outer = -46 - 6 * arousal - (10 * -valence if valence < 0 else 0)
        if valence < -0.2 and arousal <= 0.2:  # Sad brows fall outwards.
            inner, outer = outer, inner
        yield f'<path class="screen" d="M{side * 20} {inner:.1f}L{side * 48} {outer:.1f}"/>'
    bend = 26 * valence
    yield f'<path class="screen" d="M-30 {24 - bend / 2:.1f}Q0 {24 + bend:.1f} 30 {24 - bend / 2:.1f}"/>'
    yield f'<text x="0" y="110" font-size="24">{escape(scene.mood.label)}</text></g>'


def _card(piece: str, pose: Pose, *, lifted: bool = False) -> str:
    """A piece, face up."""
    width, height = field.CARD_WIDTH, field.CARD_HEIGHT
    fill = {"golden": "#fff0b8", "joker": "#fdf3f8", "pass": "#fbe6de"}.get(piece, "#fffdf8")
    scale = " scale(1.12)" if lifted else ""
    corner = {"golden": "11★", "joker": "J", "pass": ""}.get(piece, piece)
    if piece == "pass":
        inside = '<text class="bold" y="8" font-size="24" style="fill:#a3240f">PASS</text>'
    else:
        symbol = (
            _symbol(_SYMBOLS[piece], -21, -12, 42)
            if piece in _SYMBOLS
            else f'<text class="bold" y="16" font-size="40">{piece}</text>'
        )
        inside = f'{symbol}<text class="bold" x="-12" y="-22" font-size="{20 if len(corner) < 3 else 16}">{corner}</text>'
    return (
        f'<g transform="translate({pose.x:g} {pose.y:g}) rotate({pose.angle:g}){scale}"><rect x="{-width / 2}" y="{-height / 2}"'
        f' width="{width}" height="{height}" rx="5" fill="{fill}" stroke="#8a7660" stroke-width="1.5"'
        f"{' filter=' + chr(34) + 'url(#shadow)' + chr(34) if lifted else ''}/>{inside}</g>"
    )


def _role(state: TableState, seat: int) -> str:
    """The symbol of a seat's role; empty if it has none."""
    names = ("", "role-chef.svg", "role-sous-chef.svg", "role-cook.svg", "role-waiter.svg", "role-dishwasher.svg")
    return names[state.roles[seat]] if seat < len(state.roles) else ""


def _symbol(name: str, x: float, y: float, size: float) -> str:
    """A drawing of the printed game."""
    return f'<svg x="{x:g}" y="{y:g}" width="{size:g}" height="{size:g}" {_drawing(name)}</svg>'


@cache
def _drawing(name: str) -> str:
    """The attributes and content of a symbol's file, without the opening and the end of its root element."""
    text = (_ASSETS / name).read_text()
    found = re.search(r"<svg xmlns=\S+ (.*)</svg>", text, re.DOTALL)
    assert found is not None, "symbols are SVG files of the same form"
    return found.group(1)


def _wrap(text: str) -> list[str]:
    """Breaks a sentence into lines."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + len(word) + 1 > BUBBLE_CHARACTERS:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines
