"""The asyncio client: the methods of the blocking `chefshat.Client`, awaited. Agents may decide in coroutines.

Its calls are in `_async`; here is how it plays: the connection, its loss, and the tasks of agents that are deciding. The
protocol of playing is in `session`.
"""

import asyncio
import math
import time
from collections.abc import Awaitable
from typing import TypeAlias

from chefshat import backoff, pb
from chefshat._async.calls import AsyncCalls
from chefshat.errors import ChefsHatError, connection_lost, first_error, from_rpc_error
from chefshat.network import grpc
from chefshat.requests import closed_is_an_error
from chefshat.seat_session import Ask
from chefshat.session import PlaySession

# Seconds the server has to end a stream whose seats are all done.
FAREWELL_S = 1.0

PlayCall: TypeAlias = "grpc.aio.StreamStreamCall[pb.PlayRequest, pb.PlayResponse]"


class Client(AsyncCalls):
    """A connection to a server, opened on first use. Close it, or use it as an asynchronous context manager.

    The calls are methods, and in groups: `rooms`, `tournaments`, `tables`, `records` and `studies`; see `AsyncCalls`.

    Create it where the event loop runs. Every method raises `ChefsHatError`: with the server's reason if the server refuses, with
    "UNAVAILABLE" if it cannot be reached.
    """

    async def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, reconnecting as needed."""
        failures = 0
        with first_error():
            # An agent that fails ends the session at any time, also between connections.
            async with asyncio.TaskGroup() as group:
                run = _Run(session, group)
                while not session.done:
                    before = session.progress
                    error = await run.connection(self._play.Play())
                    session.lost()
                    if session.done:
                        break
                    failures = 1 if session.progress > before else failures + 1
                    try:
                        await self._connection.wait(failures, error)
                    except ChefsHatError as final:
                        session.give_up(final)
                run.end()


class _Run:
    """A session in play: the current connection, and the agents that are deciding."""

    def __init__(self, session: PlaySession, group: asyncio.TaskGroup) -> None:
        self._session = session
        self._group = group
        self._call: PlayCall | None = None
        # gRPC permits one write at a time.
        self._writing = asyncio.Lock()
        self._thinking: set[asyncio.Task[None]] = set()

    async def connection(self, call: PlayCall) -> ChefsHatError:
        """Plays over one connection until it is lost or the session is done.

        Returns:
            The error that ended it.

        Raises:
            ChefsHatError: the client was closed.
        """
        session = self._session
        session.connected()
        self._call = call
        opened = math.inf
        try:
            with closed_is_an_error():
                await _opened(call)
                opened = time.monotonic()
                await self._flush(call)
                while not session.done:
                    response = await call.read()
                    if not isinstance(response, pb.PlayResponse):
                        return connection_lost()
                    for ask in session.receive(response):
                        self._decide(ask)
                    await self._flush(call)
                await _part(call)
        except grpc.RpcError as error:
            return from_rpc_error(error)
        except asyncio.InvalidStateError:
            return connection_lost()  # The call ended before a write.
        finally:
            if time.monotonic() - opened >= backoff.STABLE_S:
                session.progress += 1
            self._call = None
            call.cancel()
        return connection_lost()

    def end(self) -> None:
        """Cancels agents that are still deciding."""
        for task in self._thinking:
            task.cancel()

    def _decide(self, ask: Ask) -> None:
        """Lets the agent decide: at once, or in a task if `decide` is a coroutine."""
        action = ask.seat.agent.decide(ask.decision)
        if type(action) is int or not isinstance(action, Awaitable):
            self._session.answer(ask, action)
            return
        task = self._group.create_task(self._think(ask, action))
        self._thinking.add(task)
        task.add_done_callback(self._thinking.discard)

    async def _think(self, ask: Ask, action: Awaitable[int | None]) -> None:
        """Waits for an agent's answer and sends it over the then current connection."""
        self._session.answer(ask, await action)
        call = self._call
        if call is None:
            return  # The answer goes out when the seat is attached again.
        try:
            await self._flush(call)
        except (grpc.RpcError, asyncio.InvalidStateError, asyncio.CancelledError):
            # The reader of the call sees its end, too; the next connection repeats the answer.
            if self._call is call:
                call.cancel()

    async def _flush(self, call: PlayCall) -> None:
        """Sends the session's requests."""
        async with self._writing:
            if call is not self._call:
                return  # The session repeats the answers of a lost connection.
            for request in self._session.take_requests():
                await call.write(request)


async def _opened(call: PlayCall) -> None:
    """Waits until requests can be written. gRPC alone would wait for ever if the client is closed before."""
    opened = asyncio.ensure_future(call.wait_for_connection())

    def ended(_: PlayCall) -> None:
        if call.cancelled():
            opened.cancel()

    call.add_done_callback(ended)
    await opened


async def _part(call: PlayCall) -> None:
    """Half-closes the stream and waits for the server to end it. Ignores its messages."""
    try:
        async with asyncio.timeout(FAREWELL_S):
            await call.done_writing()
            while isinstance(await call.read(), pb.PlayResponse):
                pass
    except TimeoutError:
        return  # The caller cancels the call.
