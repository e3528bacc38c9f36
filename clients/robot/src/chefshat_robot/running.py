"""What the commands that play, follow or watch a game share: their event loop, their errors, and where a game is now."""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Callable, Coroutine
from typing import Any

import grpc
from chefshat import ChefsHatError, aio, pb
from chefshat.errors import INTERRUPTED, from_rpc_error

from chefshat_robot.cli import CommandError
from chefshat_robot.drivers.driver import LOG, RobotError


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


async def live_from(client: aio.Client, room_id: str) -> int:
    """Returns the number of the next event of a room: those with a lower number have happened.

    In a room that shows its events with a delay, it is 0.

    Raises:
        ChefsHatError: there is no such room, or it admits no spectators.
    """
    call = client._spectators.Watch(pb.SpectatorServiceWatchRequest(room_id=room_id, snapshot=True))
    try:
        async for response in call:
            return response.snapshot.next_sequence
    except grpc.RpcError as failure:
        error = from_rpc_error(failure)
        if error.reason != "SNAPSHOT_DELAYED":
            raise error from failure
    finally:
        call.cancel()
    return 0
