"""An agent with a strategy: it plays its most common cards first and saves its jokers, and annotates every answer.

It reads the meaning of the actions from the server's table, without any rules. Start a server, then run
`python samples/careful_agent.py 127.0.0.1:50051`, or join a room:
`python -m chefshat.agent --address HOST:PORT --code JOIN-CODE --name Careful --agent samples.careful_agent:Careful`.
"""

import re
import sys

import chefshat
from chefshat import pb

PLAY = re.compile(r"C(\d+);Q(\d+);J(\d+)")


def price(text: str) -> tuple[int, int, int]:
    """Returns the cost of an action: lowest without jokers, with a high face and many cards; highest for passing."""
    if (play := PLAY.fullmatch(text)) is not None:
        face, quantity, jokers = map(int, play.groups())
        return jokers, -face, -quantity
    if text.startswith("give C"):
        return 0, -int(text.removeprefix("give C")), 0
    return 3, 0, 0  # Pass, give a joker, decline or declare.


class Careful(chefshat.Agent):
    """Chooses the cheapest legal action."""

    def __init__(self, texts: list[str] | None = None) -> None:
        self.texts = texts or []
        self.shifts = 0

    def decide(self, request: chefshat.Decision) -> int:
        """Compares the costs of the legal actions."""
        actions = [int(action) for action in request.legal_actions]
        if not self.texts:
            return actions[0]
        action = min(actions, key=lambda action: price(self.texts[action]))
        request.annotate(extra={"because": f"{self.texts[action]} is the cheapest of {len(actions)}"})
        return action

    def on_event(self, event: pb.GameEvent) -> None:
        """Counts the Shifts."""
        if event.HasField("shift_ended"):
            self.shifts += 1


def main(address: str = "127.0.0.1:50051") -> None:
    """Plays a game against three built-in agents."""
    with chefshat.Client(address) as client:
        agent = Careful(list(client.action_table().texts))
        room = client.rooms.create("a careful lunch", seats=[None, "random", "random", "greedy"])
        result = client.play(agent, client.rooms.join(room.join_code, "Careful").ticket)
    print(f"place {result.place} with {result.points} points after {agent.shifts} Shifts")


if __name__ == "__main__":
    main(*sys.argv[1:])
