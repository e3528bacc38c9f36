"""Decisions per second of the reference implementation, chefshatgym 2.4.0.4 from PyPI: `ChefsHatEnv.step` in process, logs off.

A random masked policy plays all four seats: it takes a legal action from the mask in the observation. The exchange is not part of
`step`; its cards are those that the random agent of the package would give. Run it in a separate environment, see the README.
"""

import contextlib
import importlib.metadata
import logging
import os
import random
import sys
import tempfile
from typing import Any

import measure
import numpy as np
import numpy.typing as npt
from ChefsHatGym.env import ChefsHatEnv as reference

# The mask is the last part of an observation.
TURN_ACTIONS = 200
NAMES = ["Ada", "Ben", "Cleo", "Dan"]


class Games:
    """Games to 15 points or of a number of Shifts, one after another.

    Attributes:
        env: the package's environment.
    """

    def __init__(self, folder: str, seed: int, *, shifts: int | None = None, exchange: bool = True) -> None:
        # The package draws its deals with the module `random`.
        random.seed(seed)
        self._chance = np.random.default_rng(seed)
        self._exchanges = exchange
        self.env = reference.ChefsHatEnv()
        # The package requires a folder, although it writes nothing with the logs off.
        self.env.startExperiment(
            gameType=reference.GAMETYPE["POINTS" if shifts is None else "MATCHES"],
            stopCriteria=15 if shifts is None else shifts,
            playerNames=NAMES,
            logDirectory=os.path.join(folder, "games"),
            verbose=0,
            saveLog=False,
            saveDataset=False,
        )
        self._observation = self._begin()

    def step(self) -> int:
        """Takes one decision and returns 1. Starts the next Shift or game after the end of one."""
        self.act()
        return 1

    def act(self) -> dict[str, Any] | None:
        """Like `step`; returns the package's info of the turn if it ended a Shift."""
        # The mask has a 2 for plays with two jokers, but refuses them.
        legal = np.flatnonzero(self._observation[-TURN_ACTIONS:] == 1)
        action = np.zeros(TURN_ACTIONS)
        action[legal[self._chance.integers(len(legal))]] = 1
        self._observation, _, shift_over, _, info = self.env.step(action)
        if not info["Action_Valid"]:
            raise AssertionError("a legal action was refused")
        if self.env.gameFinished:
            self._observation = self._begin()
        elif shift_over:
            self._exchange()
            self._observation = self.env.getObservation()
        return info if shift_over else None

    def _begin(self) -> npt.NDArray[np.float32]:
        # It prints the path of its log.
        with contextlib.redirect_stdout(None):
            observation: npt.NDArray[np.float32] = self.env.reset()[0]
        return observation

    def _exchange(self) -> None:
        if not self._exchanges:
            # The remaining steps to start a Shift.
            self.env.start_match_define_order()
            return
        _, dishwasher_cards, _, waiter_card, _, sous_chef_hand, _, chef_hand = self.env.get_chef_souschef_roles_cards()
        self.env.exchange_cards(sorted(chef_hand[-2:]), sous_chef_hand[-1], waiter_card, dishwasher_cards, False, -1)


def main() -> int:
    """Measures and prints."""
    options = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/reference.py --rounds 5 --json").parse_args()
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        games = Games(folder, options.seed)
        measured = measure.measure("chefshatgym, ChefsHatEnv.step", games.step, options)
    measure.show([measured], options, chefshatgym=importlib.metadata.version("chefshatgym"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
