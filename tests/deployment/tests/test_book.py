"""Every command in the book is run as it is written, but for names, ports and printed values, or has a reason here why it is not.

That all commands have options that exist is checked where they are parsed: `server/lab/src/documents.rs`,
`clients/python/tests/test_book.py`, those of `clients/paper` and `clients/robot`, `tests/xtask/src/main.rs`.
"""

import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from certificates import PATIENCE_S
from chefshat.local_server import BINARY
from machine import Machine, copied, finished

ROOT = Path(__file__).resolve().parents[3]
PAGES = ["README.md", "proto/README.md", *(f"docs/{page.name}" for page in sorted((ROOT / "docs").glob("*.md")))]

#: Pages whose commands another test types, which names the page.
TYPED_BY = {
    "docs/access.md": "tests/deployment/tests/test_friends.py",
    "docs/pictures.md": "server/lab/tests/cli/render.rs",
    "docs/releases.md": "tests/deployment/tests/test_release.py",
}

#: Pages whose commands take long, and why.
SLOW = {
    "docs/benchmark.md": "thousands of games; a few of each task are played in server/lab/tests/cli/bench.rs",
    "docs/index.md": "cameras, people and a robot play a Shift; so they do in clients/robot/tests/test_rehearsal.py",
}

#: What sets up a machine: `cargo xtask test` has done it.
SET_UP = re.compile(r"(cargo (build|install|xtask)|pip install|python3[.\d]* -m venv|npm ci|cd clients/|apt-get install|cmake) ?")

#: Commands that are not run, and why.
NOT_RUN = {
    r"sudo |docker |chefshat config \| sudo": "needs root or containers; test_images.py plays in the images",
    r"protoc ": "CMake runs it for the agent in C++",
    r"build/agent ": "built for the tests in Rust; tests/tests/system/languages.rs plays with it",
    r"(CHEFSHAT_TICKET=TICKET )?node agent\.js ": "clients/node/tests plays with it, also with tickets",
    r"cargo run -p chefshat-client --example |cargo test ": "a build of its own; the system tests run the SDK",
    r"npx @modelcontextprotocol/inspector ": "fetches the inspector; tests/tests/system/mcp_http.rs has another client",
    r"chefshat (agent|tournament join --agent) llm ": "needs a server of language models; tests/tests/system/llm.rs scripts one",
    r"chefshat check-agent ": "agent.py is the reader's; tests/tests/system/examiner.rs examines agents",
    r"chefshat bench (submit|run .* --name )": "agents of the reader; clients/python/tests/test_benchmark.py runs the page's",
    r"chefshat bench pool ": "twelve minutes; server/lab/tests/cli/bench.rs has a short one",
    r"chefshat (play|watch) |cargo run -- play": "needs a terminal; tests/tests/system/terminal.rs has one",
    r"chefshat table --ticket TICKET$": "needs a person who types; tests/tests/system/attendant.rs",
    r"chefshat-robot (calibrate|bridge|perceive 0)": "needs a camera",
    r"chefshat-robot perceive --replay recording": "a recording of a camera",
    r"chefshat-robot robot .*--driver ros2": "needs ROS 2; clients/robot/tests has a peer that speaks its protocol",
    r"chefshat-robot wizard ": "needs NAOqi; clients/robot/tests has a peer that speaks its protocol",
    r"chefshat-robot affect ": "needs a network of Lab Streaming Layer; clients/robot/tests",
    r"python -m chefshat\.lsl ": "needs a network of Lab Streaming Layer; clients/python/tests",
    r"python (-m chefshat(\.learn|_paper\.(learn|experiments))|benchmarks/) ?": "minutes to hours; tests of both have short ones",
    r"(RAY_ADDRESS=auto )?python clients/python/samples/cluster/": "needs Ray, with older dependencies: see CONTRIBUTING.md",
    r"~/club/bin/|python -m chefshat_paper\.players_club ": "needs ChefsHatGym 2; clients/paper/tests has such players",
    r"for (seed|target) in |done(; done)?$": "half an hour or more",
    r"chefshat compare (trained|new|begun|seed|deep_q)": "networks learned for minutes or hours",
    r"chefshat compare monte_carlo:\S+ (greedy|trained) --seats one": "minutes; server/lab/tests/cli/compare.rs has short ones",
    r"chefshat participant delete P07 --data-dir": "the server would have to be stopped; server/lab/tests/cli/participant.rs",
    r"target/debug/chefshat render .*\.mp4": "needs ffmpeg; server/lab/tests/cli/render.rs makes films",
    r"chefshat admin disconnect 17": "the number of a connection; tests/tests/system/operator.rs",
    r"chefshat import table-3\.csv|chefshat records import table-3": "the reader's table; server/record/tests has the page's",
    r"chefshat verify game\.jsonl --key ": "a key of the reader; server/lab/tests/cli/verify.rs",
    r"chefshat tournament table ": "needs a game at a physical table; tests/tests/system/tournament_tables.rs",
    r"chefshat-robot rehearse( --people 2 --(shifts 1 --mistakes|open)|$)": "minutes; docs/index.md has one that is run",
    r"chefshat-robot robot --code JOIN-CODE --name Pepe --referee ": "needs a game at a physical table; clients/robot/tests",
    r"chefshat-robot robot --address .*--driver simulated": "a simulated robot moves as slowly as a real one; clients/robot/tests",
    r"chefshat-robot table shift|chefshat-robot perceive shift": "minutes of video; clients/robot/tests has shorter ones",
    r"chefshat serve --metrics-listen |curl http://127\.0\.0\.1:9464/": "a port that may be taken; tests/tests/system/observing.rs",
    r"chefshat study ": "a study to its end; server/lab/tests/cli/study.rs",
    r"chefshat serve --database|chefshat migrate |create(user|db) ": "needs PostgreSQL; test_cluster.py has it",
    r"cargo run --release -p chefshat-cluster ": "a build of its own",
}

#: Commands that end with a game or tournament, while the page goes on.
BESIDE_OTHERS = re.compile(r"chefshat tournament join |.* --tournament ")
SERVE = re.compile(r"(chefshat|target/debug/chefshat|cargo run --) serve\b")
CODE = "JOIN-CODE"


def commands(page: str) -> list[str]:
    """The commands of a page in order, without comments."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [command for line in lines if (command := re.sub(r"(^|\s)#.*", "", line).strip())]


def reason(command: str) -> str | None:
    """Why a command is not run here."""
    if SET_UP.match(command):
        return "set up before the tests"
    return next((why for pattern, why in NOT_RUN.items() if re.match(pattern, command)), None)


RUN = [page for page in PAGES if page not in TYPED_BY and any(reason(command) is None for command in commands(page))]


class Reader:
    """Somebody who types the commands of a page, at a machine with the program, a server and the record of a game."""

    def __init__(self, machine: Machine, server: Machine) -> None:
        self.machine = machine
        self.server = server
        self.beside: list[subprocess.Popen[str]] = []
        self.new_code = ""
        self.exported = ""

    def serve(self, command: str) -> None:
        """Starts a server in place of the one before, with its data."""
        self.server.leave()
        process = self.server.start(command.replace("0.0.0.0:50051", "127.0.0.1:0"))
        assert process.stdout is not None
        printed = []
        for line in process.stdout:
            printed.append(line)
            if "listening" in line:
                break
        url = copied(r"(http://127\.0\.0\.1:\d+)", "".join(printed))
        self.machine.environment["CHEFSHAT_SERVER"] = url
        self.machine.values |= {"http://127.0.0.1:50051": url, "127.0.0.1:50051": url.removeprefix("http://")}

    def code(self, command: str) -> str:
        """The join code that was printed last, or of a game that begins when somebody joins."""
        if not self.new_code and "--tournament" in command:
            made = "tournament create --name cup --format swiss --rounds 1 --target-shifts 1 --built-in random*3 --start-when 4"
            self.note(self.machine.type(f"chefshat {made}"))
        elif not self.new_code:
            self.note(self.machine.type("chefshat room create --seat greedy --seat random --seat random --target-shifts 1"))
        code, self.new_code = self.new_code, ""
        return code

    def wait_for_participant(self, name: str) -> None:
        """Waits until somebody has joined the tournament that was created last."""
        give_up_at = time.monotonic() + PATIENCE_S
        while name not in self.machine.type("chefshat tournament results TOURNAMENT-ID"):
            assert time.monotonic() < give_up_at

    def note(self, output: str) -> None:
        """Keeps what later commands need of an output."""
        for name, pattern in {
            "ROOM-ID": r"room +(\w{32})",
            "TOURNAMENT-ID": r"tournament +(\w{32})",
            "TICKET": r"ticket +(\S+)",
        }.items():
            if match := re.search(pattern, output):
                self.machine.values[name] = match[1]
        if match := re.search(r"join code +(\w{8})", output):
            self.new_code = match[1]

    def type(self, command: str) -> None:
        """Types a command, as it is written but for what is different at this machine."""
        if command.startswith("export "):
            self.exported += f"{command}\n"
            self.machine.type(self.exported)
            return
        if SERVE.match(command):
            self.serve(self.exported + command)
            return
        if re.match(r"chefshat (admin|records prune) ", command) and "CHEFSHAT_TOKEN" not in self.machine.environment:
            made = self.server.type("chefshat token create --role admin")
            self.machine.environment["CHEFSHAT_TOKEN"] = copied(r"(chefshat_\w{8}_\S+)", made)
        if "P07" in command and "P07" not in self.machine.values:
            self.machine.type(f"chefshat agent random --name P07 --code {self.code('')}")
            self.machine.values["P07"] = "P07"
        if "ROOM-ID" in command and "ROOM-ID" not in self.machine.values:
            self.code("")
        if CODE in command:
            command = command.replace(CODE, self.code(command))
        if re.match(r"chefshat-robot (rehearse|robot) (?!.*--(address|list-drivers))", command + " "):
            command += f" --address {self.machine.values['127.0.0.1:50051']}"
        if command.startswith("chefshat participant delete "):
            command += " --yes"  # Asked at a terminal.
        if BESIDE_OTHERS.match(command):
            self.beside.append(self.machine.start(self.exported + command))
            self.wait_for_participant(copied(r"--name (\w+)", command))
            return
        self.note(self.machine.type(self.exported + command))


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The record of a game."""
    if BINARY not in os.environ:
        pytest.skip(f"{BINARY} is not set: name the chefshat binary")
    machine = Machine(tmp_path_factory.mktemp("demo") / "demo", {})
    machine.type("chefshat demo --data-dir data")
    (record,) = (machine.folder / "data/records").iterdir()
    return record


@pytest.fixture
def reader(tmp_path: Path, record: Path) -> Iterator[Reader]:
    """A reader with a server and its data directory."""
    values = {"cargo run --": "chefshat", "target/debug/chefshat": "chefshat"}
    values |= {"DIR": "./chefshat-data", "NEW": "./restored", "/backups/": "./", "GAME-ID": record.stem}
    machine = Machine(tmp_path / "reader", values, {"CHEFSHAT_DATA_DIR": "chefshat-data"})
    server = Machine(machine.folder, dict(values), {"CHEFSHAT_DATA_DIR": "chefshat-data", "CHEFSHAT_LISTEN": "127.0.0.1:0"})
    reader = Reader(machine, server)
    shutil.copy(record, machine.folder / "game.jsonl")
    for folder in (machine.folder / "records", machine.folder / "chefshat-data/records"):
        folder.mkdir(parents=True)
        shutil.copy(record, folder)
    (machine.folder / "my_module.py").write_text("import chefshat\n\n\nclass Hasty(chefshat.RandomAgent):\n    pass\n")
    reader.serve("chefshat serve --access open --allow-import")
    machine.type("chefshat records import game.jsonl")
    yield reader
    machine.leave()
    server.leave()


@pytest.mark.parametrize("page", [pytest.param(page, marks=pytest.mark.slow) if page in SLOW else page for page in RUN])
def test_the_commands_of_a_page_run(page: str, reader: Reader) -> None:
    for command in commands(page):
        if reason(command) is None:
            reader.type(command)
    for process in reader.beside:
        finished(process)


def test_a_page_that_another_test_types_is_named_there() -> None:
    for page, test in TYPED_BY.items():
        assert Path(page).name in (ROOT / test).read_text(encoding="utf-8")


def test_every_reason_is_needed_and_names_files_that_exist() -> None:
    """No reason is left from commands that are gone."""
    written = [command for page in PAGES if page not in TYPED_BY for command in commands(page)]
    for pattern in NOT_RUN:
        assert any(re.match(pattern, command) for command in written), pattern
    for path in re.findall(r"[\w/]+/[\w./]+", " ".join(NOT_RUN.values())):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("backup_fails", [True, False])
def test_old_backups_are_deleted_only_after_a_new_one(tmp_path: Path, backup_fails: bool) -> None:
    page = (ROOT / "docs/operating.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^15 3 \* \* \* chefshat (.*)$", page, re.MULTILINE)
    old = tmp_path / "2026-01-01"
    old.mkdir()
    os.utime(old, (0, 0))
    program = tmp_path / "bin/chefshat"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\nexit {int(backup_fails)}\n")
    program.chmod(0o755)
    command = line.replace("\\%", "%").replace("/var/backups/chefshat", str(tmp_path))
    subprocess.run(["sh", "-c", command], env={"PATH": f"{program.parent}:{os.environ['PATH']}"}, timeout=PATIENCE_S)
    assert old.exists() == backup_fails


def test_no_index_is_asked_for_our_packages() -> None:
    """A stranger may have registered their names there: files and folders are installed, and their names are not looked up."""
    readmes = [*(ROOT / "clients").glob("*/README.md"), *(ROOT / "clients/python").glob("*/README.md")]
    for page in [*(ROOT / page for page in PAGES), *readmes]:
        text = page.read_text(encoding="utf-8")
        assert "--find-links" not in text, page
        for line in re.findall(r"pip install ([^\n`&]*)", text):
            assert not re.search(r"(?<![\w./-])chefshat(?!gym)[\w-]*\b", line), f"{page}: {line}"


def test_no_command_is_hidden_in_a_block_of_another_language() -> None:
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        assert not re.findall(r"^```(?:bash|shell|console|zsh)?\n(?:\$ )?(?:chefshat|cargo|python|pip)\b", text, re.MULTILINE), page
