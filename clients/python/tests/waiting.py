"""Waiting for other processes in tests. Contains no tests."""

import subprocess
import time
from collections.abc import Callable

#: Time limit in seconds.
LIMIT_S = 300
# Seconds between two checks.
LOOK_S = 0.01


def wait_until(reached: Callable[[], object], what: str, process: "subprocess.Popen[str] | None" = None) -> None:
    """Waits for a condition. Fails after the time limit, or when the process ends that should meet it."""
    until = time.monotonic() + LIMIT_S
    while not reached():
        assert process is None or process.poll() is None, (what, process and process.communicate())
        assert time.monotonic() < until, what
        time.sleep(LOOK_S)
