"""The file that keeps the ticket of a command's place: held by one command at a time, for as long as it has the place.

What a place is and how it is come by is in `join_options`.
"""

import contextlib
import os
import sys
from pathlib import Path
from typing import Self

if sys.platform != "win32":
    import fcntl


class TicketFile:
    """A ticket in a file that its owner alone may read; a context manager, which holds the file.

    What is held is the file itself or, before there is one, the beginning of one beside it, which becomes the file when the ticket
    is there. The system lets go of it when the process ends, however that ends. On Windows nothing is held.

    Attributes:
        path: the file.
        ticket: what the file says; empty if there is no file, or nothing in it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.ticket = ""
        # The same name for every process: what one that was killed left behind, the next one takes.
        self._begun = self.path.with_name(f".{self.path.name}.new")
        self._descriptor = -1

    def __enter__(self) -> Self:
        """Holds the file if there is a ticket in it, and else begins one.

        Raises:
            OSError: it can be neither read nor begun, it is no text, or another command holds it.
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
            # Not through a link, which somebody else may have put there.
            if self._hold(self._begun, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)):
                if not _read(self.path):
                    return self
                self._let_go()  # Another command has put its file there in between.

    def __exit__(self, *_: object) -> None:
        """Lets go. Nothing is left of a file that got no ticket."""
        self._let_go()

    def keep(self, ticket: str) -> None:
        """Writes the ticket, and puts the file in place of what stands there.

        Raises:
            OSError: it cannot be written. What stood there stands there still.
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
        """Removes the file, unless another ticket is in it by now.

        Raises:
            OSError: it cannot be removed.
        """
        # What is no file (a pipe, say) is read once.
        if self.ticket and self.path.is_file() and _read(self.path) == self.ticket:
            self.path.unlink()

    def _hold(self, path: Path, flags: int) -> bool:
        """Opens a file and holds it; False if there is none, or not this one any more."""
        try:
            descriptor = os.open(path, flags, 0o600)
        except FileNotFoundError:
            if flags != os.O_RDONLY:
                raise
            return False
        try:
            if not _locked(descriptor):
                raise BlockingIOError(f"another command plays in the place of {self.path}: name another file for another place")
            # Who held it before may have renamed or removed it.
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
    """The ticket in a file; empty if there is none."""
    try:
        return path.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return ""
    except UnicodeDecodeError as error:
        raise OSError(f"{path} is no text, and so no ticket: name another file") from error


def _is(descriptor: int, path: Path) -> bool:
    """Whether the open file is the one of that name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _locked(descriptor: int) -> bool:
    """Locks an open file until it is closed; False if it is locked already."""
    if sys.platform != "win32":
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            pass  # A file system that has no locks, or none for a file that is only read: better no lock than no game.
    return True
