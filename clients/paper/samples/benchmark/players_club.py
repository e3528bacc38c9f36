"""A player of the Chef's Hat Players Club for `chefshat bench run`: one process of it plays all games.

chefshat bench run shift --out results/bloom --name Bloom -- python samples/benchmark/players_club.py \
    ChefsHatPlayersClub.agents.chefs_cup_v2.bloom.Bloom:Bloom --python ~/club/bin/python
"""

import argparse
import json

from chefshat import benchmark

from chefshat_paper.players_club import AgentError, AgentSpec, PlayersClubAgent
from chefshat_paper.players_club.agent import ATTEMPTS
from chefshat_paper.players_club.players import Players


def main() -> None:
    """Plays the games, each with a process that plays no other one at the time."""
    parser = argparse.ArgumentParser(description="Plays the games of `chefshat bench run` with a player of the Players Club.")
    parser.add_argument("player", metavar="MODULE:CLASS", help="the player")
    parser.add_argument("--python", required=True, help="the Python with its dependencies (docs/players-club.md)")
    parser.add_argument("--arguments", type=json.loads, default={}, metavar="JSON", help="arguments of its constructor")
    parser.add_argument("--parallel", type=int, default=1, help="as for `chefshat bench run` (default: 1)")
    options = parser.parse_args()
    spec = AgentSpec(options.player, options.player.rpartition(":")[2], options.arguments, options.python)

    def make() -> PlayersClubAgent:
        if players.given_up:
            raise AgentError(f"{players.name} has failed too often")
        return players.agent()

    with Players(spec, options.parallel, attempts=ATTEMPTS) as players:
        benchmark.play(make)


if __name__ == "__main__":
    main()
