"""Delays between connection attempts: exponential backoff with jitter and a limit. The clients do the waiting."""

import random
from dataclasses import dataclass

# Seconds after which a lost connection counts as the first failure again: it may have lasted while nothing happened, for instance
# before a tournament begins. The Rust SDK counts in the same way.
STABLE_S = 5.0


@dataclass(frozen=True)
class Backoff:
    """The delays between connection attempts.

    Attributes:
        first_s: seconds before the first new attempt.
        factor: factor from one delay to the next.
        max_s: maximum delay in seconds.
        attempts: maximum number of consecutive failures without progress, or a connection that lasts for `STABLE_S`; a further one
            is raised. The default waits for about ten minutes: a server may be down for a while, and its games resume when it is
            back.
    """

    first_s: float = 0.1
    factor: float = 2.0
    max_s: float = 5.0
    attempts: int = 160

    def delay_s(self, failures: int, rng: random.Random) -> float:
        """Returns the seconds to wait after `failures` consecutive failures (from 1): between half and all of the nominal delay."""
        # The exponent is capped, because a float would overflow.
        nominal = min(self.max_s, self.first_s * self.factor ** min(failures - 1, 64))
        return nominal * (0.5 + 0.5 * rng.random())
