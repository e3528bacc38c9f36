"""What the tests of this package and of those built on it share: coroutines as tests, the real server and the settings of JAX.

A `conftest.py` imports it. Contains no tests.
"""

import asyncio
import inspect
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from real_server import RealServer

from chefshat.address import CA, TOKEN
from chefshat.join_options import TICKET
from chefshat.local_server import BINARY


def pytest_configure(config: pytest.Config) -> None:
    """Lets commands be interrupted. Shortens JAX's compilations, most of the time of the learning tests, and caches them."""
    # A shell that runs tests in the background has them, and the commands that they start, ignore interrupts.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # Not level 0: there, results depend on how many agents are computed together.
    os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=1 --xla_llvm_disable_expensive_passes=true")
    if config.pluginmanager.hasplugin("cacheprovider"):
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(config.cache.mkdir("jax")))
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuses tests that need the real server without their mark: `-m "not server"` would run them."""
    for item in items:
        if "real_binary" in getattr(item, "fixturenames", ()) and item.get_closest_marker("server") is None:
            raise pytest.UsageError(f"{item.nodeid} needs the real server: mark it with @pytest.mark.server")


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs a test that is a coroutine in an event loop of its own."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    asyncio.run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in inspect.signature(pyfuncitem.obj).parameters}))
    return True


@pytest.fixture(autouse=True)
def no_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Removes a ticket, a token and authorities from the environment."""
    for name in (TICKET, TOKEN, CA):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def real_binary() -> Path:
    """The program of the real server. Skips the test if there is none."""
    binary = os.environ.get(BINARY)
    if not binary:
        pytest.skip(f"{BINARY} is not set: name the chefshat binary to play against the real server")
    return Path(binary)


@pytest.fixture(scope="session")
def real_address(real_binary: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of the real server, one for the complete run. Fails if CHEFSHAT_BIN names a binary that does not serve."""
    with RealServer(real_binary, tmp_path_factory.mktemp("data")) as server:
        yield server.address


@pytest.fixture(params=["native", pytest.param("server", marks=pytest.mark.server)])
def anywhere(request: pytest.FixtureRequest) -> str | None:
    """The address of a `VectorEnv`: the test runs once in this process and once on the real server."""
    if request.param == "native":
        pytest.importorskip("chefshat_native")
        return None
    return str(request.getfixturevalue("real_address"))


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[str]]]:
    """A list for processes a test starts; those still running after it are killed."""
    started: list[subprocess.Popen[str]] = []
    yield started
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
