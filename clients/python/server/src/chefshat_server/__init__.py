"""Finds the program `chefshat` that this package installs."""

import os
import sysconfig
from pathlib import Path

__all__ = ["find_binary"]


def find_binary() -> Path:
    """Returns the path of the program.

    Raises:
        FileNotFoundError: the program is not where this package was installed; install it again.
    """
    name = f"chefshat{sysconfig.get_config_var('EXE') or ''}"
    folders: list[str | Path] = [
        sysconfig.get_path("scripts"),
        # pip install --user
        sysconfig.get_path("scripts", sysconfig.get_preferred_scheme("user")),
        # pip install --target
        Path(__file__).resolve().parents[1] / "bin",
    ]
    for folder in folders:
        binary = Path(folder) / name
        if binary.is_file() and os.access(binary, os.X_OK):
            return binary
    searched = ", ".join(map(str, folders))
    raise FileNotFoundError(f"{name} is in none of {searched}: pip install --force-reinstall chefshat-server")
