"""Waiting in tests for a state instead of for a time. Contains no tests."""

from __future__ import annotations

import asyncio
from collections.abc import Callable


async def until(state: Callable[[], object]) -> None:
    """Waits until a function returns something true."""
    while not state():
        await asyncio.sleep(0.005)
