"""What the commands that play, follow or watch a game share: their event loop, their errors, and where a game is now."""

from __future__ import annotations

import asyncio
import logging
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine
from typing import Any, Generic, Self, TypeVar

import grpc
from chefshat import ChefsHatError, aio, pb
from chefshat.errors import INTERRUPTED, from_rpc_error
from chefshat.requests import async_received

from chefshat_robot.cli import CommandError
from chefshat_robot.drivers.driver import LOG, RobotError

#: The default address of the server.
SERVER = "127.0.0.1:50051"
# Seconds for what still waits to be sent at the end: the server may be away.
DRAIN_S = 5.0

Item = TypeVar("Item")


def run_command(command: Callable[[], Coroutine[Any, Any, int]], *, quiet: bool = False) -> int:
    """Runs a command's coroutine function in an event loop, with progress on standard error.

    Args:
        command: returns the exit code.
        quiet: whether to print only warnings.

    Raises:
        CommandError: the server refused something, a robot or the server cannot be reached, or a file cannot be written.
    """
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    LOG.setLevel(logging.WARNING if quiet else logging.INFO)
    try:
        return asyncio.run(command())
    except (ChefsHatError, RobotError, OSError) as error:
        raise CommandError(str(error)) from error
    except ExceptionGroup as group:
        known, rest = group.split((ChefsHatError, RobotError, OSError, CommandError))
        if known is None or rest is not None:
            raise
        raise CommandError("; ".join(str(error) for error in known.exceptions)) from group
    except KeyboardInterrupt:
        return INTERRUPTED


class Sender(ABC, Generic[Item]):
    """Sends items, in order, in the background. An asynchronous context manager: leaving sends what waits.

    After `DRAIN_S` it gives up.
    """

    def __init__(self, client: aio.Client, ticket: str) -> None:
        """Sets where to send.

        Args:
            client: the connection to the server.
            ticket: authorises the sender.
        """
        self._client = client
        self._ticket = ticket
        # The last entry is None.
        self._waiting: asyncio.Queue[Item | None] = asyncio.Queue()
        self._task: asyncio.Task[None] | None = None

    def send(self, item: Item) -> None:
        """Queues an item."""
        self._waiting.put_nowait(item)

    @abstractmethod
    async def _deliver(self, item: Item) -> None:
        """Sends an item. Logs what goes wrong: the game is more important."""

    async def __aenter__(self) -> Self:
        self._task = asyncio.create_task(self._run(), name=type(self).__name__)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._waiting.put_nowait(None)
        if self._task is not None:
            try:
                async with asyncio.timeout(DRAIN_S):
                    await self._task
            except TimeoutError:
                LOG.warning("what the robot said and did last was not sent to the server within %g s", DRAIN_S)

    async def _run(self) -> None:
        while (item := await self._waiting.get()) is not None:
            await self._deliver(item)


async def live_from(client: aio.Client, room_id: str) -> int:
    """Returns the number of the next event of a room: those with a lower number have happened.

    In a room that shows its events with a delay, it is 0.

    Raises:
        ChefsHatError: there is no such room, or it admits no spectators.
    """
    call = client.rooms._spectators.Watch(pb.SpectatorServiceWatchRequest(room_id=room_id, snapshot=True))
    try:
        async for response in async_received(call):
            return response.snapshot.next_sequence
    except grpc.RpcError as failure:
        error = from_rpc_error(failure)
        if error.reason != "SNAPSHOT_DELAYED":
            raise error from failure
    finally:
        call.cancel()
    return 0
