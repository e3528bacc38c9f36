"""What the groups of calls share: the channel, and the delays between attempts to reconnect."""

import asyncio
import random

from chefshat.address import ServerAddress
from chefshat.backoff import Backoff
from chefshat.channels import async_channel
from chefshat.errors import ChefsHatError


class AsyncConnection:
    """A channel to a server, opened on first use."""

    def __init__(self, server: ServerAddress, backoff: Backoff, timeout: float | None) -> None:
        self.channel = async_channel(server, timeout=timeout)
        self._backoff = backoff
        self._rng = random.Random()

    async def wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next connection attempt. Raises the error if there is to be none."""
        if not error.retryable or failures > self._backoff.attempts:
            raise error
        await asyncio.sleep(self._backoff.delay_s(failures, self._rng))
