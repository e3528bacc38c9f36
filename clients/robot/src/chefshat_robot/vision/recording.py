"""Recordings: what the camera saw, in a folder, to be run again without the camera.

A folder holds `sightings.jsonl` (a header, then one line for each frame and one for each answer to a doubt), `events.jsonl` (what
was reported) and, if wanted, the frames as `frames/00000000.jpg`. Running the sightings again gives the same events; running the
frames again also tests the reading of tags, but their compression may change what is read.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

import cv2
from chefshat.files import check_readable

from chefshat_robot.deck import Card

from .decider import Decider
from .events import Observed, to_json
from .frames import Frame
from .reader import Sighting

LOG = logging.getLogger("chefshat_robot")
VERSION = 1
"""Version of the format."""
JPEG_QUALITY = 92


class Recorder:
    """Writes a recording. If it cannot be written any more, for instance to a full disk, a warning says so, and it ends there.

    Args:
        folder: The folder; it is created, and must not hold a recording yet.
        deck: The deck that is played with, as `Perception` got it.
        frames: Whether to keep the frames too: about 10 MB a minute in JPEG for each frame per second.

    Raises:
        FileExistsError: The folder holds a recording.
        OSError: The recording cannot be begun.
    """

    def __init__(self, folder: Path, deck: int | None = None, frames: bool = False) -> None:
        self._frames = folder / "frames" if frames else None
        (self._frames or folder).mkdir(parents=True, exist_ok=True)
        self._sightings: TextIO = (folder / "sightings.jsonl").open("x", encoding="utf-8")
        self._events: TextIO = (folder / "events.jsonl").open("w", encoding="utf-8")
        self._folder = folder
        self._is_over = False
        self._write(self._sightings, {"recording": VERSION, "deck": deck})

    def saw(self, frame: Frame, sighting: Sighting) -> None:
        """Writes what a frame showed."""
        self._write(self._sightings, sighting.to_json())
        if self._frames is not None and not self._is_over:
            path = self._frames / f"{frame.index:08}.jpg"
            if not cv2.imwrite(str(path), frame.image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]):
                self._end(f"{path} cannot be written")

    def answered(self, number: int, reading: Card | bool | None) -> None:
        """Writes the answer to a doubt."""
        value = {"deck": reading.deck, "index": reading.index} if isinstance(reading, Card) else reading
        self._write(self._sightings, {"answer": number, "reading": value})

    def reported(self, event: Observed) -> None:
        """Writes an event."""
        self._write(self._events, to_json(event))

    def close(self) -> None:
        """Closes the files."""
        for file in (self._sightings, self._events):
            try:
                file.close()
            except OSError as error:
                self._end(error)

    def _write(self, file: TextIO, values: dict[str, Any]) -> None:
        """Writes a line, unless an earlier one could not be written."""
        if self._is_over:
            return
        try:
            file.write(json.dumps(values, separators=(",", ":")) + "\n")
        except OSError as error:
            self._end(error)

    def _end(self, reason: object) -> None:
        """Ends the recording. The game is more important, so what watches it is not stopped."""
        if not self._is_over:
            LOG.warning("the recording in %s ends here: %s", self._folder, reason)
        self._is_over = True

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def replay(folder: Path) -> Iterator[Observed]:
    """The events of a recording, decided again from its sightings and answers; without a last line that was not written to its end.

    Raises:
        OSError: The recording cannot be read.
        ValueError: A line of it is not one of a recording, or of another version; the message names it.
    """
    path = folder / "sightings.jsonl"
    check_readable(path, "recording", "`--record` writes")
    decider: Decider | None = None
    with path.open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, start=1):
            if not line.endswith("\n"):
                LOG.warning("the last line of %s is left out: it was not written to its end", path)
                return
            try:
                values: dict[str, Any] = json.loads(line)
                if decider is None:
                    if values["recording"] != VERSION:
                        raise ValueError(f"version {values['recording']}; this program reads version {VERSION}")
                    decider = Decider(values["deck"])
                elif "answer" in values:
                    reading = values["reading"]
                    yield from decider.answer(values["answer"], Card(**reading) if isinstance(reading, dict) else reading)
                else:
                    yield from decider.see(Sighting.from_json(values))
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"{path}, line {number}: {error}") from error
