"""An agent that plays by a network from a file, in any room of a server whose rule set has the sizes it was trained for.

It takes the legal action with the highest output, and the default decision where the network has no say; so it never takes a wrong
action, however it was trained. The command `python -m chefshat.learn play` takes part with it in rooms and tournaments.
"""

import argparse

import numpy as np
import numpy.typing as npt

from chefshat import Agent, Client, Decision, SeatInfo, join_options, outcome, pb
from chefshat.errors import exit_code
from chefshat.learn import network
from chefshat.learn.network import Network, NetworkFileError


class RulesDoNotFit(ValueError):
    """A network was trained for other numbers of players, faces or jokers than those of the game. The message names both."""


class NetworkAgent(Agent):
    """Plays one seat by a network."""

    def __init__(self, network: Network) -> None:
        self._network = network

    def on_attached(self, seat: SeatInfo) -> None:
        """Looks whether the network knows such games, if the game has begun; else the first decision does."""
        self._check(seat)

    def decide(self, request: Decision) -> int:
        """The legal action with the highest output."""
        self._check(request.seat_info)
        kinds = np.array([request.kind], np.uint8)
        seats = np.array([request.seat], np.uint8)
        mask_bits = np.frombuffer(request.mask_bytes, np.uint8)[np.newaxis]
        return int(self._network.actions(Row(request), seats, kinds, mask_bits)[0])

    def _check(self, seat: SeatInfo) -> None:
        if seat.game_started is not None:
            self.check_rules(seat.game_started.rules)

    def check_rules(self, rules: pb.RuleSet) -> None:
        """Raises RulesDoNotFit if the network was not trained for games of this rule set's numbers."""
        info = self._network.info
        if (rules.players, rules.faces, rules.jokers) != (info.players, info.faces, info.jokers):
            raise RulesDoNotFit(
                f"the network {info.name!r} plays with {info.players} players, {info.faces} faces and {info.jokers} jokers; this "
                f"game has {rules.players}, {rules.faces} and {rules.jokers}"
            )


class Row:
    """The observation of one decision as columns of one row, as `features` takes them."""

    def __init__(self, request: Decision) -> None:
        none = np.zeros(request.faces + 1, np.uint8)
        self.pizzas = np.array([request.pizza], np.uint32)
        self.hands = _row(request.hand)
        self.golden = np.array([request.golden], np.uint8)
        self.boards = np.array([[request.board_face, request.board_size, request.board_jokers]], np.uint8)
        self.cards_left = _row(request.cards_left)
        self.passed = _row(request.passed)
        self.places = _row(request.places)
        self.roles = _row(request.roles)
        self.points = np.minimum(request.points, np.iinfo(np.uint32).max).astype(np.uint32)[np.newaxis]
        self.played = _row(request.played)
        # Nothing given or received is left out of the message.
        self.gave = _row(request.gave if len(request.gave) else none)
        self.received = _row(request.received if len(request.received) else none)


def run(options: argparse.Namespace) -> int:
    """The command: plays one game in a room, or a tournament to its end, and prints the standings. Returns the exit code."""
    (way,) = join_options.ways(options.parser, options)

    def play() -> int:
        net = network.load(options.file)
        with Client(options.address) as client:
            played = join_options.take_part(client, way, lambda seat: NetworkAgent(net), check_rules=NetworkAgent(net).check_rules)
            return outcome.report(played, as_json=options.json)

    return exit_code(play, NetworkFileError, RulesDoNotFit, as_json=options.json)


def _row(values: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    return values[np.newaxis]
