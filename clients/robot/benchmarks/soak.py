"""Plays games at a synthetic table for a long time while everything fails now and then, and compares them with the truth.

    python benchmarks/soak.py --seconds 3600
    python benchmarks/soak.py --seconds 60 --seed 3 --json

At random times the server is killed and started again on its data, the bridge ends and another one begins in the middle of the
game, with a perception that knows nothing, and the camera is away for some seconds. People make mistakes and lay cards with their
backs up; questions are answered after a random time; a remote agent and a built-in one play along. A play of the record that is
not the truth (lost, doubled, other cards, another seat) is *wrong*; a game that does not end within its time is *hung*. The exit
status is 1 if there is one of either.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from chefshat import ChefsHatError, RandomAgent, aio, pb
from chefshat.local_server import find_binary

from chefshat_robot.bridge import Bridge
from chefshat_robot.deck import FACES
from chefshat_robot.rehearsal import Rehearsal
from chefshat_robot.synthetic import DIFFICULTIES, SyntheticTable
from chefshat_robot.vision import Perception
from chefshat_robot.vision.frames import Frame

PEOPLE = ("Ada", "Bo")
REMOTE = 2
BETWEEN_TROUBLES_S = (4.0, 20.0)
ANSWERED_AFTER_S = (0.0, 6.0)
AWAY_FRAMES = (15, 75)
GAME_LIMIT_S = 600.0


class Server:
    """A server of its own, which can be killed and started again on its data."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{free.getsockname()[1]}"
        self._command = [str(find_binary()), "serve", "--listen", self.address, "--data-dir", str(folder)]
        self._log = (folder / "soak.log").open("ab")
        self._process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(self._command, stdout=self._log, stderr=self._log)

    def restart(self) -> None:
        """Kills it and starts it again."""
        self.kill()
        self._process = self._start()

    def kill(self) -> None:
        """Kills it."""
        self._process.kill()
        self._process.wait()


class Eye:
    """The camera: frames one after the other, for one bridge after the other; now and then it is away."""

    def __init__(self, frames: Iterator[Frame]) -> None:
        self._frames, self._lock = frames, threading.Lock()
        self.away = 0

    def frames(self) -> Iterator[Frame]:
        """The frames from now on."""
        while True:
            with self._lock:
                for _ in range(self.away):
                    next(self._frames)
                self.away = 0
                frame = next(self._frames)
            yield frame


@dataclass
class Tally:
    """What happened in all games."""

    games: int = 0
    plays: int = 0
    questions: int = 0
    mistakes: int = 0
    troubles: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    hung: list[str] = field(default_factory=list)


async def play_game(server: Server, seed: int, tally: Tally) -> None:
    """Plays one game, with its troubles, and compares it with the truth."""
    chance = random.Random(f"soak {seed}")
    async with aio.Client(server.address) as client:
        people = [pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name=name) for name in PEOPLE]
        rules = pb.RuleSet(target_shifts=1)
        made = await client.rooms.create("soak", seats=[*people, None, "greedy"], rules=rules, physical=True)
        ticket = made.table_ticket
        remote = await client.rooms.join(made.join_code, "remote", seat=REMOTE)
        table = SyntheticTable([], DIFFICULTIES[chance.choice(["easy", "medium"])], seed=seed)
        rehearsal = Rehearsal(table, client.tables, ticket, seed=seed, mistakes=0.1, face_down=0.1, answers=False)
        eye = Eye(rehearsal.frames())
        bridge = Bridge(client.tables, ticket, Perception(table.camera, deck=0))
        over = asyncio.Event()

        async def after(frame: Frame) -> None:
            if bridge.state is not None:
                await rehearsal.step(bridge.state, frame.time)

        async def watch() -> None:
            nonlocal bridge
            while not over.is_set():
                running = asyncio.create_task(bridge.run(eye.frames(), after))
                ended = asyncio.create_task(again.wait())
                try:
                    await asyncio.wait([running, ended], return_when=asyncio.FIRST_COMPLETED)
                    if running.done():
                        running.result()
                        over.set()
                        return
                finally:
                    for task in (running, ended):
                        task.cancel()
                    await asyncio.gather(running, ended, return_exceptions=True)
                again.clear()
                bridge = Bridge(client.tables, ticket, Perception(table.camera, deck=0))

        async def answer() -> None:
            """Somebody on the page, who answers when it suits them."""
            answered: set[str] = set()
            while not over.is_set():
                with contextlib.suppress(ChefsHatError):
                    async for state in client.tables.watch(ticket):
                        for question in state.questions:
                            if question.question_id in answered:
                                continue
                            answered.add(question.question_id)
                            tally.questions += 1
                            await asyncio.sleep(chance.uniform(*ANSWERED_AFTER_S))
                            option = rehearsal.right_option(state, question)
                            given = pb.QuestionAnswered(question_id=question.question_id, option=option)
                            with contextlib.suppress(ChefsHatError):
                                await client.tables.report(ticket, pb.TableReport(source=pb.REPORT_SOURCE_ATTENDANT, answer=given))
                await asyncio.sleep(0.2)

        async def trouble() -> None:
            while not over.is_set():
                await asyncio.sleep(chance.uniform(*BETWEEN_TROUBLES_S))
                what = chance.choice(["server", "bridge", "camera"])
                tally.troubles[what] += 1
                if what == "server":
                    await asyncio.to_thread(server.restart)
                elif what == "bridge":
                    again.set()
                else:
                    eye.away = chance.randint(*AWAY_FRAMES)

        again = asyncio.Event()
        beside = [asyncio.create_task(work()) for work in (answer, trouble)]
        playing = asyncio.create_task(client.play(RandomAgent(seed), remote.ticket))
        try:
            async with asyncio.timeout(GAME_LIMIT_S):
                await watch()
                result = await playing
        except TimeoutError:
            tally.hung.append(f"game {seed}: {_waits_for(bridge.state)}")
            return
        finally:
            over.set()
            for task in (*beside, playing):
                task.cancel()
            await asyncio.gather(*beside, playing, return_exceptions=True)
        record = [line async for line in client.records.read(result.game_id)]
    tally.games += 1
    tally.mistakes += rehearsal.violations
    recorded = [
        (line.event.play.seat, Counter({line.event.play.face: line.event.play.quantity, FACES + 1: line.event.play.jokers}))
        for line in record
        if line.HasField("event") and line.event.HasField("play")
    ]
    laid = [(seat, Counter(card.face for card in cards)) for seat, cards in rehearsal.plays]
    tally.plays += len(laid)
    for number, (found, true) in enumerate(zip(recorded, laid, strict=False)):
        if found[0] != true[0] or +found[1] != +true[1]:
            tally.wrong.append(f"game {seed}, play {number}: recorded {found}, truly {true}")
            break
    if len(recorded) < len(laid) or any(seat < REMOTE for seat, _ in recorded[len(laid) :]):
        tally.wrong.append(f"game {seed}: {len(recorded)} plays recorded, {len(laid)} laid")


def _waits_for(state: pb.TableState | None) -> str:
    """What a table waits for."""
    if state is None:
        return "no state"
    asked = [f"{question.text} {list(question.options)}" for question in state.questions]
    to_lay = [wanted.text for wanted in state.to_lay]
    reported = [report.text for report in state.reports[-3:]]
    return f"{state.waiting_for}; paused: {state.paused}; asked: {asked}; to lay: {to_lay}; reported last: {reported}"


async def soak(arguments: argparse.Namespace) -> Tally:
    """Plays games until the time is over."""
    tally, until = Tally(), time.monotonic() + arguments.seconds
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder))
        try:
            seed = arguments.seed
            while time.monotonic() < until:
                await play_game(server, seed, tally)
                seed += 1
                print(f"{tally.games} games, {tally.plays} plays, {dict(tally.troubles)}", file=sys.stderr, flush=True)
        finally:
            server.kill()
    return tally


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0, help="games begin for so long (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the first game (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    arguments = parser.parse_args()
    tally = asyncio.run(soak(arguments))
    if arguments.json:
        print(json.dumps(vars(tally)))
    else:
        print(f"{tally.games} games, {tally.plays} plays, {tally.mistakes} mistakes, {tally.questions} questions")
        print(f"troubles: {dict(tally.troubles)}")
        for line in (*tally.wrong, *(f"hung: {hung}" for hung in tally.hung)):
            print(line)
    return 1 if tally.wrong or tally.hung else 0


if __name__ == "__main__":
    os.environ.setdefault("OPENCV_NUM_THREADS", "1")
    sys.exit(main())
