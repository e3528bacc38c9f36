"""`chefshat-robot affect`: forwards what analysers of faces and voices read to the game, as expressions of its seats.

Analysers send lines of JSON to a socket, or a stream of Lab Streaming Layer. How a reading looks as JSON is in `wire`.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from typing import Any

from chefshat import ChefsHatError, aio, pb
from chefshat.join_options import add_server_options, server_of

from chefshat_robot import wire
from chefshat_robot.cli import CommandError
from chefshat_robot.drivers.driver import LOG, Affect, RobotError, require
from chefshat_robot.running import SERVER, run_command

DESCRIPTION = """\
Forwards what analysers of faces and voices read, as expressions of the people's seats, recorded with the game.

Examples:
  chefshat-robot affect --ticket 0=TICKET --ticket 2=TICKET --listen 127.0.0.1:7701
  chefshat-robot affect --ticket 0=TICKET --lsl type=Affect --record-only

A line on the socket, or a sample of a text stream, is a JSON object, all fields but the label optional:
  {"label": "joy", "valence": 0.8, "arousal": 0.5, "dominance": 0, "confidence": 0.9, "source": "face", "seat": 0, "taken_at": 1763712000.5}
A stream of numbers needs channels labelled valence, arousal, dominance or confidence; its name is the expression's label. A bad line
is answered with {"error": "..."}.
"""  # noqa: E501
SOURCES = {
    "face": pb.EXPRESSION_SOURCE_FACE,
    "voice": pb.EXPRESSION_SOURCE_VOICE,
    "self_report": pb.EXPRESSION_SOURCE_SELF_REPORT,
    "model": pb.EXPRESSION_SOURCE_MODEL,
}
# A seat may send 10,000 expressions in a game.
INTERVAL_S = 1.0
# Seconds for one look for streams, and for one wait for a sample.
RESOLVE_S = 1.0
SAMPLE_S = 0.5


class Forwarder:
    """Sends readings as expressions of the seats whose tickets it has."""

    def __init__(
        self, client: aio.Client, tickets: Mapping[int | None, str], *, record_only: bool = False, interval_s: float = INTERVAL_S
    ) -> None:
        """Sets the seats.

        Args:
            client: the connection to the server.
            tickets: the ticket of each seat; None as seat: for readings that name no seat.
            record_only: whether only the record has the expressions.
            interval_s: readings of a seat that follow the last one sent within so many seconds are dropped.
        """
        self._client = client
        self._tickets = tickets
        self._record_only = record_only
        self._interval_s = interval_s
        self._last: dict[int | None, float] = {}

    async def forward(self, affect: Affect) -> None:
        """Sends a reading, unless one of its seat was sent just before.

        Raises:
            WireError: there is no ticket for its seat.
            ChefsHatError: the server refused it.
        """
        ticket = self._tickets.get(affect.seat)
        if ticket is None:
            whose = "a reading without `seat`" if affect.seat is None else f"seat {affect.seat}"
            raise wire.WireError(f"no ticket for {whose}: give --ticket SEAT=TICKET")
        now = time.monotonic()
        last = self._last.get(affect.seat)
        if last is not None and now - last < self._interval_s:
            return
        self._last[affect.seat] = now
        await self._client.send_expression(ticket, expression_of(affect, record_only=self._record_only))


def expression_of(affect: Affect, *, record_only: bool = False) -> pb.Expression:
    """Converts a reading."""
    expression = pb.Expression(
        label=affect.label,
        valence=affect.valence,
        arousal=affect.arousal,
        dominance=affect.dominance,
        confidence=affect.confidence,
        source=SOURCES[affect.source],
        record_only=record_only,
    )
    if affect.taken_at is not None:
        expression.taken_at.FromNanoseconds(int(affect.taken_at * 1e9))
    return expression


async def serve_lines(forwarder: Forwarder, host: str, port: int, *, ready: Callable[[int], object] = lambda port: None) -> None:
    """Forwards lines of JSON from any number of connections, until cancelled.

    Args:
        forwarder: where to.
        host: the address to listen on.
        port: its TCP port; 0: a free one.
        ready: called with the port.
    """

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                try:
                    await forwarder.forward(wire.affect_from_json(wire.parse(line)))
                except (ValueError, ChefsHatError) as error:
                    writer.write(json.dumps({"error": str(error)}).encode() + b"\n")
                    await writer.drain()
        except (OSError, ValueError) as error:
            LOG.info("the connection to an analyser ended: %s", error)
        finally:
            writer.close()

    async with await asyncio.start_server(serve, host, port) as server:
        ready(server.sockets[0].getsockname()[1])
        await server.serve_forever()


async def forward_stream(forwarder: Forwarder, key: str, value: str) -> None:
    """Forwards a stream of Lab Streaming Layer, until cancelled. Bad samples are logged.

    Args:
        forwarder: where to.
        key: "name", "type" or "source_id".
        value: its value.
    """
    async for affect in stream_affects(key, value):
        try:
            await forwarder.forward(affect)
        except (ValueError, ChefsHatError) as error:
            LOG.warning("a reading was not sent: %s", error)


async def stream_affects(key: str, value: str) -> AsyncIterator[Affect]:
    """Iterates over the readings of a stream of Lab Streaming Layer; waits until there is such a stream.

    Raises:
        RobotError: the extra `lsl` is not installed, or the stream has none of the channels needed.
    """
    pylsl = require("pylsl", "lsl")
    found: list[Any] = []
    while not found:
        found = await asyncio.to_thread(pylsl.resolve_byprop, key, value, 1, RESOLVE_S)
    inlet = pylsl.StreamInlet(found[0], recover=True)
    info = await asyncio.to_thread(inlet.info)
    is_text = info.channel_format() == pylsl.cf_string
    labels = info.get_channel_labels() or []
    numbers = ("valence", "arousal", "dominance", "confidence")
    if not is_text and not set(labels) & set(numbers):
        raise RobotError(f"the stream {info.name()} has channels {labels}: it needs labels among {', '.join(numbers)}")
    LOG.info("reading the stream %s", info.name())
    try:
        while True:
            sample, stamp = await asyncio.to_thread(inlet.pull_sample, SAMPLE_S)
            if sample is None:
                continue
            # The stamp is by the sender's clock of Lab Streaming Layer.
            ago = pylsl.local_clock() - (stamp + await asyncio.to_thread(inlet.time_correction))
            try:
                if is_text:
                    message = wire.parse(sample[0])
                else:
                    read = {label: float(x) for label, x in zip(labels, sample, strict=True)}
                    # NaN says that the analyser does not know, for instance while it sees no face.
                    known = {name: x for name, x in read.items() if name in numbers and not math.isnan(x)}
                    if not known:
                        continue
                    message = {"label": info.name(), **known}
                yield wire.affect_from_json({"taken_at": time.time() - ago, **message})
            except ValueError as error:
                LOG.warning("ignored a sample of %s: %s", info.name(), error)
    finally:
        await asyncio.to_thread(inlet.close_stream)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    add_server_options(parser, default=SERVER)
    parser.add_argument(
        "--ticket",
        action="append",
        default=[],
        metavar="[SEAT=]TICKET",
        help="the ticket of a seat; without SEAT for readings that name none. Repeat it for several seats",
    )
    parser.add_argument("--listen", metavar="HOST:PORT", help="listen for lines of JSON")
    parser.add_argument("--lsl", metavar="KEY=VALUE", help="read a stream of Lab Streaming Layer: name=, type= or source_id=")
    parser.add_argument("--record-only", action="store_true", help="only for the record: nobody in the room sees them")
    interval_help = "send at most one reading of a seat in this time (default: %(default)g)"
    parser.add_argument("--interval", type=float, default=INTERVAL_S, metavar="SECONDS", help=interval_help)


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand until it is interrupted."""
    given = tickets(arguments.ticket)
    if not arguments.listen and not arguments.lsl:
        raise CommandError("give --listen HOST:PORT, --lsl KEY=VALUE, or both")

    async def forward() -> int:
        async with aio.Client(server_of(arguments)) as client:
            forwarder = Forwarder(client, given, record_only=arguments.record_only, interval_s=arguments.interval)
            async with asyncio.TaskGroup() as tasks:
                if arguments.listen:
                    host, _, port = arguments.listen.rpartition(":")
                    if not host or not port.isdigit():
                        raise CommandError(f"--listen {arguments.listen}: give HOST:PORT")
                    tasks.create_task(
                        serve_lines(forwarder, host, int(port), ready=lambda at: LOG.info("listening on port %d", at))
                    )
                if arguments.lsl:
                    key, _, value = arguments.lsl.partition("=")
                    if key not in ("name", "type", "source_id") or not value:
                        raise CommandError(f"--lsl {arguments.lsl}: give name=..., type=... or source_id=...")
                    tasks.create_task(forward_stream(forwarder, key, value))
        return 0

    return run_command(forward)


def tickets(given: Sequence[str]) -> dict[int | None, str]:
    """Parses SEAT=TICKET, or TICKET alone for readings that name no seat.

    Raises:
        CommandError: there is none, or a seat is not a number.
    """
    if not given:
        raise CommandError("give the ticket of at least one seat: --ticket SEAT=TICKET")
    parsed: dict[int | None, str] = {}
    for text in given:
        seat, separator, ticket = text.partition("=")
        if separator and not seat.isdigit():
            raise CommandError(f"{seat}=...: the seat of a ticket must be a number, from 0")
        parsed[int(seat) if separator else None] = ticket if separator else text
    return parsed
