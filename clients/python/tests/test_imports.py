"""What importing the package loads: names on first use, and no gRPC before a server is used."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import LIMIT_S

import chefshat

SOURCE = Path(chefshat.__file__).parents[1]

# Prints which of the modules named by the arguments a program has loaded.
LOADED = "\nimport sys\nprint(*sorted(name for name in sys.argv[1:] if name in sys.modules))"
# Makes importing gRPC fail as if it were not installed.
WITHOUT_GRPC = "import sys\nsys.modules['grpc'] = None\n"


def run(program: str, *arguments: str) -> str:
    """Runs a program in a fresh interpreter and returns its output."""
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(SOURCE)!r})\n{program}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_package_alone_loads_nothing_else() -> None:
    heavy = ("grpc", "numpy", "google.protobuf", "gymnasium", "asyncio", "chefshat.client", "chefshat.pb")
    assert run(f"import chefshat{LOADED}", *heavy) == ""


def test_every_name_is_there() -> None:
    for name in chefshat.__all__:
        assert getattr(chefshat, name) is not None
    assert set(chefshat.__all__) <= set(dir(chefshat))
    assert not hasattr(chefshat, "no_such_name")
    assert run("from chefshat import *; print(make.__module__, pb.__name__)") == "chefshat.making chefshat.pb"


def test_what_needs_no_server_needs_no_grpc() -> None:
    modules = [
        "agents",
        "batch",
        "columns",
        "decision",
        "errors",
        "files",
        "local_server",
        "masks",
        "replay",
        "result",
        "transitions",
    ]
    imports = "".join(f"import chefshat.{module}\n" for module in modules)
    assert run(f"{WITHOUT_GRPC}{imports}print(chefshat.sample_legal.__name__)") == "sample_legal"
    assert run(f"{imports}{LOADED}", "grpc", "numpy") == "numpy"


def test_environments_in_this_process_need_no_grpc() -> None:
    pytest.importorskip("chefshat_native")
    pytest.importorskip("pettingzoo")
    program = """
import chefshat
from chefshat.envs import chefshat_v1
with chefshat.VectorEnv(games=2, transitions=True, seed=1) as env:
    batch = env.step(env.batch.masks.argmax(axis=1))
    print(len(batch))
env = chefshat.make(opponents="greedy", render_mode="ansi")
_, info = env.reset(seed=1)
env.step(int(info["action_mask"].argmax()))
assert "hand" in env.render()
many = chefshat.make("gymnasium_vector", num_envs=2)
many.step(many.reset(seed=1)[1]["action_mask"].argmax(axis=1))
everyone = chefshat_v1.env()
everyone.reset(seed=1)
everyone.step(int(everyone.last()[0]["action_mask"].argmax()))
try:
    chefshat.VectorEnv("127.0.0.1:1")
except ImportError as error:
    print(error)
"""
    stepped, refused = run(WITHOUT_GRPC + program).splitlines()
    assert stepped == "2"
    assert "pip install grpcio" in refused


def test_packages_built_on_this_one_are_not_imported() -> None:
    importing = re.compile(r"^\s*(import|from) chefshat_(paper|robot)\b", re.MULTILINE)
    files = Path(chefshat.__file__).parent.rglob("*.py")
    assert [path for path in files if importing.search(path.read_text(encoding="utf-8"))] == []


def test_what_needs_a_server_says_what_to_install() -> None:
    program = "import chefshat\ntry:\n    chefshat.Client\nexcept ImportError as error:\n    print(error)"
    assert "pip install grpcio" in run(WITHOUT_GRPC + program)


def test_gymnasium_finds_the_environments_by_name() -> None:
    pytest.importorskip("gymnasium")
    pytest.importorskip("chefshat_native")
    program = """
import gymnasium
for make in (gymnasium.make, gymnasium.make_vec):
    print(make("chefshat.envs:chefshat/ChefsHat-v1").spec.id)
"""
    assert run(program).splitlines() == ["chefshat/ChefsHat-v1"] * 2
