"""Opponents of trainings that other packages add: entry points of the group `chefshat.opponents`.

The opponent "KIND:NAME" is created by the entry point KIND as `kind(NAME, arguments=..., python=...)`: a function that chooses
actions, as for a `VectorEnv`, with `close()` and a `__name__`. It raises OSError or ValueError if it cannot play.
"""

import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol

from numpy.typing import ArrayLike

from chefshat.batch import Batch
from chefshat.vector_setup import NETWORK_SUFFIX

GROUP = "chefshat.opponents"


class PluginOpponent(Protocol):
    """An opponent of another package."""

    def __call__(self, batch: Batch) -> ArrayLike:
        """Returns the action of each row."""

    def close(self) -> None:
        """Ends what it has started."""


def find(name: str) -> EntryPoint | None:
    """Returns the entry point that creates this opponent; None if no installed package does."""
    kind, separator, _ = name.partition(":")
    if not separator or name.endswith(NETWORK_SUFFIX):
        return None
    return next(iter(entry_points(group=GROUP, name=kind)), None)


def create(plugin: EntryPoint, name: str, arguments: Mapping[str, Any], python: str) -> PluginOpponent:
    """Creates an opponent, which the caller closes.

    Args:
        plugin: what `find` returned.
        name: the complete name, "KIND:NAME".
        arguments: the arguments of the agent, JSON values.
        python: the Python with its dependencies; empty: this program's.

    Raises:
        OSError: it could not be started.
        ValueError: an argument is wrong.
    """
    created: PluginOpponent = plugin.load()(name.partition(":")[2], arguments=arguments, python=python or sys.executable)
    return created
