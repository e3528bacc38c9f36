"""The file that stores the ticket of a command's place. One command at a time locks it, for as long as it has the place.

Joining is in `join_options`.
"""

import contextlib
import os
import sys
from pathlib import Path
from typing import Self

if sys.platform != "win32":
    import fcntl


class TicketFile:
    """A ticket in a file that only its owner may read; a context manager that locks the file.

    Locks the file or, before it exists, a temporary file next to it, which becomes the file when the ticket is known. The system
    releases the lock when the process ends in any way. On Windows there is no lock.

    Attributes:
        path: the file.
        ticket: the contents; empty if there is no file or it is empty.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.ticket = ""
        # The same name for every process, which takes over the file of a killed one.
        self._begun = self.path.with_name(f".{self.path.name}.new")
        self._descriptor = -1

    def __enter__(self) -> Self:
        """Locks the file if it has a ticket, otherwise creates a temporary one.

        Raises:
            OSError: the file cannot be read or created, is not a text, or another command has locked it.
        """
        if self.path.is_dir():
            raise IsADirectoryError(f"{self.path} is a folder: name a file in it")
        while True:
            if self._hold(self.path, os.O_RDONLY):
                try:
                    self.ticket = _read(self.path)
                finally:
                    if not self.ticket:
                        self._let_go()
                if self.ticket:
                    return self
            # Does not follow a link, which somebody else may have put there.
            if self._hold(self._begun, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)):
                if not _read(self.path):
                    return self
                self._let_go()  # Another command has put its file there meanwhile.

    def __exit__(self, *_: object) -> None:
        """Releases the lock. Deletes a temporary file without a ticket."""
        self._let_go()

    def keep(self, ticket: str) -> None:
        """Stores the ticket, replacing the file.

        Raises:
            OSError: the file cannot be written. An existing one is unchanged.
        """
        if hasattr(os, "fchmod"):
            os.fchmod(self._descriptor, 0o600)
        with open(self._descriptor, "w", encoding="utf-8", closefd=False) as file:
            file.truncate(0)
            file.write(f"{ticket}\n")
            file.flush()
            os.fsync(file.fileno())
        self._begun.replace(self.path)
        self.ticket = ticket

    def forget(self) -> None:
        """Deletes the file, unless it has another ticket by now.

        Raises:
            OSError: the file cannot be deleted.
        """
        # A pipe, for example, can only be read once.
        if self.ticket and self.path.is_file() and _read(self.path) == self.ticket:
            self.path.unlink()

    def _hold(self, path: Path, flags: int) -> bool:
        """Opens and locks a file. Returns False if it does not exist or was replaced meanwhile."""
        try:
            descriptor = os.open(path, flags, 0o600)
        except FileNotFoundError:
            if flags != os.O_RDONLY:
                raise
            return False
        try:
            if not _locked(descriptor):
                raise BlockingIOError(f"another command uses {self.path}: give another file for another place")
            # The previous owner of the lock may have renamed or deleted it.
            still_there = _is(descriptor, path)
        except BaseException:
            os.close(descriptor)
            raise
        if not still_there:
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def _let_go(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor < 0:
            return
        try:
            with contextlib.suppress(OSError):
                if _is(descriptor, self._begun):
                    self._begun.unlink()
        finally:
            os.close(descriptor)


def _read(path: Path) -> str:
    """Returns the ticket in a file; empty if there is none."""
    try:
        return path.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return ""
    except UnicodeDecodeError as error:
        raise OSError(f"{path} is not a text file: give another file for the ticket") from error


def _is(descriptor: int, path: Path) -> bool:
    """Whether the open file is the one at `path`."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _locked(descriptor: int) -> bool:
    """Locks an open file until it is closed. Returns False if it is already locked."""
    if sys.platform != "win32":
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            pass  # The file system does not support this lock: plays without it.
    return True
