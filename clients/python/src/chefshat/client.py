"""The blocking client. Its calls are in `_sync`; here is how it plays: the connection, its loss, and the threads.

The protocol of playing is in `session`.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Awaitable, Coroutine, Iterator
from pathlib import Path
from typing import TypeAlias

from chefshat import backoff, pb
from chefshat._sync.calls import Calls
from chefshat.address import ServerAddress
from chefshat.agents import Agent
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.network import grpc
from chefshat.result import SeatResult
from chefshat.seat_session import Ask
from chefshat.session import PlaySession

# Seconds an answer waits for those of the stream's other seats before it is sent.
FLUSH_AFTER_S = 0.002
# Seconds the server has to end a stream whose seats are all done.
FAREWELL_S = 1.0

# The name exists only in the type stubs of grpc.
PlayCall: TypeAlias = "grpc._CallIterator[pb.PlayResponse]"


class Client(Calls):
    """A blocking connection to a server, opened on first use. Close it, or use it as a context manager. Threads may share it.

    The calls are methods, and in groups: `rooms`, `tournaments`, `tables`, `records` and `studies`; see `Calls`.

    Every method raises `ChefsHatError`: with the server's reason if the server refuses, with "UNAVAILABLE" if it cannot be reached.
    """

    def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, reconnecting as needed."""
        failures = 0
        while not session.done:
            before = session.progress
            error = self._play_connection(session)
            if error is None:
                break
            failures = 1 if session.progress > before else failures + 1
            try:
                self._connection.wait(failures, error)
            except ChefsHatError as final:
                session.give_up(final)

    def _play_connection(self, session: PlaySession) -> ChefsHatError | None:
        """Plays over one connection. Returns the error that ended it, or None if the session is done."""
        session.connected()
        pump = _Pump(session)
        with pump.busy:
            # The stream's thread may request the second message before `Play` returns.
            pump.call = call = self._play.Play(pump)
        try:
            if not call.add_callback(pump.stopped.set):
                pump.stopped.set()
            pump.stopped.wait()
        except BaseException:
            call.cancel()
            raise
        # Waits for an agent that is still deciding, which uses the session.
        with pump.busy:
            pump.closed = True
            session.lost(pump.asks)
        if time.monotonic() - pump.opened >= backoff.STABLE_S:
            session.progress += 1
        failure = pump.failure
        if failure is not None and not isinstance(failure, grpc.RpcError):
            call.cancel()
            raise failure
        if session.done:
            _part(call)
            return None
        # If the call ended while an agent was deciding, its status has the error.
        call.cancel()
        if failure is None and call.code() is grpc.StatusCode.OK:
            return connection_lost()
        return from_rpc_error(failure or call)


class _Pump(Iterator[pb.PlayRequest]):
    """The stream's requests, created on demand.

    gRPC takes a stream's requests from an iterator, in a thread of its own. This iterator reads the responses in the same thread
    and lets the agents decide there, which saves a thread switch for every decision.
    """

    def __init__(self, session: PlaySession) -> None:
        self.call: PlayCall
        #: Locked while the session is in use.
        self.busy = threading.Lock()
        #: Set when the session is done, something failed, or the call has ended.
        self.stopped = threading.Event()
        #: Ends the iterator; set under `busy`.
        self.closed = False
        #: When the first response arrived.
        self.opened = math.inf
        #: The exception of the call or of an agent.
        self.failure: BaseException | None = None
        self._session = session
        self._ready = deque(session.take_requests())
        #: Decisions that no agent has been asked for yet.
        self.asks: deque[Ask] = deque()

    def __next__(self) -> pb.PlayRequest:
        with self.busy:
            if not self.closed:
                try:
                    request = self._next_request()
                except BaseException as failure:  # `_play_connection` raises it again.
                    self.failure = failure
                else:
                    if request is not None:
                        return request
            self.closed = True
            self.stopped.set()
            raise StopIteration

    def _next_request(self) -> pb.PlayRequest | None:
        """Returns the next request; None if the session is done or the call has ended without an error."""
        session = self._session
        while not self._ready:
            if self.asks:
                self._decide()
            elif session.done:
                return None
            else:
                response = next(self.call, None)
                if response is None:
                    return None
                self.opened = min(self.opened, time.monotonic())
                self.asks.extend(session.receive(response))
                if self.asks:
                    self._decide()
            self._ready.extend(session.take_requests())
        return self._ready.popleft()

    def _decide(self) -> None:
        """Lets agents decide until no decision is open, or until the first answer must be sent."""
        asks = self.asks
        until = time.monotonic() + FLUSH_AFTER_S
        while asks:
            ask = asks.popleft()
            action = ask.seat.agent.decide(ask.decision)
            if type(action) is not int and isinstance(action, Awaitable):
                if isinstance(action, Coroutine):
                    action.close()  # Avoids Python's warning about an unawaited coroutine.
                raise TypeError("an agent with an async `decide` needs chefshat.aio")
            self._session.answer(ask, action)
            if time.monotonic() > until:
                return


def _part(call: "PlayCall") -> None:
    """Waits for the server to end a half-closed stream. Ignores its messages."""
    limit = threading.Timer(FAREWELL_S, call.cancel)
    limit.start()
    try:
        # Unread messages would hide the end of the stream.
        for _ in call:
            pass
    except grpc.RpcError:
        return  # The games are over in any case.
    finally:
        limit.cancel()


def play(
    agent: Agent,
    address: str | ServerAddress,
    *,
    join_code: str,
    name: str,
    seat: int | None = None,
    token: str | None = None,
    ca: Path | str | None = None,
) -> SeatResult:
    """Joins a room, plays its game to the end and returns the result.

    Args:
        agent: the agent.
        address: "host:port", "http://host:port" or, for TLS, "https://host:port".
        join_code: the room's join code.
        name: display name, 1..=64 characters.
        seat: the seat; None: the first free one.
        token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set.
        ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.

    Raises:
        ChefsHatError: the room or the seat was refused, another connection took the seat, or the server stayed unreachable.
    """
    with Client(address, token=token, ca=ca) as client:
        return client.play(agent, client.rooms.join(join_code, name, seat=seat).ticket)
