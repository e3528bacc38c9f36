"""The real server as a child process."""

from pathlib import Path

from chefshat.local_server import LocalServer


class RealServer(LocalServer):
    """`chefshat serve` on a free port, with a separate data directory; a context manager.

    It can be killed and started again, on the same address and data directory.
    """

    def __init__(self, binary: Path, data_dir: Path, *, host: str = "127.0.0.1") -> None:
        super().__init__(binary, options=["--data-dir", str(data_dir)], host=host)
