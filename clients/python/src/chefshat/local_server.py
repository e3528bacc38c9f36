"""A server of one's own: `chefshat serve` as a child process that ends with this one.

Finding the program is here, too. What is asked of the server is not (see `client` and `vector`).
"""

import atexit
import json
import os
import shutil
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from chefshat.errors import ChefsHatError

#: Environment variable that names the program.
BINARY = "CHEFSHAT_BIN"
# Seconds the server has to start listening: generous, for machines under load.
START_S = 60.0
# Seconds it has to stop by itself.
STOP_S = 5.0
#: Options of a server that keeps nothing, and that nobody waits for.
IN_MEMORY = ("--no-records", "--grace", "0")
# What the program is needed for, unless it is something else.
SERVING = "start a server"
_NAME = "chefshat.exe" if os.name == "nt" else "chefshat"


def find_binary(purpose: str = SERVING, instead: str = "; or give the address of a server that runs already") -> Path:
    """Finds the program: `CHEFSHAT_BIN`, else `chefshat` on the PATH, else what cargo built in the repository.

    The repository is the one this package lies in, else the one the process was started in.

    Args:
        purpose: what it is needed for, in words.
        instead: how to do without it, in words; may be empty.

    Raises:
        ChefsHatError: there is none; the message says how to get one.
    """
    named = os.environ.get(BINARY)
    if named:
        found = shutil.which(named)
        if found is None:
            raise ChefsHatError("BINARY_MISSING", f"the environment variable {BINARY} names {named}, which is no program")
        return Path(found)
    found = shutil.which("chefshat")
    if found is not None:
        return Path(found)
    built = [path for path in _cargo_targets() if path.is_file()]
    if built:
        # Who builds both wants the one built last.
        return max(built, key=lambda path: path.stat().st_mtime)
    raise ChefsHatError(
        "BINARY_MISSING",
        f"there is no chefshat program to {purpose}. Build it (in the repository: cargo build --release --bin chefshat), then run "
        f"this within the repository, put the program on the PATH or name it in the environment variable {BINARY}{instead}",
    )


def _cargo_targets() -> list[Path]:
    """Where cargo puts the program, if this file or else the working directory lies in a checkout of the project."""
    here = Path.cwd()
    for folder in (*Path(__file__).resolve().parents, here, *here.parents):
        if (folder / "Cargo.toml").is_file() and (folder / "proto" / "chefshat").is_dir():
            return [folder / "target" / profile / _NAME for profile in ("release", "debug")]
    return []


class LocalServer:
    """A server as a child process, on a free port of this machine; a context manager.

    It keeps games in memory alone unless told otherwise, and stops with this process, however that ends.

    Attributes:
        address: "127.0.0.1:port", once it has been started.
    """

    def __init__(self, binary: Path | str | None = None, *, options: Sequence[str] = IN_MEMORY, host: str = "127.0.0.1") -> None:
        """Names the server; `start` starts it.

        Args:
            binary: the program; None: `find_binary` finds it.
            options: further options of `chefshat serve`.
            host: the address of this machine to listen on.
        """
        self._binary = find_binary() if binary is None else Path(binary)
        self._options = list(options)
        self._process: subprocess.Popen[str] | None = None
        # Closed when this object goes.
        self._log = tempfile.TemporaryFile("w+")  # noqa: SIM115
        weakref.finalize(self, self._log.close)
        self.address = f"{host}:0"

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def log(self) -> str:
        """What the server has written to standard error."""
        self._log.seek(0)
        return self._log.read()

    def start(self) -> Self:
        """Starts the server and waits until it listens; on the same port as before, if it ran before.

        Raises:
            ChefsHatError: it did not start; the message has what it said.
        """
        if self.running:
            return self
        command = [str(self._binary), "serve", "--listen", self.address, "--until-stdin-closes", "--json", *self._options]
        try:
            # The server stops when its standard input ends: this process holds the other end, and with it goes the pipe.
            # A process group of its own: Ctrl-C is for the program that plays, which may still want to save what it has.
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                text=True,
                env=clean_environment(),
                process_group=0,
            )
        except OSError as error:
            raise ChefsHatError("SERVER_DID_NOT_START", f"{self._binary} cannot be started: {error}") from error
        try:
            address = self._listens(self._process)
        except BaseException:
            self.stop()
            raise
        if address is None:
            self.stop()
            raise ChefsHatError("SERVER_DID_NOT_START", f"{' '.join(command)} did not start listening; it said:\n{self.log}")
        self.address = address
        return self

    def stop(self) -> None:
        """Stops the server. More than once does no harm."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._ended()

    def kill(self) -> None:
        """Ends the process without a warning."""
        if self._process is not None:
            self._process.kill()
            self._ended()

    def _ended(self) -> None:
        """Waits for the process and lets go of it."""
        assert self._process is not None, "called by those who have looked"
        process, self._process = self._process, None
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()

    def _listens(self, process: "subprocess.Popen[str]") -> str | None:
        """Waits until it says where it listens; None if it ended before."""
        # A server that hangs is killed, which ends its output and so the wait for its first line.
        watchdog = threading.Timer(START_S, process.kill)
        watchdog.daemon = True
        watchdog.start()
        try:
            assert process.stdout is not None, "it was asked for"
            for line in process.stdout:
                try:
                    said = json.loads(line)
                except ValueError:
                    continue  # Another program than was thought.
                if isinstance(said, dict) and said.get("event") == "listening":
                    return str(said["address"])
            return None
        finally:
            watchdog.cancel()


def clean_environment() -> dict[str, str]:
    """The environment without what would configure the user's own server, but for its log."""
    kept = ("CHEFSHAT_LOG", "CHEFSHAT_LOG_JSON")
    return {name: value for name, value in os.environ.items() if not name.startswith("CHEFSHAT_") or name in kept}


# One for the process; the number of the process it belongs to, because a forked one must not use or stop its parent's.
_shared: LocalServer | None = None
_shared_by = 0
_lock = threading.Lock()


def shared_address() -> str:
    """The address of a server that this whole process shares. It is started by the first call, and stopped when the process ends.

    Raises:
        ChefsHatError: there is no program to start it with, or it did not start.
    """
    global _shared, _shared_by
    with _lock:
        if _shared is None or _shared_by != os.getpid():
            _shared = LocalServer()
            _shared_by = os.getpid()
            atexit.register(_stop_shared, _shared, _shared_by)
        if not _shared.running:
            # Another port, should it have run before: nobody is left who knows the old one, and somebody else may have it.
            _shared.address = "127.0.0.1:0"
            _shared.start()
        return _shared.address


def _stop_shared(server: LocalServer, started_by: int) -> None:
    if os.getpid() == started_by:
        server.stop()
