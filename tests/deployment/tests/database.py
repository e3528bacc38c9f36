"""A PostgreSQL server in a temporary folder, from Debian's packages."""

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Self

import pytest
from certificates import PATIENCE_S

# PostgreSQL refuses to run as root.
_NOBODY = 65_534


class Database:
    """A server with an empty database; a context manager.

    Attributes:
        url: the address of the database.
    """

    def __init__(self) -> None:
        """Prepares a server."""
        self._programs = _programs()
        # Not in pytest's folder, which other users cannot reach.
        self._folder = tempfile.TemporaryDirectory(prefix="chefshat-postgres-")
        self._data = Path(self._folder.name) / "data"
        self._user = _NOBODY if os.geteuid() == 0 else None
        if self._user is not None:
            os.chown(self._folder.name, _NOBODY, _NOBODY)
        # Nobody else listens there. A port that is free now need not be once PostgreSQL has its files.
        self._host = f"127.196.{(os.getpid() >> 8) & 255}.{os.getpid() & 255}"
        self._port = "25432"
        self.url = f"postgres://chefshat@{self._host}:{self._port}/postgres"

    def __enter__(self) -> Self:
        initdb = [str(self._programs / "initdb"), "--auth=trust", "--no-sync", "--username=chefshat", f"--pgdata={self._data}"]
        subprocess.run(initdb, check=True, capture_output=True, user=self._user, cwd="/")
        command = [str(self._programs / "postgres"), "-D", str(self._data), "-p", self._port, "-h", self._host, "-k", ""]
        self._process = subprocess.Popen(command, stderr=subprocess.DEVNULL, user=self._user, cwd="/")
        give_up_at = time.monotonic() + PATIENCE_S
        while subprocess.run([self._programs / "pg_isready", "-q", "-h", self._host, "-p", self._port]).returncode != 0:
            assert self._process.poll() is None, "PostgreSQL does not start"
            assert time.monotonic() < give_up_at, "PostgreSQL does not start"
            time.sleep(0.05)
        return self

    def __exit__(self, *_: object) -> None:
        # Its fast shutdown.
        self._process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()


def _programs() -> Path:
    """The folder of PostgreSQL's programs. Skips the test if there is none."""
    versions = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    found = str(versions[-1]) if versions else shutil.which("initdb")
    if found is None:
        pytest.skip("PostgreSQL is not installed")
    return Path(found).parent
