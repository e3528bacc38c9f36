"""Watches a room and prints a line for each pizza, finish and Shift.

Start a server, then run `python samples/spectator.py 127.0.0.1:50051 ROOM-ID`. Without a room it creates one, with a random agent
and three built-in ones.
"""

import sys
import threading

import chefshat
from chefshat import pb


def describe(event: pb.GameEvent) -> str | None:
    """Returns the line for an event; None for other events."""
    if event.HasField("pizza_done"):
        return f"pizza {event.pizza_done.pizza} is done, seat {event.pizza_done.next_leader} leads the next"
    if event.HasField("seat_finished"):
        return f"seat {event.seat_finished.seat} finishes at place {event.seat_finished.place}"
    if event.HasField("shift_ended"):
        return f"Shift {event.shift_ended.shift} is over, points so far {list(event.shift_ended.points)}"
    if event.HasField("game_ended"):
        return f"seat {event.game_ended.standings[0].seat} has won"
    if event.HasField("game_aborted"):
        return "the game was aborted"
    return None


def main(address: str = "127.0.0.1:50051", room_id: str = "") -> None:
    """Watches until the game is over."""
    with chefshat.Client(address) as client:
        player = None
        if not room_id:
            room = client.rooms.create("open kitchen", seats=[None, "greedy", "greedy", "random"])
            room_id = room.room.room_id
            ticket = client.rooms.join(room.join_code, "Ada").ticket
            player = threading.Thread(target=client.play, args=(chefshat.RandomAgent(seed=1), ticket))
            player.start()
        for event in client.rooms.watch(room_id):
            if (line := describe(event)) is not None:
                print(line)
        if player is not None:
            player.join()


if __name__ == "__main__":
    main(*sys.argv[1:])
