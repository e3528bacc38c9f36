"""`chefshat-robot markers`: every event of a game as a marker of Lab Streaming Layer, beside EEG, video and physiology.

A room is one stream: name `ChefsHat ROOM-NAME`, type `Markers`, one text channel, irregular rate, source id `chefshat-ROOM-ID`.
Each marker is a JSON object on one line:

    {"room_id": "...", "past": false, "sequence": 12, "elapsed_ms": 3456, "kind": "play", "fields": {"seat": 1, "face": 9, ...}}

with the public fields of the event as named in event.proto. A marker's time is when this command received the event. `elapsed_ms`
is the server's own time of it, in milliseconds since the room was created: the smallest difference of the two over a game is the
offset of the clocks, and what exceeds it is delay of the network. `past` markers are of events that had happened before the command
started; their times mean nothing.
"""

from __future__ import annotations

import argparse
import asyncio
import json
from collections.abc import Callable, Sequence
from typing import Any

from chefshat import aio
from chefshat.join_options import add_server_options, server_of

from chefshat_robot import wire
from chefshat_robot.drivers.driver import LOG, require
from chefshat_robot.running import SERVER, live_from, run_command

DESCRIPTION = """\
Sends every public event of rooms as markers of Lab Streaming Layer, one stream for each room, until their games are over.

Example:
  chefshat-robot markers --address 127.0.0.1:50051 ROOM-ID

In LabRecorder, choose the stream "ChefsHat ROOM-NAME" of the type Markers.
"""
# Seconds for recorders to fetch the last markers.
LINGER_S = 3.0


async def send_markers(
    client: aio.Client, room_id: str, *, linger_s: float = LINGER_S, ready: Callable[[Any], object] = lambda outlet: None
) -> int:
    """Sends the events of a room as markers, until its game is over.

    Args:
        client: the connection to the server.
        room_id: the room.
        linger_s: seconds for recorders to fetch the last markers.
        ready: called with the outlet before the first marker; an awaitable result is awaited.

    Returns:
        The number of markers.

    Raises:
        ChefsHatError: the room cannot be watched.
        RobotError: the extra `lsl` is not installed.
    """
    pylsl = require("pylsl", "lsl")
    room = await client.get_room(room_id)
    live = await live_from(client, room_id)
    name = f"ChefsHat {room.name or room_id[:8]}"
    info = pylsl.StreamInfo(name, "Markers", 1, pylsl.IRREGULAR_RATE, pylsl.cf_string, f"chefshat-{room_id}")
    for key, value in (("room_id", room_id), ("game_id", room.game_id), ("format", "json")):
        info.desc().append_child_value(key, value)
    outlet = pylsl.StreamOutlet(info)
    LOG.info("sending the stream %r", name)
    waited = ready(outlet)
    if asyncio.iscoroutine(waited):
        await waited
    sent = 0
    async for event in client.watch(room_id):
        stamp = pylsl.local_clock()
        marker = {"room_id": room_id, "past": event.sequence < live, **wire.event_to_json(event)}
        outlet.push_sample([json.dumps(marker, ensure_ascii=False)], stamp)
        sent += 1
    if outlet.have_consumers():
        await asyncio.sleep(linger_s)
    LOG.info("the game of %r is over after %d markers", name, sent)
    return sent


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    parser.add_argument("rooms", nargs="+", metavar="ROOM", help="the id of a room")
    add_server_options(parser, default=SERVER)


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand."""

    async def follow_all(rooms: Sequence[str]) -> int:
        async with aio.Client(server_of(arguments)) as client:
            await asyncio.gather(*(send_markers(client, room) for room in rooms))
        return 0

    return run_command(lambda: follow_all(arguments.rooms))
