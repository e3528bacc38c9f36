"""Perception: from pictures of the table to events.

What a bridge needs is `Observed`, the events of the table (`events`): `Laid`, `TakenBack`, `Cleared`, `PassShown`, `PassWithdrawn`,
`Doubt`, `DoubtResolved` and `FieldChanged`.
"""

from .camera import Camera
from .events import (
    Cleared,
    Doubt,
    DoubtResolved,
    FieldChanged,
    FieldState,
    Laid,
    Observed,
    PassShown,
    PassWithdrawn,
    Picture,
    TakenBack,
    from_json,
    to_json,
)
from .frames import Frame, SourceError, open_source
from .perception import Perception
from .recording import Recorder, replay

__all__ = [
    "Camera",
    "Cleared",
    "Doubt",
    "DoubtResolved",
    "FieldChanged",
    "FieldState",
    "Frame",
    "Laid",
    "Observed",
    "PassShown",
    "PassWithdrawn",
    "Perception",
    "Picture",
    "Recorder",
    "SourceError",
    "TakenBack",
    "from_json",
    "open_source",
    "replay",
    "to_json",
]
