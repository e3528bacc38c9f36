"""Where a robot stands, for robots that count from themselves: conversion of points on the table to metres before the robot.

Also the moods that robots have gestures for: the nearest to an expression.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chefshat_robot import field, layout
from chefshat_robot.drivers.driver import Express
from chefshat_robot.table import TableState

#: Valence and arousal of each mood, as on the page.
MOODS = {
    "joy": (0.8, 0.5),
    "amusement": (0.6, 0.7),
    "surprise": (0.1, 0.8),
    "concentration": (0.0, 0.2),
    "annoyance": (-0.6, 0.6),
    "sadness": (-0.7, -0.4),
}


@dataclass(frozen=True)
class Standpoint:
    """A robot's place at the table. It faces the middle of the field.

    Attributes:
        x: of its axis, mm.
        y: of its axis, mm.
        table_mm: height of the table above the origin of the robot's own frame.
    """

    x: float
    y: float
    table_mm: float

    @classmethod
    def at(cls, state: TableState, distance_mm: float, table_mm: float) -> Standpoint:
        """Returns the place at the robot's seat; at seat 0 if it has none yet.

        Args:
            state: the table.
            distance_mm: from the edge of the field to the robot's axis.
            table_mm: as above.
        """
        x, y = layout.beside(state.seat or 0, max(state.players, 4), distance_mm)
        return cls(x, y, table_mm)

    def before(self, x: float, y: float, z: float = 0.0) -> tuple[float, float, float]:
        """Returns a point in metres from the robot: forward, to its left, and up.

        Args:
            x: mm on the field.
            y: mm on the field.
            z: mm above the table.
        """
        ahead_x, ahead_y = field.WIDTH / 2 - self.x, field.HEIGHT / 2 - self.y
        length = math.hypot(ahead_x, ahead_y)
        ahead_x, ahead_y = ahead_x / length, ahead_y / length
        # The field's y points down as seen from above, so left of (1, 0) is (0, -1).
        left_x, left_y = ahead_y, -ahead_x
        dx, dy = x - self.x, y - self.y
        forward, left = dx * ahead_x + dy * ahead_y, dx * left_x + dy * left_y
        return round(forward / 1000, 4), round(left / 1000, 4), round((z + self.table_mm) / 1000, 4)

    def field_frame(self) -> tuple[float, float, float, float]:
        """Returns the frame `chefshat_field` of ROS as seen from the robot.

        It is described in `CardMove.msg`. Returns x, y and z of its origin in metres, and its yaw in radians.
        """
        x, y, z = self.before(0.0, 0.0)
        right_x, right_y, _ = self.before(field.WIDTH, 0.0)
        return x, y, z, math.atan2(right_y - y, right_x - x)


def mood_of(express: Express) -> str:
    """Returns the mood of an expression's label, or the nearest by valence and arousal."""
    if express.label in MOODS:
        return express.label
    return min(MOODS, key=lambda mood: math.dist(MOODS[mood], (express.valence, express.arousal)))
