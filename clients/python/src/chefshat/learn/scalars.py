"""Numbers of a training as curves in TensorBoard, while it runs. `curve` draws them afterwards, from a log."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self


class Scalars:
    """Writes numbers to a folder for TensorBoard; a context manager. Without a folder it writes nothing."""

    def __init__(self, folder: Path | None, decisions: int = 0) -> None:
        """Opens the folder, which is created.

        Args:
            folder: the folder.
            decisions: those of a training that is resumed. What was written after them is played again, and not shown.
        """
        self._writer = None
        if folder is not None:
            from tensorboardX import SummaryWriter

            self._writer = SummaryWriter(str(folder), purge_step=decisions + 1 if decisions else None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None) -> None:
        if self._writer is not None:
            self._writer.close()

    def add(self, group: str, numbers: Mapping[str, float], decisions: int) -> None:
        """Writes numbers by name at a number of decisions."""
        if self._writer is not None:
            for name, number in numbers.items():
                self._writer.add_scalar(f"{group}/{name}", number, decisions)
