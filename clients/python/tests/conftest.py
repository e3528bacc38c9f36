"""Servers for the tests: the fake one always, the real one if CHEFSHAT_BIN names its binary."""

from collections.abc import Iterator

import pytest
from fake_server import FakeServer
from fake_vector import FakeVector
from shared import (  # noqa: F401 - pytest finds them here.
    anywhere,
    no_secrets,
    processes,
    pytest_collection_modifyitems,
    pytest_configure,
    pytest_pyfunc_call,
    real_address,
    real_binary,
)
from stage import Stage, attached


@pytest.fixture
def fake() -> Iterator[FakeServer]:
    """A fake server on a free port, stopped after the test."""
    with FakeServer() as server:
        yield server


@pytest.fixture
def toy() -> Iterator[FakeVector]:
    """A fake server with only the toy vector service, which stores its requests."""
    with FakeVector() as server:
        yield server


@pytest.fixture(params=["fake", pytest.param("real", marks=pytest.mark.server)])
def address(request: pytest.FixtureRequest) -> str:
    """The address of a server: the test runs once with the fake one and once with the real one."""
    if request.param == "fake":
        return str(request.getfixturevalue("fake").address)
    return str(request.getfixturevalue("real_address"))


@pytest.fixture
def stage() -> Stage:
    """A session of one seat, attached."""
    stage = Stage()
    stage.connect()
    stage.receive(attached())
    return stage
