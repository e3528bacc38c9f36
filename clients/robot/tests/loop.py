"""Running coroutines in tests, and waiting for a state instead of for a time. Contains no tests."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")
# Seconds after which a test that hangs fails. Tests do not depend on it otherwise.
LIMIT_S = 300.0


def run(coroutine: Coroutine[Any, Any, Result]) -> Result:
    """Runs a coroutine to its end."""

    async def limited() -> Result:
        async with asyncio.timeout(LIMIT_S):
            return await coroutine

    return asyncio.run(limited())


async def until(state: Callable[[], object]) -> None:
    """Waits until a function returns something true."""
    while not state():
        await asyncio.sleep(0.005)
