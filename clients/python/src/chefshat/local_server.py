"""A local server: finds the program, and runs `chefshat serve` as a child process that ends with this one."""

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

#: Environment variable with the path of the program.
BINARY = "CHEFSHAT_BIN"
# Seconds until the server must listen: generous, for machines under load.
START_S = 60.0
# Seconds until the server must have stopped.
STOP_S = 5.0
#: Options of a server that stores nothing and stops at once.
IN_MEMORY = ("--no-records", "--grace", "0")
# The default purpose of `find_binary`.
SERVING = "start a server"
_NAME = "chefshat.exe" if os.name == "nt" else "chefshat"


def find_binary(
    purpose: str = SERVING,
    instead: str = "; or give the address of a running server; or install chefshat-native, with which environments need none",
) -> Path:
    """Finds the program: `CHEFSHAT_BIN`, the package chefshat-server, `chefshat` on the PATH, or the repository's latest build.

    The repository is the one that contains this package, else the one that contains the working directory.

    Args:
        purpose: what the program is needed for, for the error message.
        instead: an alternative, for the error message; may be empty.

    Raises:
        ChefsHatError: the program was not found; the message says how to get it.
    """
    named = os.environ.get(BINARY)
    if named:
        found = shutil.which(named)
        if found is None:
            raise ChefsHatError("BINARY_MISSING", f"the environment variable {BINARY} names {named}, which is not a program")
        return Path(found)
    installed = _installed()
    if installed is not None:
        return installed
    found = shutil.which("chefshat")
    if found is not None:
        return Path(found)
    built = [path for path in _cargo_targets() if path.is_file()]
    if built:
        return max(built, key=lambda path: path.stat().st_mtime)
    raise ChefsHatError(
        "BINARY_MISSING",
        f"the program chefshat is required to {purpose}. Install it (pip install ./chefshat_server-*.whl), put it on the PATH, "
        f"set the environment variable {BINARY}, or build it (cargo build --release --bin chefshat) and run this in the "
        f"repository{instead}",
    )


def _installed() -> Path | None:
    """Returns the program of the package chefshat-server, if that is installed."""
    try:
        import chefshat_server
    except ModuleNotFoundError:
        return None
    try:
        return chefshat_server.find_binary()
    except FileNotFoundError as error:
        raise ChefsHatError("BINARY_MISSING", str(error)) from error


def _cargo_targets() -> list[Path]:
    """Returns the paths of cargo's builds, if this file or else the working directory is in a checkout of the project."""
    here = Path.cwd()
    for folder in (*Path(__file__).resolve().parents, here, *here.parents):
        if (folder / "Cargo.toml").is_file() and (folder / "proto" / "chefshat").is_dir():
            return [folder / "target" / profile / _NAME for profile in ("release", "debug")]
    return []


class LocalServer:
    """A server as a child process, on a free port of this machine; a context manager.

    By default it keeps games only in memory. It stops when this process ends in any way.

    Attributes:
        address: "127.0.0.1:port", once it has been started.
    """

    def __init__(self, binary: Path | str | None = None, *, options: Sequence[str] = IN_MEMORY, host: str = "127.0.0.1") -> None:
        """Configures the server; `start` starts it.

        Args:
            binary: the program; None: the result of `find_binary`.
            options: further options of `chefshat serve`.
            host: the local address to listen on.
        """
        self._binary = find_binary() if binary is None else Path(binary)
        self._options = list(options)
        self._process: subprocess.Popen[str] | None = None
        # Closed with this object.
        self._log = tempfile.TemporaryFile("a+")  # noqa: SIM115
        weakref.finalize(self, self._log.close)
        self.address = f"{host}:0"

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def running(self) -> bool:
        """Whether the process is running."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int:
        """The number of the process. Raises ValueError if it has not been started."""
        if self._process is None:
            raise ValueError("the server has not been started")
        return self._process.pid

    @property
    def log(self) -> str:
        """The server's standard error."""
        self._log.seek(0)
        return self._log.read()

    def start(self) -> Self:
        """Starts the server and waits until it listens; on the same port as before, if it ran before.

        Raises:
            ChefsHatError: it did not start; the message includes its output.
        """
        if self.running:
            return self
        command = [str(self._binary), "serve", "--listen", self.address, "--until-stdin-closes", "--json", *self._options]
        try:
            # The server stops when its standard input ends, which is when this process ends. In a process group of its own it does
            # not receive Ctrl-C, after which this process may still need it.
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
            raise ChefsHatError("SERVER_DID_NOT_START", f"{' '.join(command)} did not start listening; its output:\n{self.log}")
        self.address = address
        return self

    def stop(self) -> None:
        """Stops the server. Does nothing if it is stopped."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._ended()

    def kill(self) -> None:
        """Kills the process."""
        if self._process is not None:
            self._process.kill()
            self._ended()

    def _ended(self) -> None:
        """Waits for the process and releases it."""
        assert self._process is not None, "callers check it"
        process, self._process = self._process, None
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()

    def _listens(self, process: "subprocess.Popen[str]") -> str | None:
        """Waits for the server's address; returns None if the process ended before."""
        # Killing a server that hangs ends its output, and so the wait for its first line.
        watchdog = threading.Timer(START_S, process.kill)
        watchdog.daemon = True
        watchdog.start()
        try:
            assert process.stdout is not None, "it is a pipe"
            for line in process.stdout:
                try:
                    message = json.loads(line)
                except ValueError:
                    continue  # Not the output of `chefshat`.
                if isinstance(message, dict) and message.get("event") == "listening":
                    return str(message["address"])
            return None
        finally:
            watchdog.cancel()


def clean_environment() -> dict[str, str]:
    """Returns the environment without the configuration of the user's own server, except for logging."""
    allowed = ("CHEFSHAT_LOG", "CHEFSHAT_LOG_JSON")
    return {name: value for name, value in os.environ.items() if not name.startswith("CHEFSHAT_") or name in allowed}


# The server of this process, and the process id, because a fork must not use or stop its parent's server.
_shared: LocalServer | None = None
_shared_by = 0
_lock = threading.Lock()


def shared_address() -> str:
    """Returns the address of the server shared by this process. The first call starts it; it stops when the process ends.

    Raises:
        ChefsHatError: the program was not found, or the server did not start.
    """
    global _shared, _shared_by
    with _lock:
        if _shared is None or _shared_by != os.getpid():
            _shared = LocalServer()
            _shared_by = os.getpid()
            atexit.register(_stop_shared, _shared, _shared_by)
        if not _shared.running:
            # Another port than before: it may be in use by now.
            _shared.address = "127.0.0.1:0"
            _shared.start()
        return _shared.address


def _stop_shared(server: LocalServer, started_by: int) -> None:
    if os.getpid() == started_by:
        server.stop()
