"""What lies on and beside a synthetic table, as pictures: the table, the field sheet, cards, hands.

Pictures of pieces and hands are BGRA with colours multiplied by alpha. They are drawn from the geometry of `deck` and `field`, in
one look of their own: the reader must not depend on how the cards are painted.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import field
from chefshat_robot.deck import FIELD_TAGS, Piece, PieceKind
from chefshat_robot.vision.events import Picture

PIECE_SCALE = 4.0
"""Pixels per mm of the pictures of pieces."""
PIECE_MARGIN = 5.0
"""Margin around a piece for its shadow, in mm."""
TABLE_SCALE = 2.0
"""Pixels per mm of the table and the field sheet."""
TABLE_MARGIN = 300.0
"""How far the table reaches beyond the field on each side, in mm."""
HAND_SCALE = 2.0
"""Pixels per mm of a hand."""
HAND_SIZE = (150.0, 900.0)
"""Width and length of the picture of a hand with its arm, in mm. The finger tips are at the middle of the short upper edge."""

_NAMES = (
    "TRUFFLE",
    "SHRIMP",
    "ANCHOVY",
    "ARTICHOKE",
    "CHILLI",
    "BASIL",
    "OLIVE",
    "PEPPER",
    "MUSHROOM",
    "TOMATO",
    "MOZZARELLA",
    "JOKER",
)
_FONT = cv2.FONT_HERSHEY_DUPLEX


@lru_cache(maxsize=700)
def tag_picture(tag: int, edge: int) -> Picture:
    """An AprilTag 36h11 in grey, with its black border.

    Args:
        tag: Its number, 0..586.
        edge: Edge in pixels; not less than 8.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return np.asarray(cv2.aruco.generateImageMarker(dictionary, tag, edge), dtype=np.uint8)


@lru_cache(maxsize=400)
def piece_picture(piece: Piece, face_down: bool = False, smudged: tuple[bool, bool] = (False, False)) -> Picture:
    """A piece with a soft shadow around it: BGRA, colours multiplied by alpha, `PIECE_SCALE` pixels per mm."""
    scale = PIECE_SCALE
    width, height = round(field.CARD_WIDTH * scale), round(field.CARD_HEIGHT * scale)
    card = np.full((height, width, 3), 244, np.uint8)
    if face_down:
        _paint_back(card)
    else:
        _paint_front(card, piece)
        for smudge in smudged:
            if smudge:
                _smudge(card, piece.tag)
            card = np.ascontiguousarray(card[::-1, ::-1])
    margin = round(PIECE_MARGIN * scale)
    shape = (height + 2 * margin, width + 2 * margin)
    mask = np.zeros(shape, np.uint8)
    radius = round(3.5 * scale)
    cv2.rectangle(mask, (margin + radius, margin), (margin + width - radius, margin + height), 255, -1)
    cv2.rectangle(mask, (margin, margin + radius), (margin + width, margin + height - radius), 255, -1)
    for x in (margin + radius, margin + width - radius):
        for y in (margin + radius, margin + height - radius):
            cv2.circle(mask, (x, y), radius, 255, -1, cv2.LINE_AA)
    shadow = cv2.GaussianBlur(mask, (0, 0), 1.3 * scale)
    alpha = np.maximum(mask, (shadow * 0.45).astype(np.uint8))
    picture = np.zeros((*shape, 4), np.uint8)
    picture[margin:-margin, margin:-margin, :3] = card
    picture[..., :3] = (picture[..., :3] * (mask[..., None] / 255.0)).astype(np.uint8)
    picture[..., 3] = alpha
    return picture


def _paint_front(card: Picture, piece: Piece) -> None:
    """The face of a piece: tags, number, a coloured panel with a drawing, and a name."""
    scale = PIECE_SCALE
    height, width = card.shape[:2]
    face = 0 if piece.card is None else piece.card.face
    colour = tuple(int(c) for c in cv2.cvtColor(np.array([[[face * 14 % 180, 120, 225]]], np.uint8), cv2.COLOR_HSV2BGR)[0, 0])
    dark = tuple(c // 2 for c in colour)
    inset = round(3 * scale)
    cv2.rectangle(card, (inset, inset), (width - inset, height - inset), dark, 2, cv2.LINE_AA)
    centre = (width // 2, height // 2)
    cv2.ellipse(card, centre, (round(20 * scale), round(19 * scale)), 0, 0, 360, colour, -1, cv2.LINE_AA)
    rng = np.random.default_rng(face)
    for _ in range(3 + face):
        x, y = (np.array(centre) + rng.uniform(-11, 11, 2) * scale).astype(int)
        cv2.circle(card, (int(x), int(y)), round(rng.uniform(1.5, 5) * scale), dark, -1, cv2.LINE_AA)
        cv2.circle(card, (int(x) - 4, int(y) - 4), round(1.2 * scale), (250, 250, 250), -1, cv2.LINE_AA)
    if piece.kind is PieceKind.PASS:
        number, name = "P", "PASS"
    else:
        number, name = str(face) if face <= 11 else "J", _NAMES[face - 1]
    for _ in range(2):
        (text_width, _), _ = cv2.getTextSize(number, _FONT, 1.9, 5)
        at = (width - text_width - round(7 * scale), round(18 * scale))
        cv2.putText(card, number, at, _FONT, 1.9, (40, 30, 30), 5, cv2.LINE_AA)
        (text_width, _), _ = cv2.getTextSize(name, _FONT, 0.55, 1)
        cv2.putText(
            card, name, (width - text_width - round(6 * scale), round(24 * scale)), _FONT, 0.55, (40, 30, 30), 1, cv2.LINE_AA
        )
        edge = round(field.CARD_TAG_SIZE * scale)
        x0, y0 = (round((c - field.CARD_TAG_SIZE / 2) * scale) for c in field.CARD_TAG_CENTRE)
        quiet = edge // 8
        cv2.rectangle(card, (x0 - quiet, y0 - quiet), (x0 + edge + quiet, y0 + edge + quiet), (244, 244, 244), -1)
        card[y0 : y0 + edge, x0 : x0 + edge] = tag_picture(piece.tag, edge)[..., None]
        card[:] = card[::-1, ::-1].copy()


def _smudge(card: Picture, seed: int) -> None:
    """Makes the tag in the top left corner of a card unreadable."""
    rng = np.random.default_rng(seed)
    for _ in range(3):
        x, y = ((np.array(field.CARD_TAG_CENTRE) + rng.uniform(-4, 4, 2)) * PIECE_SCALE).astype(int)
        axes = (round(rng.uniform(5, 8) * PIECE_SCALE), round(rng.uniform(2, 4) * PIECE_SCALE))
        cv2.ellipse(card, (int(x), int(y)), axes, rng.uniform(0, 180), 0, 360, (92, 120, 150), -1, cv2.LINE_AA)


def _paint_back(card: Picture) -> None:
    """The back of a piece: a pattern without any code."""
    scale = PIECE_SCALE
    height, width = card.shape[:2]
    inset = round(4 * scale)
    cv2.rectangle(card, (inset, inset), (width - inset, height - inset), (60, 60, 170), -1)
    for start in range(-height, width, round(6 * scale)):
        cv2.line(card, (start, 0), (start + height, height), (220, 220, 235), 2, cv2.LINE_AA)
        cv2.line(card, (start + height, 0), (start, height), (220, 220, 235), 2, cv2.LINE_AA)


@lru_cache(maxsize=2)
def table_picture(seed: int) -> Picture:
    """The empty table with the field sheet and things beside it: `TABLE_SCALE` pixels per mm, `TABLE_MARGIN` around the field."""
    rng = np.random.default_rng(seed)
    width, height = (round((edge + 2 * TABLE_MARGIN) * TABLE_SCALE) for edge in (field.WIDTH, field.HEIGHT))
    table = _wood(rng, width, height)
    _paint_clutter(table, rng)
    _paint_sheet(table)
    return table


def _wood(rng: np.random.Generator, width: int, height: int) -> Picture:
    """Planks of wood."""
    grain = rng.normal(0, 1, (height // 2, width // 60)).astype(np.float32)
    coarse = cv2.resize(grain, (width, height), interpolation=cv2.INTER_CUBIC)
    fine = cv2.resize(rng.normal(0, 1, (height, width // 12)).astype(np.float32), (width, height))
    tone = 8.0 * coarse + 4.0 * fine
    plank = round(130 * TABLE_SCALE)
    for top in range(0, height, plank):
        tone[top : top + plank] += rng.normal(0, 9)
        tone[top : top + 4] -= 35
    base = np.array([72, 105, 148], np.float32) * rng.uniform(0.75, 1.15)
    return np.asarray(np.clip(base + tone[..., None] * np.array([0.8, 1.0, 1.1], np.float32), 0, 255), np.uint8)


def _paint_clutter(table: Picture, rng: np.random.Generator) -> None:
    """A mug, a telephone and a pencil beside the field."""

    def at(x: float, y: float) -> tuple[int, int]:
        return round((x + TABLE_MARGIN) * TABLE_SCALE), round((y + TABLE_MARGIN) * TABLE_SCALE)

    shade = table.copy()
    mug = (-70.0 + rng.uniform(-15, 5), 60.0 + rng.uniform(-20, 120))
    cv2.circle(shade, at(mug[0] + 12, mug[1] + 12), round(46 * TABLE_SCALE), (20, 25, 30), -1)
    phone = (field.WIDTH + 60.0 + rng.uniform(0, 15), rng.uniform(100, 260))
    box = cv2.boxPoints((at(phone[0] + 4, phone[1] + 4), (75 * TABLE_SCALE, 152 * TABLE_SCALE), rng.uniform(-20, 20)))
    cv2.fillPoly(shade, [box.astype(np.int32)], (15, 15, 15))
    table[:] = cv2.addWeighted(cv2.GaussianBlur(shade, (0, 0), 9), 0.6, table, 0.4, 0)
    cv2.circle(table, at(*mug), round(42 * TABLE_SCALE), (190, 150, 90), -1, cv2.LINE_AA)
    cv2.circle(table, at(*mug), round(37 * TABLE_SCALE), (25, 40, 70), -1, cv2.LINE_AA)
    cv2.ellipse(table, at(mug[0] - 8, mug[1] - 10), (40, 20), 30, 0, 360, (60, 85, 120), -1, cv2.LINE_AA)
    body = (box - np.array([10.0, 10.0])).astype(np.int32)
    cv2.fillPoly(table, [body], (38, 36, 34), cv2.LINE_AA)
    cv2.polylines(table, [body], True, (110, 110, 115), 3, cv2.LINE_AA)
    cv2.line(table, at(150, field.HEIGHT + 70), at(310, field.HEIGHT + 50), (40, 160, 220), round(7 * TABLE_SCALE), cv2.LINE_AA)


def _paint_sheet(table: Picture) -> None:
    """The field sheet with its corner tags and marked places."""
    scale = TABLE_SCALE

    def at(x: float, y: float) -> tuple[int, int]:
        return round((x + TABLE_MARGIN) * scale), round((y + TABLE_MARGIN) * scale)

    shade = table.copy()
    cv2.rectangle(shade, at(-3, -3), at(field.WIDTH + 5, field.HEIGHT + 6), (20, 20, 20), -1)
    table[:] = cv2.addWeighted(cv2.GaussianBlur(shade, (0, 0), 3 * scale), 0.5, table, 0.5, 0)
    cv2.rectangle(table, at(0, 0), at(field.WIDTH, field.HEIGHT), (222, 234, 236), -1)
    for number, (x, y) in enumerate(field.corner_tags()):
        edge = round(field.FIELD_TAG_SIZE * scale)
        left, top = at(x - field.FIELD_TAG_SIZE / 2, y - field.FIELD_TAG_SIZE / 2)
        table[top : top + edge, left : left + edge] = tag_picture(FIELD_TAGS + number, edge)[..., None]
    for place in field.places() + field.pass_places():
        turned = place.angle % 180 == 90
        half_width, half_height = field.CARD_WIDTH / 2 + 1, field.CARD_HEIGHT / 2 + 1
        if turned:
            half_width, half_height = half_height, half_width
        top_left, bottom_right = at(place.x - half_width, place.y - half_height), at(place.x + half_width, place.y + half_height)
        cv2.rectangle(table, top_left, bottom_right, (150, 160, 160), 3, cv2.LINE_AA)
        label = place.name.upper() if place.name.startswith("pass") else place.name
        size = 0.9 if place.name.startswith("pass") else 2.0
        (text_width, text_height), _ = cv2.getTextSize(label, _FONT, size, 3)
        x, y = at(place.x, place.y)
        cv2.putText(table, label, (x - text_width // 2, y + text_height // 2), _FONT, size, (165, 178, 178), 3, cv2.LINE_AA)


@lru_cache(maxsize=8)
def hand_picture(seat: int) -> Picture:
    """A hand with its arm, pointing up: BGRA, colours multiplied by alpha, `HAND_SCALE` pixels per mm, `HAND_SIZE` mm."""
    rng = np.random.default_rng(1000 + seat)
    width, height = (round(edge * HAND_SCALE) for edge in HAND_SIZE)
    skin_mask = np.zeros((height, width), np.uint8)
    sleeve_mask = np.zeros((height, width), np.uint8)
    middle = HAND_SIZE[0] / 2

    def at(x: float, y: float) -> tuple[int, int]:
        return round((middle + x) * HAND_SCALE), round(y * HAND_SCALE)

    fingers = [(-30.0, 26.0, -22.0, 95.0), (-11.0, 8.0, -9.0, 95.0), (9.0, 9.0, 6.0, 95.0), (27.0, 24.0, 20.0, 95.0)]
    for x0, y0, x1, y1 in fingers:
        cv2.line(skin_mask, at(x0, y0), at(x1, y1), 255, round(15.5 * HAND_SCALE), cv2.LINE_AA)
    cv2.line(skin_mask, at(-52, 92), at(-28, 145), 255, round(18 * HAND_SCALE), cv2.LINE_AA)
    cv2.ellipse(skin_mask, at(0, 125), (round(38 * HAND_SCALE), round(52 * HAND_SCALE)), 0, 0, 360, 255, -1, cv2.LINE_AA)
    cv2.line(skin_mask, at(0, 150), at(0, 260), 255, round(50 * HAND_SCALE), cv2.LINE_AA)
    points = [at(-34, 240), at(34, 240), at(60, HAND_SIZE[1]), at(-60, HAND_SIZE[1])]
    cv2.fillPoly(sleeve_mask, [np.array(points, np.int32)], 255, cv2.LINE_AA)
    skin = np.array([[120, 150, 205], [95, 125, 180], [60, 85, 130], [140, 170, 225]][seat % 4], np.float32)
    sleeve = np.array([[120, 70, 40], [60, 60, 65], [50, 90, 50], [40, 40, 140]][seat % 4], np.float32)
    picture = np.zeros((height, width, 4), np.float32)
    for mask, colour, depth, grain in ((skin_mask, skin, 20.0, 3.0), (sleeve_mask, sleeve, 55.0, 7.0)):
        inside = cv2.distanceTransform((mask > 127).astype(np.uint8), cv2.DIST_L2, 5) / HAND_SCALE
        light = 0.55 + 0.5 * np.sqrt(np.clip(inside / depth, 0.0, 1.0))
        texture = cv2.GaussianBlur(rng.normal(0, 1, (height, width)).astype(np.float32), (0, 0), 2.0) * grain * 3
        shaded = np.clip(colour * light[..., None] + texture[..., None], 0, 255)
        alpha = (mask / 255.0)[..., None].astype(np.float32)
        picture[..., :3] = picture[..., :3] * (1 - alpha) + shaded * alpha
        picture[..., 3:] = picture[..., 3:] * (1 - alpha) + 255 * alpha
    for x0, y0, _, _ in fingers:
        cv2.ellipse(
            picture, at(x0 * 0.98, y0 - 1), (round(4.5 * HAND_SCALE), round(5.5 * HAND_SCALE)), 0, 0, 360, (175, 190, 225, 255), -1
        )
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.2), np.uint8)


def placed(centre: tuple[float, float], angle: float, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a thing turned clockwise by `angle` degrees and moved to `centre`; shape (n, 2), mm."""
    turn = math.radians(angle)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return np.asarray(corners @ rotation.T + np.asarray(centre), dtype=np.float64)
