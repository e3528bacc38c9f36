"""Environments are neither pickled nor copied."""

from typing import NoReturn


class NotCopied:
    """An environment whose games another one would share."""

    def __reduce__(self) -> NoReturn:
        kind = type(self).__name__
        raise TypeError(
            f"a {kind} cannot be pickled or copied: make another one, or copy the games of its `vector` (VectorEnv.fork)"
        )
