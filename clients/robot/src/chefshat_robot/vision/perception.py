"""Perception: frames in, events out. Joins the reader and the decider."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from chefshat_robot.deck import Card

from .camera import Camera
from .decider import SETTLE_READS, Decider
from .events import Doubt, Observed, Picture
from .frames import Frame
from .reader import Reader, Sighting
from .recording import Recorder

KEPT_LOOKS = 5
"""A picture for a doubt is kept until its place has changed so many times."""


class Perception:
    """Watches the table through one camera.

    Start it while the field is empty if you can, and no arm reaches over it. Cards that lie there already are reported as found
    (`Laid.found`), with those that are laid beside them before the field is at rest.

    Args:
        camera: The intrinsics of the camera; None: a lens without distortion is assumed.
        deck: The deck that is played with, 0..6; cards of other decks are ignored. None: any deck.
        recorder: Writes what is seen, answered and reported.

    Attributes:
        sighting: What the last frame showed; None before the first.
    """

    def __init__(self, camera: Camera | None = None, deck: int | None = None, recorder: Recorder | None = None) -> None:
        self.sighting: Sighting | None = None
        self._reader = Reader(camera)
        self._decider = Decider(deck)
        self._recorder = recorder
        self._pictures: dict[tuple[int, int], Picture] = {}
        """Pictures for doubts, by place and look."""

    def see(self, frame: Frame) -> list[Observed]:
        """Takes in the next frame and returns what is now certain, in order.

        Raises:
            ValueError: The camera was calibrated for pictures of other proportions.
        """
        self.sighting = self._reader.read(frame, attention=self._decider.unexplained)
        events = self._decider.see(self.sighting)
        for spot in self._decider.unexplained:
            place = self.sighting.places[spot]
            if place.still == SETTLE_READS:
                old = [key for key in self._pictures if key[0] == spot and key[1] <= place.look - KEPT_LOOKS]
                for key in old:
                    del self._pictures[key]
                self._pictures[spot, place.look] = self._reader.cut_out(frame.image, spot)
        if self._recorder is not None:
            self._recorder.saw(frame, self.sighting)
        return self._reported([self._with_picture(event) if isinstance(event, Doubt) else event for event in events])

    def watch(self, frames: Iterable[Frame]) -> Iterator[Observed]:
        """The events of a sequence of frames, as they become certain."""
        for frame in frames:
            yield from self.see(frame)

    def is_open(self, number: int) -> bool:
        """Whether a doubt is open: neither answered nor resolved."""
        return self._decider.look_of_doubt(number) is not None

    def answer(self, number: int, reading: Card | bool | None) -> list[Observed]:
        """Answers a doubt and returns the events that were waiting for it; see `Decider.answer`."""
        about = self._decider.look_of_doubt(number)
        events = self._decider.answer(number, reading)
        if about is not None and reading is False and not self._decider.lies_at(about[0]) and self._decider.shows(*about):
            self._reader.learn_empty(about[0])
        if self._recorder is not None:
            self._recorder.answered(number, reading)
        return self._reported(events)

    def answers(self, place: int) -> list[Card]:
        """The cards that may lie on top of a place, one of each face; see `Decider.answers`."""
        return self._decider.answers(place)

    @property
    def on_table(self) -> dict[Card, int]:
        """The cards that lie on the field and the place of each, 1..11; the lowest first."""
        return self._decider.on_table

    def _reported(self, events: list[Observed]) -> list[Observed]:
        """The events, written to the recording too."""
        if self._recorder is not None:
            for event in events:
                self._recorder.reported(event)
        return events

    def _with_picture(self, doubt: Doubt) -> Doubt:
        about = self._decider.look_of_doubt(doubt.number)
        return doubt if about is None else replace(doubt, picture=self._pictures.get(about))
