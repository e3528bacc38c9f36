"""Experiment 1 of the paper in the reference implementation: how often the starter wins, how long a Shift is.

Four random agents play one long game with the exchange and one without. In the exchange they give their highest cards, as the
random agent of the package does. The starter is a random seat or the next one that holds a joker, so there is no condition without
jokers. Does not measure speed; runs in the environment of `reference.py`.
"""

import argparse
import logging
import sys
import tempfile
from math import sqrt

import numpy as np
from reference import Games

SEATS = 4


def play(folder: str, shifts: int, seed: int, exchange: bool) -> None:
    """Plays Shifts and prints their statistics."""
    # One more Shift than is played, so that the game does not end.
    games = Games(folder, seed, shifts=shifts + 1, exchange=exchange)
    won = 0
    pizzas, laps, turns = ([0] * shifts for _ in range(3))
    for shift in range(shifts):
        starter = int(games.env.playerStartedGame)
        ended = None
        while ended is None:
            seat = int(games.env.currentPlayer)
            ended = games.act()
            turns[shift] += 1
            # A lap begins with the starter's turn, and when the turn passes over it.
            laps[shift] += turns[shift] == 1
            if ended is None:
                moved = (int(games.env.currentPlayer) - seat) % SEATS or SEATS
                laps[shift] += (starter - seat) % SEATS in range(1, moved + 1) or (starter == seat and moved == SEATS)
        won += ended["Current_Roles"][starter] == "Chef"
        pizzas[shift] = ended["Rounds"]
    share = won / shifts
    half = 1.96 * sqrt(share * (1 - share) / shifts)
    means = ", ".join(f"{np.mean(of):.1f} {what}" for what, of in (("laps", laps), ("pizzas", pizzas), ("turns", turns)))
    condition = "with exchange" if exchange else "without exchange"
    print(f"{condition}: the starter wins {share:.1%} (+/- {half:.1%}) of {shifts:,} Shifts; {means} each", flush=True)


def main() -> int:
    """Plays both conditions."""
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n\n")[0],
        epilog="example:\n  python benchmarks/reference_mechanics.py --shifts 3000",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--shifts", type=int, default=3000, help="Shifts of each kind, some 50 a second (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="seed of all chance (default: %(default)s)")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        for exchange in (True, False):
            play(folder, options.shifts, options.seed, exchange)
    return 0


if __name__ == "__main__":
    sys.exit(main())
