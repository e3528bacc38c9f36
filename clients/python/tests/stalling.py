"""An agent that stalls in the middle of a game, to be killed there. Contains no tests."""

import sys
import threading

import chefshat

#: Its message on standard error when it stalls.
STALLS = "stalls"


class Stalling(chefshat.RandomAgent):
    """Takes two decisions, prints that it stalls, and hangs in the third."""

    def __init__(self) -> None:
        super().__init__(seed=1)
        self.decisions = 0

    def decide(self, request: chefshat.Decision) -> int:
        self.decisions += 1
        if self.decisions == 3:
            print(STALLS, file=sys.stderr, flush=True)
            threading.Event().wait()
        return super().decide(request)
