"""A backup taken while a game is played, restored in another place after the server was killed."""

import json
import stat
import time
from pathlib import Path

from certificates import PATIENCE_S
from chefshat import Decision, RandomAgent, pb
from servers import GuardedServer, attempt, run

SHORT = pb.RuleSet(target_shifts=1)


class Disaster(RandomAgent):
    """Backs the server up at its fifth decision, and loses the server and its disk."""

    def __init__(self, server: GuardedServer, backup: Path) -> None:
        super().__init__(1)
        self._server, self._data, self._backup = server, server.data, backup
        self.copied: dict[str, object] = {}
        self.key = ""

    def decide(self, request: Decision) -> int:
        if request.decision_id == 5 and not self._backup.exists():
            self.copied = json.loads(run("backup", self._backup, "--data-dir", self._data, "--json").stdout)
            self._server.kill()
            lost = self._data.rename(self._data.with_name("lost"))
            self.key = run("key", "show", "--data-dir", lost).stdout.strip()
            restored = run("restore", self._backup, "--data-dir", self._data, "--json")
            assert json.loads(restored.stdout) == {"data_dir": str(self._data)} | {
                name: count for name, count in self.copied.items() if name != "backup"
            }
            assert lost.exists()
            self._server.start()
        return super().decide(request)


def test_a_game_resumes_from_a_backup_and_is_signed_by_the_same_key(server: GuardedServer, tmp_path: Path) -> None:
    data, backup = server.data, tmp_path / "backup"
    with server.client("host") as client:
        over = client.rooms.create("over", rules=SHORT, seats=["greedy"] * 4).room
        list(client.rooms.watch(over.room_id))
        # Its file is written after the game.
        deadline = time.monotonic() + PATIENCE_S
        while not (data / "records" / f"{over.game_id}.jsonl").exists():
            assert time.monotonic() < deadline, "the record of a finished game is never written"
            time.sleep(0.05)
        policy = pb.RoomPolicy(decision_time_ms=60_000)
        room = client.rooms.create("resumes", rules=SHORT, policy=policy, seats=[None, "greedy", "greedy", "greedy"])
        (data / "any-other-file").write_text("its content")
        agent = Disaster(server, backup)
        result = client.play(agent, client.rooms.join(room.join_code, "Ada").ticket)
        assert result.finished
        record = list(client.records.read(room.room.game_id))
    assert agent.copied == {"backup": str(backup), "finished_games": 1, "unfinished_games": 1, "records": 1}
    answered = [line.decision for line in record if line.HasField("decision") and line.decision.seat == result.seat]
    assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in answered)
    server.stop()
    names = {f"{over.game_id}.jsonl", f"{room.room.game_id}.jsonl"}
    assert {file.name for file in (data / "records").iterdir()} == names
    # One game was signed before, one after the server was restored: both by the same key.
    run("verify", data / "records", "--key", agent.key)

    copies = [backup, *backup.rglob("*")]
    assert {file.name for file in copies} >= {
        "games.sqlite3",
        "signing-key",
        "tokens.json",
        "any-other-file",
        f"{over.game_id}.jsonl",
    }
    assert "games.lock" not in {file.name for file in copies}
    assert [file for file in copies if stat.S_IMODE(file.stat().st_mode) & 0o077] == []


def test_nothing_is_overwritten_and_damaged_copies_are_refused(server: GuardedServer, tmp_path: Path) -> None:
    data, backup = server.data, tmp_path / "backup"
    run("backup", backup, "--data-dir", data)
    before = {file: file.read_bytes() for file in backup.rglob("*") if file.is_file()}
    again = attempt("backup", backup, "--data-dir", data)
    assert again.returncode == 1
    assert "exists already" in again.stderr
    assert before == {file: file.read_bytes() for file in backup.rglob("*") if file.is_file()}
    onto = attempt("restore", backup, "--data-dir", data)
    assert onto.returncode == 1
    assert "is not empty" in onto.stderr
    for name in ["games.sqlite3", "games.sqlite3-wal", "games.lock", "tokens.json.1.part", "any-other-file"]:
        target = tmp_path / f"has-{name}"
        target.mkdir()
        (target / name).write_bytes(b"keep")
        onto = attempt("restore", backup, "--data-dir", target)
        assert onto.returncode == 1, name
        assert f"it has {name}" in onto.stderr
        assert (target / name).read_bytes() == b"keep"

    database = backup / "games.sqlite3"
    good = database.read_bytes()
    middle = len(good) // 2
    for bad, reason in [
        (good[:middle] + bytes(4096) + good[middle + 4096 :], "damaged"),
        (good[: len(good) // 3], "damaged"),
        (b"SQLite? No." * 100, "not a database of chefshat"),
    ]:
        database.write_bytes(bad)
        refused = attempt("restore", backup, "--data-dir", tmp_path / "new")
        assert refused.returncode == 1, reason
        assert reason in refused.stderr
        assert not (tmp_path / "new").exists()
    nowhere = attempt("restore", tmp_path / "nowhere", "--data-dir", tmp_path / "new")
    assert nowhere.returncode == 1
    assert "`chefshat backup`" in nowhere.stderr
    missing = attempt("backup", tmp_path / "other", "--data-dir", tmp_path / "nowhere")
    assert missing.returncode == 1
    assert "nowhere" in missing.stderr
    assert not list(tmp_path.glob("other*"))
