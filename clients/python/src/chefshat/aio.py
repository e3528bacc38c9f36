"""The asyncio client: the methods of the blocking `chefshat.Client`, awaited. Agents may decide in coroutines.

Its calls are in `_async.calls`; here is how it plays: the connection, its loss, and the tasks of agents that are deciding. The
protocol of playing is in `session`.
"""

import asyncio
from collections.abc import Awaitable
from typing import TypeAlias

import grpc
import grpc.aio

from chefshat import pb
from chefshat._async.calls import AsyncCalls
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.seat_session import Ask
from chefshat.session import PlaySession

# Seconds the server has to end a stream whose seats are all done.
FAREWELL_S = 1.0

PlayCall: TypeAlias = "grpc.aio.StreamStreamCall[pb.PlayRequest, pb.PlayResponse]"


class Client(AsyncCalls):
    """A connection to a server, opened on first use. Close it, or use it as an asynchronous context manager.

    Create it where the event loop runs. Every method raises `ChefsHatError`: with the server's reason if the server refuses, with
    "UNAVAILABLE" if it cannot be reached.
    """

    async def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, over as many connections as it takes."""
        failures = 0
        run = _Run(session)
        try:
            while not session.done:
                before = session.progress
                error = await run.connection(self._play.Play())
                session.lost()
                if session.done:
                    break
                failures = 1 if session.progress > before else failures + 1
                try:
                    await self._wait(failures, error)
                except ChefsHatError as final:
                    session.give_up(final)
        finally:
            await run.end()


class _Run:
    """A session being played: the connection of the moment, and the agents that are thinking."""

    def __init__(self, session: PlaySession) -> None:
        self._session = session
        self._call: PlayCall | None = None
        # gRPC takes one message at a time.
        self._writing = asyncio.Lock()
        self._thinking: set[asyncio.Task[None]] = set()
        self._failure: BaseException | None = None

    async def connection(self, call: PlayCall) -> ChefsHatError:
        """Plays over one connection until it is lost or the session is done. Returns why it was lost."""
        session = self._session
        session.connected()
        self._call = call
        try:
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
            return connection_lost()  # The call ended before this side could write to it.
        except asyncio.CancelledError:
            # Cancelling the call (below, for an agent's failure) and cancelling the caller's task look the same from here.
            if self._failure is not None:
                raise self._failure from None
            raise
        finally:
            self._call = None
            call.cancel()
        return connection_lost()

    async def end(self) -> None:
        """Ends whatever agents are still thinking."""
        thinking = list(self._thinking)
        for task in thinking:
            task.cancel()
        await asyncio.gather(*thinking, return_exceptions=True)

    def _decide(self, ask: Ask) -> None:
        """Has the agent decide: at once, or in a task if it takes its time."""
        action = ask.seat.agent.decide(ask.decision)
        if type(action) is int or not isinstance(action, Awaitable):
            self._session.answer(ask, action)
            return
        task = asyncio.ensure_future(self._think(ask, action))
        self._thinking.add(task)
        task.add_done_callback(self._thinking.discard)

    async def _think(self, ask: Ask, action: Awaitable[int]) -> None:
        """Waits for an agent's answer and sends it over the connection there is by then."""
        try:
            self._session.answer(ask, await action)
        except Exception as failure:
            self._failure = failure
            if self._call is not None:
                self._call.cancel()
            return
        call = self._call
        if call is None:
            return  # The answer goes out when the seat is attached again.
        try:
            await self._flush(call)
        except (grpc.RpcError, asyncio.InvalidStateError, asyncio.CancelledError):
            # Whoever reads the call sees its end too; the answer is repeated on the next connection.
            if self._call is call:
                call.cancel()

    async def _flush(self, call: PlayCall) -> None:
        """Sends what the session has to say."""
        async with self._writing:
            if call is not self._call:
                return  # The answers of a lost connection are the session's to repeat.
            for request in self._session.take_requests():
                await call.write(request)


async def _part(call: PlayCall) -> None:
    """Half-closes the stream and gives the server the time to end it. What it still says is of no interest."""
    try:
        async with asyncio.timeout(FAREWELL_S):
            await call.done_writing()
            while isinstance(await call.read(), pb.PlayResponse):
                pass
    except TimeoutError:
        return  # The caller cancels the call.
