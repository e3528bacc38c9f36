"""Atomic writing of files, and messages for files that cannot be read. The file of a ticket is in `ticket_file`."""

import os
from collections.abc import Iterable
from pathlib import Path

from google.protobuf import json_format

from chefshat import pb


def write_atomically(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Replaces a file. Readers see the old or the new contents at any time, also after a crash.

    Raises `OSError` if it cannot be written.
    """
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with unfinished.open("wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def write_record(path: str | os.PathLike[str], lines: Iterable[pb.RecordLine]) -> None:
    """Writes a record, header first, as JSON Lines like a server's records. Raises `OSError` if it cannot be written."""
    write_atomically(path, "".join(f"{json_format.MessageToJson(line, indent=None)}\n" for line in lines))


def check_readable(path: str | os.PathLike[str], what: str, origin: str) -> None:
    """Checks that a file can be read.

    Args:
        path: the file.
        what: the kind of file, for example "network".
        origin: what writes such files, as a clause of the message.

    Raises:
        OSError: the file cannot be read. The message names it and says what to do.
    """
    name = os.fspath(path)
    try:
        with open(path, "rb"):
            pass
    except FileNotFoundError as error:
        raise FileNotFoundError(f"there is no file {name}: give a {what}, which {origin}") from error
    except IsADirectoryError as error:
        raise IsADirectoryError(f"{name} is a folder: give the {what} itself, a file") from error
