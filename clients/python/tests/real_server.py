"""The real server as a child process. What it is asked to do is the tests' business."""

import json
import subprocess
import threading
from pathlib import Path
from typing import Self

# Seconds to start listening: generous, because nothing is measured by it.
START_S = 60.0


class RealServer:
    """`chefshat serve` on a free port, with a data directory of its own; a context manager.

    It can be killed and started again, on the same address and data directory.
    """

    def __init__(self, binary: Path, data_dir: Path, *, host: str = "127.0.0.1") -> None:
        self._binary = binary
        self._data_dir = data_dir
        self._log = (data_dir / "server.log").open("w+")
        self.address = f"{host}:0"
        self._process = self._spawn()

    def __enter__(self) -> Self:
        self._wait_until_it_listens()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def kill(self) -> None:
        """Ends the process without a warning."""
        self._process.kill()
        self._ended()

    def start(self) -> None:
        """Starts another process in place of the one that ended."""
        self._process = self._spawn()
        self._wait_until_it_listens()

    def stop(self) -> None:
        """Ends the process."""
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._ended()
        self._log.close()

    def _spawn(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [str(self._binary), "serve", "--listen", self.address, "--data-dir", str(self._data_dir), "--json"],
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
        )

    def _wait_until_it_listens(self) -> None:
        # A server that hangs is killed, which ends its output and so the wait for its first line.
        watchdog = threading.Timer(START_S, self._process.kill)
        watchdog.start()
        try:
            assert self._process.stdout is not None
            for line in self._process.stdout:
                said = json.loads(line)
                if said.get("event") == "listening":
                    self.address = said["address"]
                    return
        finally:
            watchdog.cancel()
        self._log.seek(0)
        said_instead = self._log.read()
        self.stop()
        raise AssertionError(f"the server named by CHEFSHAT_BIN did not start listening; it said:\n{said_instead}")

    def _ended(self) -> None:
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
