"""The local server: finding the program, the error without it, and stopping with the process."""

import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from waiting import LIMIT_S

import chefshat
from chefshat import ChefsHatError, LocalServer, local_server
from chefshat.local_server import BINARY

SOURCE = str(Path(chefshat.__file__).parents[1])

# Prints the address and the process id of the shared server, then ends in a given way.
ORPHAN = """
import os, signal, sys
import chefshat
from chefshat import local_server

address = local_server.shared_address()
assert local_server.shared_address() == address
with chefshat.VectorEnv("local") as env:
    assert env.server.address == address
env = chefshat.make(address="local")
assert env.unwrapped.vector.server.address == address
env.reset()
print(address, local_server._shared._process.pid, flush=True)
if sys.argv[1] == "kill":
    os.kill(os.getpid(), signal.SIGKILL)
if sys.argv[1] == "raise":
    raise KeyboardInterrupt
"""

# Waits for and prints the number of streaming calls while an environment and two streams of responses are open, of which a thread
# reads one, and when the interpreter ends.
LEFT_OPEN = """
import atexit, gc, threading, time

def show(when, number):
    while sum(isinstance(it, _MultiThreadedRendezvous) for it in gc.get_objects()) != number:
        time.sleep(0.01)
    print(when, number, flush=True)

# First, so called last.
atexit.register(show, "left:", 0)
import chefshat
from grpc._channel import _MultiThreadedRendezvous

env = chefshat.make(address="local")
env.reset()
client = chefshat.Client(env.unwrapped.vector.server)
events = client.rooms.watch(client.rooms.create(seats=["random"] * 4).room.room_id)
next(events)
waiting = client.rooms.watch(client.rooms.create().room.room_id)
threading.Thread(target=next, args=(waiting,), daemon=True).start()
show("open:", 3)
"""


def program(path: Path, text: str) -> Path:
    """A program that is a shell script."""
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Hides the program; returns an empty folder that is the only one on the PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.delenv(BINARY, raising=False)
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(local_server, "_cargo_targets", list)
    # As if the package chefshat-server were not installed.
    monkeypatch.setitem(sys.modules, "chefshat_server", None)
    monkeypatch.setattr(local_server, "_shared", None)
    return folder


def test_the_program_is_searched_in_this_order(nowhere: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = (program(tmp_path / name, "exit 0") for name in ("release", "debug"))
    os.utime(old, (1, 1))
    monkeypatch.setattr(local_server, "_cargo_targets", lambda: [old, new, tmp_path / "not there"])
    assert local_server.find_binary() == new
    on_the_path = program(nowhere / "chefshat", "exit 0")
    assert local_server.find_binary() == on_the_path
    installed = program(tmp_path / "installed", "exit 0")
    monkeypatch.setitem(sys.modules, "chefshat_server", SimpleNamespace(find_binary=lambda: installed))
    assert local_server.find_binary() == installed
    named = program(tmp_path / "mine", "exit 0")
    monkeypatch.setenv(BINARY, str(named))
    assert local_server.find_binary() == named


def test_a_missing_program_is_reported_with_a_remedy(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    makers: list[Callable[[], object]] = [
        LocalServer,
        lambda: chefshat.VectorEnv("local"),
        lambda: chefshat.make("vector", address="local"),
    ]
    for make in makers:
        with pytest.raises(ChefsHatError, match=rf"BINARY_MISSING.*pip install.*{BINARY}.*cargo build.*address"):
            make()
    monkeypatch.setenv(BINARY, "/no/such/program")
    with pytest.raises(ChefsHatError, match=rf"{BINARY} names /no/such/program"):
        LocalServer()


def test_a_program_that_does_not_serve_is_reported_with_its_output(tmp_path: Path) -> None:
    for text, says in [("echo 'no such option' >&2; exit 2", "no such option"), ("exec true", "did not start listening")]:
        with pytest.raises(ChefsHatError, match=says) as refused:
            LocalServer(program(tmp_path / "wrong", text)).start()
        assert refused.value.reason == "SERVER_DID_NOT_START"
    with pytest.raises(ChefsHatError, match="cannot be started"):
        LocalServer(tmp_path).start()


def test_builds_are_found_in_the_checkout() -> None:
    found = [path.relative_to(Path(__file__).resolve().parents[3]) for path in local_server._cargo_targets()]
    assert found == [Path("target/release/chefshat"), Path("target/debug/chefshat")]


def test_an_installed_package_finds_the_checkout_of_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "__file__", str(tmp_path / "site-packages" / "chefshat" / "local_server.py"))
    checkout = tmp_path / "checkout"
    within = checkout / "docs" / "images"
    within.mkdir(parents=True)
    monkeypatch.chdir(within)
    (checkout / "Cargo.toml").touch()
    # Another cargo project.
    assert local_server._cargo_targets() == []
    (checkout / "proto" / "chefshat").mkdir(parents=True)
    assert local_server._cargo_targets() == [checkout / "target/release/chefshat", checkout / "target/debug/chefshat"]


@pytest.mark.server
def test_a_server_can_be_stopped_and_started_again(real_binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Settings of the user's own server must not affect this one.
    monkeypatch.setenv("CHEFSHAT_DATA_DIR", "/no/such/folder")
    with LocalServer(real_binary) as server:
        address = server.address
        assert server.running
        os.kill(server.pid, 0)  # Raises an error if there is no such process.
        with chefshat.Client(address) as client:
            assert client.server_info().built_in_agents
        server.kill()
        assert not server.running
        with pytest.raises(ValueError, match="not been started"):
            _ = server.pid
        assert server.start().address == address
        with chefshat.Client(address) as client:
            assert client.server_info().built_in_agents
    assert not server.running
    server.stop()


@pytest.mark.server
@pytest.mark.usefixtures("real_binary")
@pytest.mark.parametrize("way", ["return", "raise", "kill"])
def test_the_shared_server_stops_with_its_process(way: str) -> None:
    environment = {**os.environ, "PYTHONPATH": SOURCE}
    done = subprocess.run([sys.executable, "-c", ORPHAN, way], capture_output=True, text=True, timeout=LIMIT_S, env=environment)
    codes = {"return": 0, "kill": -signal.SIGKILL}
    assert done.returncode == codes.get(way, done.returncode)
    _, process = done.stdout.split()
    # The server's parent has ended, so the test can only wait for its absence.
    watch = f"while kill -0 {process} 2>/dev/null; do sleep 0.05; done"
    subprocess.run(["sh", "-c", watch], check=True, timeout=LIMIT_S)


@pytest.mark.server
@pytest.mark.usefixtures("real_binary")
def test_no_call_is_left_when_the_interpreter_ends() -> None:
    """Deleting one then can wait for ever, if a thread of gRPC was stopped at the wrong moment."""
    environment = {**os.environ, "PYTHONPATH": SOURCE}
    done = subprocess.run([sys.executable, "-c", LEFT_OPEN], capture_output=True, text=True, timeout=LIMIT_S, env=environment)
    assert (done.stdout.split(), done.stderr) == (["open:", "3", "left:", "0"], "")


def test_the_package_of_the_server_finds_its_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Not imported, so that other tests do not find it installed.
    source = Path(__file__).parents[1] / "server" / "src" / "chefshat_server" / "__init__.py"
    spec = importlib.util.spec_from_file_location("chefshat_server", source)
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)
    scripts = tmp_path / "scripts"
    scripts.mkdir()
    monkeypatch.setattr("sysconfig.get_path", lambda name, scheme=None: str(scripts if scheme is None else tmp_path))
    with pytest.raises(FileNotFoundError, match=f"none of {scripts}.*pip install"):
        package.find_binary()
    (scripts / "chefshat").touch()
    with pytest.raises(FileNotFoundError):
        package.find_binary()
    executable = program(scripts / "chefshat", "exit 0")
    assert package.find_binary() == executable
