"""How hard the pictures of a synthetic table are to read: every disturbance as a number, and three settings of them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Difficulty:
    """The disturbances of a synthetic table. Lengths on the table are in mm, times in s, lengths in the picture in pixels at 720p.

    Attributes:
        tilt: Angle between the camera's axis and the vertical, in degrees.
        distortion: Radial distortion k1 of the lens; negative is a barrel, as of a wide-angle webcam.
        blur: Standard deviation of the focus blur, in pixels at 720p; it grows with the height of the picture.
        exposure: Time during which moving things blur, in s.
        noise: Standard deviation of the noise, in grey levels (0..255).
        vignette: Darkening in the corners of the picture, 0..1.
        light_change: Size of slow changes and of sudden steps of the light, as a part of it, 0..1.
        flicker: Change of the light from frame to frame, as a part of it, 0..1.
        shadows: Darkness of soft shadows that wander over the table, 0..1.
        glare: Strength of reflections of lamps that come and go, 0..1. At 1 their centre is white.
        shift: Standard deviation of how far cards lie from the centre of their place, in mm.
        turn: Standard deviation of how far cards are turned from their place, in degrees.
        upside_down: Probability that a card is turned by half a turn.
        smudged: Probability, for each of a piece's two tags, that it cannot be read: a stain, a fold, a mirroring sleeve.
        hovers: Probability, at each turn, that a hand also passes over the places without doing anything.
        pause: Shortest and longest time between a hand's leaving and the next hand's coming, in s.
    """

    name: str
    tilt: float
    distortion: float
    blur: float
    exposure: float
    noise: float
    vignette: float
    light_change: float
    flicker: float
    shadows: float
    glare: float
    shift: float
    turn: float
    upside_down: float
    smudged: float
    hovers: float
    pause: tuple[float, float]


EASY = Difficulty(
    name="easy",
    tilt=6.0,
    distortion=-0.05,
    blur=0.6,
    exposure=0.004,
    noise=2.0,
    vignette=0.1,
    light_change=0.03,
    flicker=0.0,
    shadows=0.1,
    glare=0.0,
    shift=2.0,
    turn=2.0,
    upside_down=0.2,
    smudged=0.0,
    hovers=0.0,
    pause=(0.7, 1.2),
)
"""A camera straight above the table in good light; cards laid neatly."""

MEDIUM = Difficulty(
    name="medium",
    tilt=20.0,
    distortion=-0.15,
    blur=1.0,
    exposure=0.01,
    noise=6.0,
    vignette=0.25,
    light_change=0.15,
    flicker=0.01,
    shadows=0.25,
    glare=0.45,
    shift=4.0,
    turn=6.0,
    upside_down=0.5,
    smudged=0.03,
    hovers=0.1,
    pause=(0.6, 1.0),
)
"""An ordinary webcam at an angle in a living room; cards laid as people lay them."""

HARD = Difficulty(
    name="hard",
    tilt=32.0,
    distortion=-0.25,
    blur=1.35,
    exposure=0.02,
    noise=11.0,
    vignette=0.4,
    light_change=0.3,
    flicker=0.03,
    shadows=0.45,
    glare=0.9,
    shift=6.0,
    turn=12.0,
    upside_down=0.5,
    smudged=0.12,
    hovers=0.2,
    pause=(0.5, 0.9),
)
"""A cheap wide-angle webcam at a steep angle in bad light, lamps that reflect, careless hands, and fast players."""

DIFFICULTIES = {difficulty.name: difficulty for difficulty in (EASY, MEDIUM, HARD)}
"""The three settings by their names."""
