"""Four random agents in one process play a game against each other over one stream.

Start a server, then run `python samples/several_seats.py 127.0.0.1:50051`.
"""

import sys

import chefshat


def main(address: str = "127.0.0.1:50051") -> None:
    """Plays the game and prints a line for each seat."""
    with chefshat.Client(address) as client:
        room = client.rooms.create("self-play")
        tickets = [client.rooms.join(room.join_code, f"player {number}").ticket for number in range(4)]
        results = client.play_many({ticket: chefshat.RandomAgent(seed) for seed, ticket in enumerate(tickets)})
    for result in results.values():
        result.raise_for_error()
        print(f"seat {result.seat}: place {result.place} with {result.points} points after {result.decisions} decisions")


if __name__ == "__main__":
    main(*sys.argv[1:])
