"""The progress of an experiment: a bar on stderr if that is a terminal, else nothing."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


class Progress:
    """Shows one bar at a time, for example:

    with progress.task("rules, seed 1", total=250, unit="Shift") as advance:
        for shift in range(250):
            ...
            advance(1)
    """

    def __init__(self, *, show: bool | None = None) -> None:
        """Sets whether to show bars; None: if stderr is a terminal."""
        self._show = sys.stderr.isatty() if show is None else show

    @contextmanager
    def task(self, what: str, total: int, unit: str) -> Iterator[Callable[[int], object]]:
        """Shows a bar for `total` units of work; yields a function to call with the number of further units done."""
        with tqdm(total=total, desc=what, unit=f" {unit}", file=sys.stderr, disable=not self._show, leave=False) as bar:
            yield bar.update
