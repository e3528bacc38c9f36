"""What the groups of calls share: the channel, and the delays between attempts to reconnect."""

import random
import time

from chefshat.address import ServerAddress
from chefshat.backoff import Backoff
from chefshat.channels import channel
from chefshat.errors import ChefsHatError


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
