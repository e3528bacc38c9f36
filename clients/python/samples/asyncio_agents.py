"""Several games at once in one event loop, each with a slow agent.

Start a server, then run `python samples/asyncio_agents.py 127.0.0.1:50051`.
"""

import asyncio
import sys

import chefshat
from chefshat import aio

GAMES = 3


class Slow(chefshat.Agent):
    """Waits, like a client of a remote model, and then takes the first legal action."""

    async def decide(self, request: chefshat.Decision) -> int:
        """Decides after a delay; the other games continue meanwhile."""
        await asyncio.sleep(0.001)
        return int(request.legal_actions[0])


async def play(address: str) -> None:
    """Plays all games over one stream."""
    async with aio.Client(address) as client:
        tickets = []
        for number in range(GAMES):
            room = await client.rooms.create(f"table {number}", seats=[None, "greedy", "greedy", "random"])
            tickets.append((await client.rooms.join(room.join_code, "Slow")).ticket)
        results = await client.play_many({ticket: Slow() for ticket in tickets})
    for number, result in enumerate(results.values()):
        result.raise_for_error()
        print(f"table {number}: place {result.place}")


def main(address: str = "127.0.0.1:50051") -> None:
    """Runs the event loop."""
    asyncio.run(play(address))


if __name__ == "__main__":
    main(*sys.argv[1:])
