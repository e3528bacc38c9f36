"""An agent for `chefshat bench run` that plays at random, and passes only if it must: what one has without any skill.

chefshat bench run shift --out results/never-idle --name never_idle -- python samples/benchmark/never_idle.py
"""

import random

import chefshat
from chefshat import benchmark

# Of all games, which are played one after the other: the same ones again in another run.
CHANCE = random.Random(1)


class NeverIdle(chefshat.Agent):
    """Plays at random, and passes only if it must."""

    def decide(self, request: chefshat.Decision) -> int:
        """Chooses among the legal actions but passing with equal probability; passes if there is no other."""
        # The last action of a turn; other decisions do not have it.
        passing = request.turn_actions - 1
        plays = [int(action) for action in request.legal_actions if action != passing]
        return CHANCE.choice(plays or [passing])


if __name__ == "__main__":
    benchmark.play(NeverIdle)
