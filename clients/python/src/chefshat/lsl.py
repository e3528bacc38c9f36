"""Markers of a game for the Lab Streaming Layer (LSL), which records EEG, eye trackers and other instruments on one clock.

`python -m chefshat.lsl --address HOST:PORT --room CODE` opens a stream of markers and sends every event of a room, with
`--study ID --participant N` every event of all games of a participant. `MarkerStream` does the same from a program, and
`MarkedAgent` from an agent, with what its seat sees. A marker has the time at which the event happened at the server, on LSL's
clock (`Client.read_clock`), not the time at which it arrived. docs/instruments.md describes the stream.
"""

import argparse
import contextlib
import sys
import time
from collections.abc import Awaitable, Sequence
from types import TracebackType
from typing import Self

from google.protobuf.json_format import MessageToJson

try:
    import pylsl
except ImportError as error:
    raise ImportError("chefshat.lsl needs pylsl, which brings liblsl: pip install 'pylsl>=1.18'") from error

import chefshat
from chefshat import join_options, pb
from chefshat.agent import make_agent
from chefshat.agents import Agent
from chefshat.client import Client
from chefshat.clock import RoomClock
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError, exit_code
from chefshat.result import SeatResult

# Seconds for which a command waits for recorders to receive the last markers.
LINGER_S = 2.0
# Seconds until a game of a study is looked for again whose room is just being created.
ROOM_INTERVAL_S = 0.2
# Name of the stream, unless another is given. Without an apostrophe, which ends a text in the queries of LSL.
NAME = "ChefsHat"
# What a marker says: labels and units of the channels.
CHANNELS = {"code": "kind of the event and seat", "event": "JSON of chefshat.v1.GameEvent"}

EXAMPLE = """examples:
  python -m chefshat.lsl --address 127.0.0.1:50051 --room BCDF2345
  python -m chefshat.lsl --address https://play.example.org --room ROOM-ID --secret OWNER-TOKEN --wait
  python -m chefshat.lsl --address 127.0.0.1:50051 --study STUDY-ID --participant 3 --secret OWNER-TOKEN
  python -m chefshat.lsl --address 127.0.0.1:50051 --ticket TICKET --agent my_module:MyAgent

Start it before the game, and the recorder (LabRecorder, for example) after it; --wait holds the markers back until something
records them. The stream is called "ChefsHat" and has the type Markers.

exit code: 0 the game or study is over, 1 the server refused or was lost, 2 wrong arguments, 130 interrupted
"""


class MarkerStream:
    """A stream of LSL with a marker for each event of one game, or of games one after another; a context manager."""

    def __init__(
        self, client: Client, room_id: str, *, viewer: str = "spectator", name: str = NAME, source: str | None = None
    ) -> None:
        """Opens the stream.

        Args:
            client: a connection to the server.
            room_id: the room.
            viewer: whose view of the events it has, for the description of the stream: "spectator" or "seat 2".
            name: the name of the stream.
            source: whose events these are, by which a recorder knows the stream again; None: the game and the viewer.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached.
        """
        self._client = client
        server = client.server_info()
        self.clock = RoomClock(client, room_id, local=pylsl.local_clock)
        reading = self.clock.reading
        # With the same id a recorder resumes the stream after a restart of this program.
        source = source or f"chefshat {reading.game_id} {viewer}"
        info = pylsl.StreamInfo(name, "Markers", len(CHANNELS), pylsl.IRREGULAR_RATE, pylsl.cf_string, source)
        description = info.desc()
        channels = description.append_child("channels")
        for label, unit in CHANNELS.items():
            channel = channels.append_child("channel")
            for key, value in (("label", label), ("type", "Marker"), ("unit", unit)):
                channel.append_child_value(key, value)
        game = description.append_child("game")
        for key, value in {
            "room_id": room_id,
            "game_id": reading.game_id,
            "viewer": viewer,
            "created_at_ms": str(reading.created_at_ms),
        }.items():
            game.append_child_value(key, value)
        acquisition = description.append_child("acquisition")
        for key, value in {
            "manufacturer": "Chef's Hat",
            "server": client.address,
            "server_version": server.server_version,
            "clock_error_s": f"{reading.error:.6f}",
        }.items():
            acquisition.append_child_value(key, value)
        self.source = source
        self._outlet: pylsl.StreamOutlet | None = pylsl.StreamOutlet(info)
        self._last = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None) -> None:
        self.close()

    def wait_for_recorder(self, timeout_s: float) -> bool:
        """Waits until something receives the stream. Returns whether it does."""
        return bool(self._open().wait_for_consumers(timeout_s))

    def continue_with(self, room_id: str) -> None:
        """Continues with the next game: that of another room, whose clock it reads.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached.
        """
        clock = RoomClock(self._client, room_id, local=pylsl.local_clock)
        self.clock.close()
        self.clock = clock
        self._last = 0

    def push(self, event: pb.GameEvent) -> None:
        """Sends an event, with the time at which it happened. Ignores events that were sent before."""
        if event.sequence <= self._last:
            return
        if event.HasField("server_restarted"):
            # If the server does not answer, the thread of the clock tries again.
            with contextlib.suppress(ChefsHatError):
                self.clock.read(jumped=True)
        self._open().push_sample([code_of(event), MessageToJson(event, indent=None)], self.clock.local(event))
        self._last = event.sequence

    def close(self, linger_s: float = 0.0) -> None:
        """Closes the stream; what has not been received by then is lost. Waits up to `linger_s` seconds for recorders to leave."""
        self.clock.close()
        until = time.monotonic() + linger_s
        while self._outlet is not None and self._outlet.have_consumers() and time.monotonic() < until:
            time.sleep(0.05)
        self._outlet = None

    def _open(self) -> pylsl.StreamOutlet:
        if self._outlet is None:
            raise ValueError("the stream is closed")
        return self._outlet


def code_of(event: pb.GameEvent) -> str:
    """The kind of an event in a word, as event.proto names it, and its seat if it has one: "play 2", "pizza_done"."""
    kind = event.WhichOneof("kind")
    if kind is None:
        return "unknown"
    what = getattr(event, kind)
    return f"{kind} {what.seat}" if "seat" in what.DESCRIPTOR.fields_by_name else kind


class MarkedAgent(Agent):
    """An agent that also sends the events of its game, as its seat sees them, as markers.

    Sends them when they arrive, with the times at which they happened. By default that is together with the seat's decisions.
    """

    def __init__(self, agent: Agent, client: Client, *, name: str = NAME, wait_s: float = 0.0) -> None:
        """Sets the agent.

        Args:
            agent: the agent that plays.
            client: a connection to the server, for its clock.
            name: the name of the stream.
            wait_s: seconds to wait for a recorder when the seat is attached.
        """
        self._agent = agent
        self._client = client
        self._name = name
        self._wait_s = wait_s
        self._markers: MarkerStream | None = None

    def decide(self, request: Decision) -> int | Awaitable[int | None] | None:
        """Asks the agent."""
        return self._agent.decide(request)

    def on_attached(self, seat: SeatInfo) -> None:
        """Opens the stream, the first time."""
        if self._markers is None:
            self._markers = MarkerStream(self._client, seat.room_id, viewer=f"seat {seat.seat}", name=self._name)
            self._markers.wait_for_recorder(self._wait_s)
        self._agent.on_attached(seat)

    def on_event(self, event: pb.GameEvent) -> None:
        """Sends a marker."""
        if self._markers is not None:
            self._markers.push(event)
        self._agent.on_event(event)

    def on_snapshot(self, snapshot: pb.Snapshot) -> None:
        """Passes it on."""
        self._agent.on_snapshot(snapshot)

    def on_awaited(self, awaited: pb.Awaited) -> None:
        """Passes it on."""
        self._agent.on_awaited(awaited)

    def on_result(self, result: pb.AnswerResult) -> None:
        """Passes it on."""
        self._agent.on_result(result)

    def on_refused(self, refused: pb.Refused) -> None:
        """Passes it on."""
        self._agent.on_refused(refused)

    def on_game_over(self, result: SeatResult) -> None:
        """Passes it on."""
        self._agent.on_game_over(result)

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """Passes it on."""
        self._agent.on_seat_lost(error)

    def close(self, linger_s: float = 0.0) -> None:
        """Closes the stream."""
        if self._markers is not None:
            self._markers.close(linger_s)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.lsl",
        description="Sends the events of a room as markers to the Lab Streaming Layer, until the game is over.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    join_options.add_server_options(parser, required=True)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--room", metavar="ID|CODE", help="watch this room, by its id or join code, as a spectator")
    where.add_argument(
        "--study", metavar="ID", help="watch a participant's games in this study; needs its owner's token as --secret"
    )
    where.add_argument("--ticket", help="play this seat, and send what it sees; see --agent")
    parser.add_argument("--participant", metavar="N", type=int, help="with --study: the number of the participant, from 1")
    parser.add_argument("--agent", default="random", help="with --ticket: 'random', or module:Class of an Agent (default: random)")
    parser.add_argument("--name", default=NAME, help=f"name of the stream (default: {NAME})")
    parser.add_argument("--wait", action="store_true", help="send nothing until something records the stream")
    options = parser.parse_args(arguments)
    wait_s = pylsl.FOREVER if options.wait else 0.0
    if (options.study is None) != (options.participant is None):
        parser.error("give --study and --participant together")
    server = join_options.server_of(options)
    # Secrets are 96 digits, of which the first 32 are the id of what they are of.
    owner = next((secret for secret in server.secrets if secret.startswith(options.study or "?")), "")
    if options.study is not None and not owner:
        parser.error("--study needs the token of the study's owner: --secret OWNER-TOKEN")

    def run() -> int:
        # The ticket shows a private room, whose clock is read.
        with Client(server, secrets=[options.ticket] if options.ticket else []) as client:
            if options.ticket is not None:
                return play(client, options.ticket, options.agent, options.name, wait_s)
            if options.study is not None:
                return watch_participant(client, options.study, owner, options.participant, options.name, wait_s)
            return watch(client, options.room, options.name, wait_s)

    return exit_code(run, as_json=False)


def watch(client: Client, room: str, name: str, wait_s: float) -> int:
    """Sends the events of a room as a spectator sees them. Returns the exit code."""
    is_id = len(room) == 32
    room_id = client.rooms.get(room if is_id else "", join_code="" if is_id else room).room_id
    markers = MarkerStream(client, room_id, name=name)
    say(markers)
    markers.wait_for_recorder(wait_s)
    for event in client.rooms.watch(room_id):
        markers.push(event)
    markers.close(LINGER_S)
    print("the game is over", file=sys.stderr)
    return 0


def watch_participant(client: Client, study_id: str, owner_token: str, number: int, name: str, wait_s: float) -> int:
    """Sends the events of a participant's games as one stream, from the one played now to the last. Returns the exit code."""
    source = f"chefshat {study_id} participant {number}"
    markers: MarkerStream | None = None
    known: set[str] = set()
    games = 0
    while (game := next_game(client, study_id, owner_token, number, known)) is not None:
        try:
            if markers is None:
                markers = MarkerStream(client, game.room_id, name=name, source=source)
                say(markers)
                markers.wait_for_recorder(wait_s)
            else:
                markers.continue_with(game.room_id)
        except ChefsHatError as error:
            if error.reason != "ROOM_UNKNOWN":
                raise
            # The room is just being created, or the server has already removed it.
            if game.ended == pb.ROOM_STATE_UNSPECIFIED:
                known.discard(game.room_id)
                time.sleep(ROOM_INTERVAL_S)
            continue
        for event in client.rooms.watch(game.room_id):
            markers.push(event)
        games += 1
        print(f"game {games} of participant {number} is over", file=sys.stderr, flush=True)
    if markers is not None:
        markers.close(LINGER_S)
    print(f"participant {number} has finished", file=sys.stderr)
    return 0


def next_game(client: Client, study_id: str, owner_token: str, number: int, known: set[str]) -> pb.StudyGame | None:
    """Waits for a game of a participant that is not known, and adds it to those that are. Returns None at the end of the study.

    The first time, those that are over are known.
    """
    over = (
        pb.STUDY_PARTICIPANT_STATE_COMPLETED,
        pb.STUDY_PARTICIPANT_STATE_WITHDRAWN,
        pb.STUDY_PARTICIPANT_STATE_REMOVED,
        pb.STUDY_PARTICIPANT_STATE_SCREENED_OUT,
        pb.STUDY_PARTICIPANT_STATE_LEFT_OVER,
    )
    is_first = not known
    print(f"waiting for a game of participant {number}", file=sys.stderr, flush=True)
    for participant in client.studies.follow(study_id, owner_token):
        if participant.number != number:
            continue
        for game in participant.games:
            if game.room_id not in known:
                known.add(game.room_id)
                if not (is_first and game.ended):
                    return game
        is_first = False
        if participant.state in over:
            return None
    return None


def play(client: Client, ticket: str, agent: str, name: str, wait_s: float) -> int:
    """Plays a seat and sends the events that it sees. Returns the exit code."""
    marked = MarkedAgent(make_agent(agent, None), client, name=name, wait_s=wait_s)
    client.play(marked, ticket, options=chefshat.PlayOptions(delivery=pb.EVENT_DELIVERY_AT_ONCE))
    marked.close(LINGER_S)
    return 0


def say(markers: MarkerStream) -> None:
    """Prints what the stream is."""
    error_ms = markers.clock.reading.error * 1e3
    print(f"sending markers as {markers.source!r}; the server's clock is known to {error_ms:.1f} ms", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
