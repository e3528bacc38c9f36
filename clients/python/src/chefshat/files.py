"""Files that are written whole or not at all. Also what is said of one that cannot be read. A ticket's is in `ticket_file`."""

import os
from collections.abc import Iterable
from pathlib import Path

from google.protobuf import json_format

from chefshat import pb


def write_whole(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Puts a file in place of what stands at `path`. Whoever reads it meanwhile, or after a crash, sees the old or the new.

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
    """Writes the lines of a record, header first, as servers keep them: JSON Lines. Raises `OSError` if it cannot be written."""
    write_whole(path, "".join(f"{json_format.MessageToJson(line, indent=None)}\n" for line in lines))


def check_readable(path: str | os.PathLike[str], what: str, origin: str) -> None:
    """Looks whether a file can be read.

    Args:
        path: the file.
        what: what it should be, in a word: for instance "network".
        origin: where such a file comes from, in words.

    Raises:
        OSError: it cannot be read. The message names it and says what to do.
    """
    name = os.fspath(path)
    try:
        with open(path, "rb"):
            pass
    except FileNotFoundError as error:
        raise FileNotFoundError(f"there is no file {name}: give a {what}, which {origin}") from error
    except IsADirectoryError as error:
        raise IsADirectoryError(f"{name} is a folder: give the {what} itself, a file") from error
