"""Creates a tournament and takes part in it with one participant, up to two games at a time, against built-in agents.

Start a server, then run `python samples/tournament.py 127.0.0.1:50051`.
"""

import sys

import chefshat
from chefshat import pb


class Hoarder(chefshat.Agent):
    """Takes the last legal action, which is passing where possible."""

    def __init__(self, seat: chefshat.SeatInfo) -> None:
        self.seat = seat

    def decide(self, request: chefshat.Decision) -> int:
        """Takes the action with the highest index."""
        return int(request.legal_actions[-1])


def main(address: str = "127.0.0.1:50051") -> None:
    """Creates the tournament, takes part, and prints the standings."""
    settings = pb.TournamentSettings(
        name="Coppa del Cuoco",
        format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
        rules=pb.RuleSet(target_shifts=1),
        games_per_pairing=2,
        built_in_agents=["greedy", "random", "random"],
        start_when_joined=4,
    )
    with chefshat.Client(address) as client:
        cup = client.tournaments.create(settings)
        joined = client.tournaments.join(cup.join_code, "Hoarder", max_games=2)
        played = client.play_tournament(joined.ticket, Hoarder)
        print(f"places in {len(played)} games: {[result.place for result in played]}")
        results = client.tournaments.results(cup.tournament.tournament_id)
    for line in results.standings:
        print(f"{line.place}. {results.tournament.participants[line.participant].name}: {line.score} points")


if __name__ == "__main__":
    main(*sys.argv[1:])
