"""The synthetic table: a game at a real table as a camera would see it, with the truth beside each frame.

`script` says what happens, `table` plays it before a camera, `difficulty` says how hard the pictures are to read, `artwork` paints.
"""

from .difficulty import DIFFICULTIES, EASY, HARD, MEDIUM, Difficulty
from .script import Act, Clear, Hover, LayCards, ShowPass, TakeBack, WithdrawPass, acts_of_steps, random_shift, shifts_of_record
from .table import Bump, FrameTruth, Lying, SyntheticTable, TrueEvent

__all__ = [
    "DIFFICULTIES",
    "EASY",
    "HARD",
    "MEDIUM",
    "Act",
    "Bump",
    "Clear",
    "Difficulty",
    "FrameTruth",
    "Hover",
    "LayCards",
    "Lying",
    "ShowPass",
    "SyntheticTable",
    "TakeBack",
    "TrueEvent",
    "WithdrawPass",
    "acts_of_steps",
    "random_shift",
    "shifts_of_record",
]
