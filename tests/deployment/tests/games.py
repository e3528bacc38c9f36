"""Games of agents in several languages, with tokens: they see how a server is reached, as their players do."""

import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest
from certificates import PATIENCE_S
from chefshat import Decision, RandomAgent, pb
from chefshat.local_server import clean_environment
from servers import GuardedServer


class Interrupting(RandomAgent):
    """Does something at certain decisions, while the others wait for its answer or play."""

    def __init__(self, at: dict[int, Callable[[], object]]) -> None:
        super().__init__(1)
        self._at = at

    def decide(self, request: Decision) -> int:
        interruption = self._at.pop(request.decision_id, None)
        if interruption is not None:
            interruption()
        return super().decide(request)


def play(server: GuardedServer, url: str, at: dict[int, Callable[[], object]]) -> list[pb.RecordLine]:
    """Plays a game of agents in Python, Rust and JavaScript, and watches it, all at a URL. Returns its record.

    Every program has a token of the lowest role that does.
    """
    node = os.environ.get("CHEFSHAT_NODE_DIR")
    if not node:
        pytest.skip("CHEFSHAT_NODE_DIR is not set: name the folder of the JavaScript agent with its modules")
    # Long time limits: the test is about lost decisions, not speed.
    policy = pb.RoomPolicy(decision_time_ms=60_000)
    with server.client("host", url) as host:
        room = host.rooms.create("deployed", rules=pb.RuleSet(target_shifts=3), policy=policy)
    # The clients are closed first, which ends the thread if the test fails.
    with ThreadPoolExecutor(1) as thread, server.client("player", url) as player, server.client("spectator", url) as spectator:
        ticket = player.rooms.join(room.join_code, "in-process").ticket
        watched = thread.submit(lambda: list(spectator.rooms.watch(room.room.room_id)))
        rust = [os.environ["CHEFSHAT_BIN"], "agent", "greedy", "--server", url, "--name", "rust"]
        python = [sys.executable, "-m", "chefshat.agent", "--address", url, "--name", "python"]
        javascript = ["node", "agent.js", "--address", url, "--name", "javascript"]
        environment = {name: os.environ[name] for name in ("CHEFSHAT_CA", "CHEFSHAT_PROTO")}
        processes = [
            subprocess.Popen(
                [*command, "--code", room.join_code],
                cwd=node,
                env=clean_environment() | environment | {"CHEFSHAT_TOKEN": server.tokens["player"]},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            for command in (rust, python, javascript)
        ]
        try:
            result = player.play(Interrupting(at), ticket)
            outputs = [process.communicate(timeout=PATIENCE_S)[0] for process in processes]
        finally:
            for process in processes:
                process.kill()
                process.wait()
        assert [process.returncode for process in processes] == [0, 0, 0], outputs
        assert result.finished
        assert not at, "not all interruptions happened"
        record = list(spectator.records.read(room.room.game_id))
        assert [event.sequence for event in watched.result(PATIENCE_S)] == [
            line.event.sequence for line in record if line.HasField("event")
        ]
        return record


def decisions_by_agents(record: list[pb.RecordLine]) -> bool:
    """Whether no decision was taken in an agent's place."""
    decisions = [line.decision for line in record if line.HasField("decision")]
    assert decisions
    return all(decision.source == pb.DECISION_SOURCE_AGENT for decision in decisions)


def disconnected(record: list[pb.RecordLine]) -> set[str]:
    """The names of those who lost their connection."""
    events = [line.event for line in record if line.HasField("event")]
    names = {event.seated.seat: event.seated.name for event in events if event.HasField("seated")}
    return {names[event.disconnected.seat] for event in events if event.HasField("disconnected")}
