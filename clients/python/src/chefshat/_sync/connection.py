"""What the groups of calls share: the channel, streams that are opened again when they break, and the delays before that."""

import random
import time
from collections.abc import Callable

from chefshat.address import ServerAddress
from chefshat.backoff import Backoff
from chefshat.channels import channel
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.network import grpc
from chefshat.requests import Answered, Messages, Streamed, received


class Connection:
    """A channel to a server, opened on first use."""

    def __init__(self, server: ServerAddress, backoff: Backoff, timeout: float | None) -> None:
        self.channel = channel(server, timeout=timeout)
        self._backoff = backoff
        self._rng = random.Random()

    def wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next connection attempt. Raises the error if there is to be none."""
        if not error.retryable or failures > self._backoff.attempts:
            raise error
        time.sleep(self._backoff.delay_s(failures, self._rng))

    def messages(self, begin: Callable[[], Streamed[Answered]], unfinished: str = "") -> Messages[Answered]:
        """Iterates over the messages of a stream, which is opened again when it breaks.

        A stream begins with a state, so only what follows its first message counts as progress: a server whose every stream breaks
        is given up.

        Args:
            begin: opens the stream, from the position to resume at.
            unfinished: the error if the server ends the stream, which then counts as broken; empty: the messages end there.
        """
        failures = 0
        while True:
            call, has_state = begin(), False
            try:
                for message in received(call):
                    if has_state:
                        failures = 0
                    has_state = True
                    yield message
                if not unfinished:
                    return
                error = connection_lost(unfinished)
            except grpc.RpcError as failure:
                error = from_rpc_error(failure)
            finally:
                call.cancel()
            failures += 1
            self.wait(failures, error)
