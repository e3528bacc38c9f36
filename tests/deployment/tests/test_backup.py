"""A backup taken while a game is played, restored in another place after the server was killed."""

import json
import os
import stat
import subprocess
from pathlib import Path

import chefshat
from chefshat import Decision, RandomAgent, pb
from chefshat.local_server import LocalServer

SHORT = pb.RuleSet(target_shifts=1)


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs a command of the program."""
    return subprocess.run([os.environ["CHEFSHAT_BIN"], *arguments], capture_output=True, text=True, timeout=120)


class Disaster(RandomAgent):
    """Backs the server up at its fifth decision, and loses the server and its disk."""

    def __init__(self, server: LocalServer, data: Path, backup: Path) -> None:
        super().__init__(1)
        self._server, self._data, self._backup = server, data, backup
        self.copied: dict[str, object] = {}

    def decide(self, request: Decision) -> int:
        if request.decision_id == 5 and not self._backup.exists():
            done = run("backup", self._backup, "--data-dir", self._data, "--json")
            assert done.returncode == 0, done.stderr
            self.copied = json.loads(done.stdout)
            self._server.kill()
            lost = self._data.rename(self._data.with_name("lost"))
            restored = run("restore", self._backup, "--data-dir", self._data, "--json")
            assert restored.returncode == 0, restored.stderr
            assert json.loads(restored.stdout) == {"data_dir": str(self._data)} | {
                name: count for name, count in self.copied.items() if name != "backup"
            }
            assert lost.exists()
            self._server.start()
        return super().decide(request)


def test_a_game_resumes_from_a_backup_taken_while_it_was_played(server: LocalServer, tmp_path: Path) -> None:
    data, backup = tmp_path / "data", tmp_path / "backup"
    with chefshat.Client(server.address) as client:
        over = client.create_room("over", rules=SHORT, seats=["greedy"] * 4).room
        list(client.watch(over.room_id))
        policy = pb.RoomPolicy(decision_time_ms=60_000)
        room = client.create_room("resumes", rules=SHORT, policy=policy, seats=[None, "greedy", "greedy", "greedy"])
        (data / "any-other-file").write_text("its content")
        agent = Disaster(server, data, backup)
        result = client.play(agent, client.join_room(room.join_code, "Ada").ticket)
        assert result.finished
        record = list(client.record(room.room.game_id))
    assert agent.copied == {"backup": str(backup), "finished_games": 1, "unfinished_games": 1, "records": 1}
    answered = [line.decision for line in record if line.HasField("decision") and line.decision.seat == result.seat]
    assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in answered)
    server.stop()
    names = {f"{over.game_id}.jsonl", f"{room.room.game_id}.jsonl"}
    assert {file.name for file in (data / "records").iterdir()} == names
    verified = run("verify", data / "records")
    assert verified.returncode == 0, verified.stderr

    copies = [backup, *backup.rglob("*")]
    assert {file.name for file in copies} >= {"games.sqlite3", "any-other-file", f"{over.game_id}.jsonl"}
    assert "games.lock" not in {file.name for file in copies}
    assert [file for file in copies if stat.S_IMODE(file.stat().st_mode) & 0o077] == []


def test_nothing_is_overwritten_and_damaged_copies_are_refused(server: LocalServer, tmp_path: Path) -> None:
    data, backup = tmp_path / "data", tmp_path / "backup"
    assert run("backup", backup, "--data-dir", data).returncode == 0
    before = {file: file.read_bytes() for file in backup.rglob("*") if file.is_file()}
    again = run("backup", backup, "--data-dir", data)
    assert again.returncode == 1
    assert "exists already" in again.stderr
    assert before == {file: file.read_bytes() for file in backup.rglob("*") if file.is_file()}
    onto = run("restore", backup, "--data-dir", data)
    assert onto.returncode == 1
    assert "is not empty" in onto.stderr

    database = backup / "games.sqlite3"
    good = database.read_bytes()
    middle = len(good) // 2
    for bad, reason in [
        (good[:middle] + bytes(4096) + good[middle + 4096 :], "damaged"),
        (good[: len(good) // 3], "damaged"),
        (b"SQLite? No." * 100, "not a database of chefshat"),
    ]:
        database.write_bytes(bad)
        refused = run("restore", backup, "--data-dir", tmp_path / "new")
        assert refused.returncode == 1, reason
        assert reason in refused.stderr
        assert not (tmp_path / "new").exists()
    missing = run("backup", tmp_path / "other", "--data-dir", tmp_path / "nowhere")
    assert missing.returncode == 1
    assert not list(tmp_path.glob("other*"))
