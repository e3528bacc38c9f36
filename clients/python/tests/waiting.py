"""Waiting in tests for what another process does. No tests of its own."""

import subprocess
import time
from collections.abc import Callable

#: Seconds after which what has not come counts as never coming; far longer than any machine takes.
LIMIT_S = 300
# Seconds between two looks.
LOOK_S = 0.01


def wait_until(reached: Callable[[], object], what: str, process: "subprocess.Popen[str] | None" = None) -> None:
    """Waits until something is so. Fails and says what never came after the limit, or when the process ends that it is up to."""
    until = time.monotonic() + LIMIT_S
    while not reached():
        assert process is None or process.poll() is None, (what, process and process.communicate())
        assert time.monotonic() < until, what
        time.sleep(LOOK_S)
