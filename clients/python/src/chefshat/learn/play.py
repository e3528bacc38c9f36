"""The command `play`, and its agent, which plays by a network from a file in games of the size the network was trained for.

It takes the legal action with the highest output, and the default action where the network has no outputs, so it never takes an
illegal action.
"""

import argparse

from chefshat import Agent, Client, Decision, SeatInfo, join_options, outcome, pb
from chefshat.errors import exit_code
from chefshat.learn import features, network
from chefshat.learn.network import Network, NetworkFileError


class RulesDoNotFit(ValueError):
    """The network was trained for games of another size. The message names both sizes."""


class NetworkAgent(Agent):
    """Plays one seat by a network."""

    def __init__(self, network: Network) -> None:
        self._network = network

    def on_attached(self, seat: SeatInfo) -> None:
        """Checks that the network fits the game, if the game has started; otherwise the first decision does."""
        self._check(seat)

    def decide(self, request: Decision) -> int:
        """Returns the legal action with the highest output, or the default action for a decision without outputs."""
        self._check(request.seat_info)
        if self._network.info.output == "turns" and request.kind != pb.DECISION_KIND_TURN:
            return request.default_action
        return int(self._network.actions_of(request.situations())[0])

    def _check(self, seat: SeatInfo) -> None:
        if seat.game_started is not None:
            rules = seat.game_started.rules
            self._check_size(rules.players, rules.faces, seat.game_started.hand_size)

    def check_rules(self, rules: pb.RuleSet) -> None:
        """Raises RulesDoNotFit if the network does not fit games under these rules."""
        self._check_size(rules.players, rules.faces, features.dealt(rules.players, rules.faces, rules.jokers))

    def _check_size(self, players: int, faces: int, hand_size: int) -> None:
        info = self._network.info
        if not info.fits(players, faces, hand_size):
            raise RulesDoNotFit(
                f"the network {info.name!r} plays with {info.players} players, {info.faces} faces and hands of {info.hand_size} "
                f"cards; this game has {players}, {faces} and {hand_size}"
            )


def run(options: argparse.Namespace) -> int:
    """Runs the command: plays a game or a tournament, and prints the standings. Returns the exit code."""
    (way,) = join_options.ways(options.parser, options)

    def play() -> int:
        net = network.load(options.file)
        with Client(join_options.server_of(options)) as client:
            played = join_options.take_part(client, way, lambda seat: NetworkAgent(net), check_rules=NetworkAgent(net).check_rules)
            return outcome.report(played, as_json=options.json)

    return exit_code(play, NetworkFileError, RulesDoNotFit, as_json=options.json)
