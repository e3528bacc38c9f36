"""Pictures of single sheets before a camera: the calibration sheet at many angles, and a hand of cards before its strip."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import charuco, field
from chefshat_robot.deck import HAND_TAGS, Card, Piece, PieceKind
from chefshat_robot.vision.camera import Camera
from chefshat_robot.vision.events import Picture
from chefshat_robot.vision.frames import Frame

from . import artwork

_SCALE = 4.0
"""Pixels per mm of a sheet."""


def calibration_frames(
    camera: Camera, count: int, seed: int = 0, tilt: float = 40.0, spread: float = 1.0, noise: float = 3.0
) -> Iterator[Frame]:
    """Frames of the calibration sheet, each at another place and angle.

    Args:
        camera: The camera.
        count: How many frames.
        seed: Decides places, angles and noise.
        tilt: Biggest angle between the sheet and the picture, in degrees.
        spread: How far from the middle the sheet gets: 1 reaches the edges of the picture, 0 stays in the middle.
        noise: Standard deviation of the noise, in grey levels.
    """
    rng = np.random.default_rng((seed, 7))
    width, height = charuco.COLUMNS * charuco.SQUARE_SIZE, charuco.ROWS * charuco.SQUARE_SIZE
    size = (round(width * _SCALE), round(height * _SCALE))
    margin = round(10 * _SCALE)
    sheet = np.asarray(
        charuco.board().generateImage((size[0] + 2 * margin, size[1] + 2 * margin), marginSize=margin), dtype=np.uint8
    )
    sheet = np.asarray(cv2.cvtColor(sheet, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for index in range(count):
        axis = rng.uniform(0, 2 * math.pi)
        angle = math.radians(rng.uniform(0.4, 1.0) * tilt)
        turned = cv2.Rodrigues(np.array([math.cos(axis), math.sin(axis), 0.0]) * angle)[0]
        rotation = np.asarray(turned @ cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-0.4, 0.4)]))[0], dtype=np.float64)
        distance = float(rng.uniform(480, 620))
        reach = np.array([camera.width, camera.height]) / camera.matrix[0, 0] / 2 * distance
        at = rng.uniform(-0.75, 0.75, 2) * spread * reach
        image = _shown(sheet, (width, height), margin / _SCALE, rotation, np.array([*at, distance]), camera)
        yield Frame(index, index / 2.0, _with_noise(image, noise, rng))


def hand_frames(
    camera: Camera, hands: Sequence[Sequence[Card]], frames_each: int, seed: int = 0, noise: float = 4.0
) -> Iterator[tuple[Frame, tuple[Card, ...]]]:
    """Frames of a robot's own hand in its row before the strip, each with the cards it holds.

    Args:
        camera: The camera.
        hands: The hands to show, one after the other.
        frames_each: Frames of each hand.
        seed: Decides the camera's place and noise.
        noise: Standard deviation of the noise, in grey levels.
    """
    rng = np.random.default_rng((seed, 8))
    turned = cv2.Rodrigues(np.array([rng.uniform(0.1, 0.35), rng.uniform(-0.15, 0.15), rng.uniform(-0.05, 0.05)]))[0]
    rotation = np.asarray(turned, dtype=np.float64)
    distance = camera.matrix[0, 0] * field.HAND_WIDTH / (camera.width * 0.9)
    index = 0
    for cards in hands:
        sheet = _strip(cards)
        image = _shown(
            sheet, (field.HAND_WIDTH, field.HAND_HEIGHT), 0.0, rotation, np.array([0.0, 0.0, float(distance)]), camera, (70, 80, 95)
        )
        for _ in range(frames_each):
            yield Frame(index, index / 15.0, _with_noise(image, noise, rng)), tuple(cards)
            index += 1


def _strip(cards: Sequence[Card]) -> Picture:
    """The strip with a row of cards before it, `_SCALE` pixels per mm."""
    width, height = round(field.HAND_WIDTH * _SCALE), round(field.HAND_HEIGHT * _SCALE)
    strip = np.full((height, width, 3), 235, dtype=np.uint8)
    edge = round(field.CARD_TAG_SIZE * _SCALE)
    for number, (x, y) in enumerate(field.hand_tags()):
        left, top = round(x * _SCALE - edge / 2), round(y * _SCALE - edge / 2)
        strip[top : top + edge, left : left + edge] = artwork.tag_picture(HAND_TAGS + number, edge)[..., None]
    factor = _SCALE / artwork.PIECE_SCALE
    for card, place in zip(cards, field.hand_places(), strict=False):
        art = cv2.resize(artwork.piece_picture(Piece(PieceKind.CARD, card.deck, card.index)), None, fx=factor, fy=factor)
        left, top = round(place.x * _SCALE - art.shape[1] / 2), round(place.y * _SCALE - art.shape[0] / 2)
        right, bottom = min(left + art.shape[1], width), min(top + art.shape[0], height)
        art = art[max(-top, 0) : bottom - top, : right - left]
        region = strip[max(top, 0) : bottom, left:right]
        region[:] = (region * (1 - art[..., 3:] / 255.0) + art[..., :3]).astype(np.uint8)
    return strip


def _shown(
    sheet: Picture,
    size: tuple[float, float],
    margin: float,
    rotation: NDArray[np.float64],
    place: NDArray[np.float64],
    camera: Camera,
    background: tuple[int, int, int] = (90, 100, 110),
) -> Picture:
    """A flat sheet as a camera shows it; `size` in mm without its margin, `place` of its middle before the camera in mm."""
    xs, ys = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    pixels = camera.undistort(np.column_stack([xs.ravel(), ys.ravel()]))
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.matrix).T
    normal = rotation[:, 2]
    points = (rays * ((place @ normal) / (rays @ normal))[:, None] - place) @ rotation
    maps = ((points[:, :2] + np.array(size) / 2 + margin) * _SCALE - 0.5).astype(np.float32)
    maps = np.clip(maps, -1000, 30000)
    shape = (camera.height, camera.width)
    soft = cv2.GaussianBlur(sheet, (0, 0), 1.5)
    image = cv2.remap(
        soft,
        maps[:, 0].reshape(shape),
        maps[:, 1].reshape(shape),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=background,
    )
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.7), dtype=np.uint8)


def _with_noise(image: Picture, noise: float, rng: np.random.Generator) -> Picture:
    """The image as a sensor with noise sees it."""
    return np.clip(image + rng.normal(0, noise, image.shape), 0, 255).astype(np.uint8)
