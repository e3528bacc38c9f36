"""An agent that is killed in the middle of a game, which it cannot finish itself. No tests of its own."""

import sys
import threading

import chefshat

#: What it says on standard error when it is to be killed.
STALLS = "stalls"


class Stalling(chefshat.RandomAgent):
    """Plays two decisions of a game, says that it stalls, and never comes back from the third."""

    def __init__(self) -> None:
        super().__init__(seed=1)
        self.decisions = 0

    def decide(self, request: chefshat.Decision) -> int:
        self.decisions += 1
        if self.decisions == 3:
            print(STALLS, file=sys.stderr, flush=True)
            threading.Event().wait()
        return super().decide(request)
