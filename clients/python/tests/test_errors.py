"""Refusals over a real connection, and the delays between connection attempts."""

import asyncio
import json
import random
import re
import socket
import threading
from collections.abc import Callable, Coroutine, Iterator

import grpc
import pytest
from fake_server import FakeServer
from proxy import Proxy
from waiting import LIMIT_S

import chefshat
from chefshat import Backoff, ChefsHatError, RandomAgent, aio, channels, pb
from chefshat.errors import exit_code


def test_a_refusal_has_reason_metadata_and_code(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client, pytest.raises(ChefsHatError) as caught:
        client.rooms.join("WRONG", "Ada")
    error = caught.value
    assert error.reason == "JOIN_CODE_WRONG"
    assert error.message == "no room has this join code"
    assert error.metadata == {"field": "join_code"}
    assert error.code is grpc.StatusCode.PERMISSION_DENIED
    assert not error.retryable
    assert str(error) == "JOIN_CODE_WRONG: no room has this join code"


async def async_refusal(address: str) -> ChefsHatError:
    async with aio.Client(address) as client:
        with pytest.raises(ChefsHatError) as caught:
            await client.rooms.get("nowhere")
    return caught.value


def test_a_refusal_is_the_same_under_asyncio(fake: FakeServer) -> None:
    error = asyncio.run(async_refusal(fake.address))
    assert (error.reason, error.metadata) == ("ROOM_UNKNOWN", {"room_id": "nowhere"})


def test_a_refused_stream_raises(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        with pytest.raises(ChefsHatError, match="GAME_UNKNOWN"):
            list(client.records.read("nothing"))
        with pytest.raises(ChefsHatError, match="ROOM_UNKNOWN"):
            list(client.rooms.watch("nothing"))


def test_without_details_the_code_is_the_reason() -> None:
    # Nothing listens on port 1.
    with chefshat.Client("127.0.0.1:1", backoff=Backoff(attempts=0)) as client:
        with pytest.raises(ChefsHatError) as caught:
            client.server_info()
        assert caught.value.reason == "UNAVAILABLE"
        assert caught.value.retryable
        assert re.search(r"127\.0\.0\.1:1\b.*chefshat serve.*HOST:PORT", caught.value.message)
        with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
            client.play(RandomAgent(), "ticket")


def test_a_slow_connection_is_awaited(fake: FakeServer) -> None:
    with Proxy(fake.address, delay_s=0.5) as proxy, chefshat.Client(proxy.address) as client:
        assert client.server_info().server_version == "fake"


@pytest.fixture
def silent() -> Iterator[str]:
    """The address of a server that accepts connections and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield f"127.0.0.1:{listener.getsockname()[1]}"


def test_a_call_without_an_answer_ends(silent: str) -> None:
    async def asynchronous() -> None:
        async with aio.Client(silent, timeout=0.2) as client:
            await client.rooms.create()

    with chefshat.Client(silent, timeout=0.2) as client, pytest.raises(ChefsHatError, match="longer timeout=") as caught:
        client.rooms.create()
    assert caught.value.reason == "DEADLINE_EXCEEDED"
    with pytest.raises(ChefsHatError, match="DEADLINE_EXCEEDED"):
        asyncio.run(asynchronous())


def test_a_closed_client_says_so_in_every_thread(fake: FakeServer, silent: str) -> None:
    client = chefshat.Client(fake.address)
    client.close()
    for call in (
        client.server_info,
        lambda: client.play(RandomAgent(), "ticket"),
        lambda: list(client.records.read("game")),
    ):
        with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
            call()
    waiting = chefshat.Client(silent, timeout=None)
    errors: list[ChefsHatError] = []

    def wait() -> None:
        with pytest.raises(ChefsHatError) as caught:
            waiting.rooms.create()
        errors.append(caught.value)

    thread = threading.Thread(target=wait)
    thread.start()
    # Whether it is closed before or after the call has begun.
    waiting.close()
    thread.join()
    assert errors[0].reason in ("CLIENT_CLOSED", "CANCELLED")


@pytest.mark.parametrize("kind", ["unary_unary", "unary_stream"])
def test_a_client_that_is_closed_while_a_call_begins_says_so(silent: str, kind: str) -> None:
    channel = channels.channel(chefshat.ServerAddress(silent))

    def closing(_: object) -> bytes:
        channel.close()
        return b""

    with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
        getattr(channel, kind)("/service/Call", request_serializer=closing)(None)


async def estimates(client: aio.Client) -> list[pb.EvaluateResponse]:
    """What the server estimates of a decision."""
    return [estimate async for estimate in client.evaluate(pb.EvaluateRequest())]


@pytest.mark.parametrize(
    "begin",
    [lambda client: client.rooms.create(), lambda client: client.play(RandomAgent(), "ticket"), estimates],
    ids=["create", "play", "evaluate"],
)
def test_a_client_of_asyncio_that_is_closed_during_a_call_says_so(
    silent: str, begin: Callable[[aio.Client], Coroutine[None, None, object]]
) -> None:
    async def close_during_a_call() -> None:
        client = aio.Client(silent, timeout=None)
        call = asyncio.create_task(begin(client))
        await asyncio.sleep(0)
        await client.close()
        await asyncio.wait_for(call, LIMIT_S)

    async def cancel() -> None:
        async with aio.Client(silent, timeout=None) as client, asyncio.timeout(0.1):
            await begin(client)

    with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
        asyncio.run(close_during_a_call())
    with pytest.raises(TimeoutError):
        asyncio.run(cancel())


def test_addresses() -> None:
    for address in ("127.0.0.1:1", "http://127.0.0.1:1/", "https://127.0.0.1:1"):
        chefshat.Client(address).close()
    with pytest.raises(ChefsHatError, match=r"ADDRESS_REFUSED.*must begin with http"):
        chefshat.Client("ftp://127.0.0.1:1")


def test_backoff_grows_to_its_limit() -> None:
    backoff = Backoff(first_s=0.1, factor=2.0, max_s=1.0)
    chance = random.Random(3)
    for failures, nominal in [(1, 0.1), (2, 0.2), (4, 0.8), (5, 1.0), (10_000, 1.0)]:
        delays = [backoff.delay_s(failures, chance) for _ in range(100)]
        assert all(nominal / 2 <= delay <= nominal for delay in delays)
        assert len(set(delays)) > 90


REFUSAL = ChefsHatError("ROOM_FULL", "no seat is free", {"room_id": "7"}, grpc.StatusCode.RESOURCE_EXHAUSTED)


@pytest.mark.parametrize(
    ("error", "line", "words"),
    [
        (
            REFUSAL,
            {"event": "error", "reason": "ROOM_FULL", "message": "no seat is free", "metadata": {"room_id": "7"}},
            "error: ROOM_FULL: no seat is free\n",
        ),
        (
            ChefsHatError("UNAVAILABLE"),
            {"event": "error", "reason": "UNAVAILABLE", "message": "", "metadata": {}},
            "error: UNAVAILABLE\n",
        ),
        (
            OSError("there is no ticket in F"),
            {"event": "error", "reason": "REFUSED", "message": "there is no ticket in F"},
            "error: there is no ticket in F\n",
        ),
    ],
    ids=["refusal", "no message", "file"],
)
def test_commands_report_errors_as_text_or_json(
    error: Exception, line: dict[str, object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> int:
        raise error

    assert exit_code(fails, as_json=True) == 1
    printed, expected = capsys.readouterr()
    assert (printed.count("\n"), json.loads(printed), expected) == (1, line, "")
    assert exit_code(fails, as_json=False) == 1
    assert capsys.readouterr() == ("", words)


def test_expected_errors_are_printed() -> None:
    def fails() -> int:
        raise ValueError("wrong")

    assert exit_code(fails, ValueError, as_json=False) == 1
    with pytest.raises(ValueError, match="wrong"):
        exit_code(fails, as_json=False)


@pytest.mark.parametrize(("words", "expected"), [("", "interrupted\n"), ("a place is left", "interrupted; a place is left\n")])
def test_ctrl_c_prints_the_message_of_the_interrupt(words: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt(*filter(None, [words]))

    assert exit_code(interrupted, as_json=True) == 130
    assert capsys.readouterr() == ("", expected)
