"""How long to wait before connecting again: exponentially longer, with jitter, a bounded number of times.

Only the arithmetic is here; who waits and what counts as progress is the clients' business.
"""

import random
from dataclasses import dataclass


@dataclass(frozen=True)
class Backoff:
    """The waits between attempts to connect.

    Attributes:
        first_s: seconds before the first new attempt.
        factor: by how much each wait is longer than the one before.
        max_s: seconds no wait exceeds.
        attempts: how many failures in a row without any progress in between are borne; the next one is raised. The standard waits
            for about ten minutes: a server may be away for a while, and its games go on when it is back.
    """

    first_s: float = 0.1
    factor: float = 2.0
    max_s: float = 5.0
    attempts: int = 160

    def delay_s(self, failures: int, chance: random.Random) -> float:
        """Seconds to wait after so many failures in a row (from 1): between half and all of the nominal wait, drawn at random."""
        # The exponent is capped because a float overflows long before anybody has waited that often.
        nominal = min(self.max_s, self.first_s * self.factor ** min(failures - 1, 64))
        return nominal * (0.5 + 0.5 * chance.random())
