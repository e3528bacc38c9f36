"""A folder in which somebody types the commands of a page, as written but for names, ports and printed values."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from certificates import PATIENCE_S
from chefshat.local_server import BINARY, clean_environment


class Machine:
    """A folder in which somebody types commands. Values take the place of those on the page."""

    def __init__(self, folder: Path, values: dict[str, str], environment: dict[str, str] | None = None) -> None:
        folder.mkdir(exist_ok=True)
        self.folder = folder
        self.values = values
        programs = [str(Path(os.environ[BINARY]).parent), str(Path(sys.executable).parent), os.environ["PATH"]]
        self.environment = clean_environment() | {"PATH": ":".join(programs)} | (environment or {})
        self._started: list[subprocess.Popen[str]] = []

    def start(self, commands: str) -> subprocess.Popen[str]:
        """Types commands, which may run for long."""
        # The longest first: a name may be part of a URL.
        for written in sorted(self.values, key=len, reverse=True):
            commands = commands.replace(written, self.values[written])
        process = subprocess.Popen(
            ["bash", "-e", "-c", commands],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            process_group=0,
        )
        self._started.append(process)
        return process

    def type(self, commands: str) -> str:
        """Types commands, which must succeed, and returns what they print."""
        return finished(self.start(commands))

    def leave(self) -> None:
        """Ends what still runs."""
        for process in self._started:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()


def finished(process: subprocess.Popen[str]) -> str:
    """What commands print, which must succeed."""
    output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, output
    return output


def copied(pattern: str, output: str) -> str:
    """What a person copies from an output."""
    match = re.search(pattern, output)
    assert match, output
    return match[1]
