"""Decisions per second of OpenSpiel's hearts (C++, called from Python), a game of four players with 52 cards, one game at a time.

All players choose a random legal action. The deal, which OpenSpiel makes card by card, is part of the time but not of the
decisions. Measured without observations, and with the tensor that a learning agent would receive.
"""

import functools
import importlib.metadata
import random
import sys

import measure
import pyspiel


def play_game(game: pyspiel.Game, chance: random.Random, observe: bool) -> int:
    """Plays one game and returns the number of decisions."""
    state = game.new_initial_state()
    decisions = 0
    while not state.is_terminal():
        legal = state.legal_actions()
        if state.is_chance_node():
            # All outcomes of the deal are equally likely.
            state.apply_action(legal[int(chance.random() * len(legal))])
            continue
        if observe:
            state.information_state_tensor()
        state.apply_action(legal[int(chance.random() * len(legal))])
        decisions += 1
    return decisions


def main() -> int:
    """Measures and prints."""
    options = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/open_spiel_hearts.py --rounds 5 --json").parse_args()
    game = pyspiel.load_game("hearts")
    chance = random.Random(options.seed)
    measured = [
        measure.measure("hearts, without observations", functools.partial(play_game, game, chance, False), options),
        measure.measure("hearts, with observations", functools.partial(play_game, game, chance, True), options),
    ]
    measure.show(measured, options, open_spiel=importlib.metadata.version("open_spiel"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
