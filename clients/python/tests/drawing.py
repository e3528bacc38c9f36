"""A figure, and the size of a picture. Contains no tests."""

import struct

from chefshat.learn.figures import Figure, Level, Line, Panel, Points


def a_figure() -> Figure:
    lines = [Line("learner", [1, 2], [0.123456789, 2.0], [0.0, 1.0], [1.0, 3.0])]
    points = [Points("ours", [1.0, float("nan")], [0.5, float("nan")], [1.5, float("nan")])]
    panels = [
        Panel("Over time", "Shift", "reward", lines=lines, levels=[Level("paper", 0.5)], y_range=(-1, 3)),
        Panel("By condition", "", "laps", points=points, categories=["all", "none"]),
    ]
    return Figure("curves", "All of it", panels)


def png_size(picture: bytes) -> tuple[int, int]:
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    assert picture[12:16] == b"IHDR"
    width, height = struct.unpack(">II", picture[16:24])
    return width, height
