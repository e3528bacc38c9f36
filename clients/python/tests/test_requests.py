"""Calls that are repeated when their response was lost, or their room is just changing servers."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

import grpc
import pytest
from google.protobuf import any_pb2, descriptor_pool
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2

from chefshat import ChefsHatError, pb, requests
from chefshat.errors import DETAILS_KEY


class Lost(grpc.RpcError):
    """What gRPC raises when a call ends without the server's answer."""

    def __init__(self, code: grpc.StatusCode = grpc.StatusCode.UNAVAILABLE) -> None:
        self._code = code

    def code(self) -> grpc.StatusCode:
        """The status code."""
        return self._code


class Unreachable(Lost):
    """The answer of a server that cannot reach the one that runs a room or tournament."""

    reason = "OWNER_UNREACHABLE"

    def trailing_metadata(self) -> tuple[Any, ...]:
        """The reason."""
        detail = any_pb2.Any()
        detail.Pack(error_details_pb2.ErrorInfo(reason=self.reason, domain="chefshat"))
        status = status_pb2.Status(code=grpc.StatusCode.UNAVAILABLE.value[0], details=[detail])
        return ((DETAILS_KEY, status.SerializeToString()),)


class Joining(Unreachable):
    """The answer of a server that has just joined others, which do not reach it yet."""

    reason = "NODE_NOT_REACHED"


class Stopping(Unreachable):
    """The answer of a server that stops."""

    reason = "SHUTTING_DOWN"


class Method:
    """A call that fails with each error in turn, then returns; records the ids of its requests."""

    def __init__(self, *errors: grpc.RpcError) -> None:
        self.errors = list(errors)
        self.ids: list[bytes] = []

    def __call__(self, request: Message) -> str:
        """Fails or returns."""
        self.ids.append(getattr(request, "request_id", b""))
        if self.errors:
            raise self.errors.pop(0)
        return "joined"

    async def awaited(self, request: pb.JoinRoomRequest) -> str:
        """The same, asynchronously."""
        return self(request)


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Removes the pauses between attempts."""
    monkeypatch.setattr(requests, "PAUSES_S", (0.0, 0.0, 0.0))
    for name in ("OWNER_PAUSES_S", "RESTART_PAUSES_S"):
        monkeypatch.setattr(requests, name, len(getattr(requests, name)) * (0.0,))


@pytest.mark.parametrize("asynchronous", [False, True])
@pytest.mark.parametrize("code", [grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN])
def test_a_request_whose_response_was_lost_is_repeated_with_its_id(code: grpc.StatusCode, *, asynchronous: bool) -> None:
    method = Method(Lost(code), Lost(code))
    request = pb.JoinRoomRequest(join_code="ABCDEFGH")
    joined = asyncio.run(requests.awaited(method.awaited, request)) if asynchronous else requests.called(method, request)
    assert joined == "joined"
    assert len(method.ids) == 3
    assert len(set(method.ids)) == 1
    assert len(method.ids[0]) == requests.REQUEST_ID_BYTES


def test_a_request_for_a_hint_is_repeated_with_its_id_other_commands_are_not() -> None:
    ids: list[bytes] = []

    def method(request: pb.ActRequest) -> str:
        ids.append(request.hint.request_id)
        if len(ids) == 1:
            raise Lost
        return "a hint"

    assert requests.called(method, pb.ActRequest(hint=pb.AskHint(decision_id=7))) == "a hint"
    assert len(ids) == 2
    assert len(set(ids)) == 1
    assert len(ids[0]) == requests.REQUEST_ID_BYTES
    ids.clear()
    with pytest.raises(ChefsHatError):
        requests.called(method, pb.ActRequest(answer=pb.Answer(decision_id=7)))


@pytest.mark.parametrize("errors", [[Lost(grpc.StatusCode.FAILED_PRECONDITION)], [Lost()] * 4])
def test_a_refusal_and_the_last_attempt_are_raised(errors: list[grpc.RpcError]) -> None:
    method = Method(*errors)
    with pytest.raises(ChefsHatError):
        requests.called(method, pb.JoinRoomRequest())
    assert len(method.ids) == len(errors)


@pytest.mark.parametrize("request_", [pb.JoinRoomRequest(), pb.GetRoomRequest()])
@pytest.mark.parametrize("error", [Unreachable(), Joining()])
def test_a_room_that_changes_servers_is_awaited_but_not_for_ever(
    request_: pb.JoinRoomRequest | pb.GetRoomRequest, error: Unreachable
) -> None:
    attempts = 1 + len(requests.OWNER_PAUSES_S)
    assert requests.called(Method(*[error] * (attempts - 1)), request_) == "joined"
    method = Method(*[error] * attempts)
    with pytest.raises(ChefsHatError, match=error.reason):
        requests.called(method, request_)
    assert len(method.ids) == attempts


def test_a_server_that_stops_and_starts_again_is_awaited_but_not_for_ever() -> None:
    request = pb.CreateRoomRequest()
    stopping, away = [Stopping()] * 30, [Lost(), Lost(grpc.StatusCode.INTERNAL)] * 10
    method = Method(*stopping, *away)
    assert requests.called(method, request) == "joined"
    assert len(set(method.ids)) == 1
    attempts = 1 + len(requests.RESTART_PAUSES_S)
    method = Method(*[Stopping()] * attempts)
    with pytest.raises(ChefsHatError, match="SHUTTING_DOWN"):
        requests.called(method, request)
    assert len(method.ids) == attempts
    # What is not safe to repeat is not repeated.
    method = Method(Stopping())
    with pytest.raises(ChefsHatError, match="SHUTTING_DOWN"):
        requests.called(method, pb.CloseRoomRequest())
    assert len(method.ids) == 1


class Lines:
    """A call with two responses that fails with each error in turn: None stands for a success."""

    def __init__(self, *errors: grpc.RpcError | None, after: int = 0) -> None:
        self.errors = list(errors)
        self.after = after
        self.calls = 0
        self.cancelled = 0

    def __call__(self, request: pb.GetRecordRequest) -> "Lines":
        """Calls."""
        self.calls += 1
        return self

    def __iter__(self) -> Iterator[int]:
        """The responses."""
        error = self.errors.pop(0)
        for number in range(2):
            if error is not None and number == self.after:
                raise error
            yield number

    async def __aiter__(self) -> AsyncIterator[int]:
        """The same, asynchronously."""
        for number in self:
            yield number

    def cancel(self) -> None:
        """Ends the call."""
        self.cancelled += 1


def read(call: Lines, *, asynchronous: bool) -> list[int]:
    """Reads all responses."""
    request = pb.GetRecordRequest()

    async def gather() -> list[int]:
        return [number async for number in requests.async_streamed(call, request)]

    return asyncio.run(gather()) if asynchronous else list(requests.streamed(call, request))


@pytest.mark.parametrize("asynchronous", [False, True])
def test_a_record_is_requested_again_until_its_first_lines(*, asynchronous: bool) -> None:
    call = Lines(Lost(), Unreachable(), None)
    assert read(call, asynchronous=asynchronous) == [0, 1]
    assert call.calls == call.cancelled == 3
    # Afterwards, lines would come twice.
    call = Lines(Lost(), after=1)
    with pytest.raises(ChefsHatError):
        read(call, asynchronous=asynchronous)
    assert call.calls == 1


@pytest.mark.parametrize("service", ["ServerService", "RoomService", "RecordService", "TournamentService"])
def test_every_call_that_only_reads_or_has_an_id_is_repeated(service: str) -> None:
    reading, repeatable = ({request.DESCRIPTOR.name for request in table} for table in (requests.READING, requests.REPEATABLE))
    for method in descriptor_pool.Default().FindServiceByName(f"chefshat.v1.{service}").methods:
        request = method.input_type
        reads = method.name.startswith(("Get", "List")) and method.name != "GetServerInfo"
        assert (request.name in reading) == reads, method.name
        assert (request.name in repeatable) == ("request_id" in request.fields_by_name), method.name


def test_a_replacement_by_a_built_in_agent_is_not_repeated() -> None:
    method = Method(Lost())
    with pytest.raises(ChefsHatError):
        requests.called(method, pb.ReplaceParticipantRequest(built_in_agent="greedy"))
    assert method.ids == [b""]


def test_a_change_that_may_have_been_made_is_not_repeated() -> None:
    method = Method(Unreachable())
    with pytest.raises(ChefsHatError, match="OWNER_UNREACHABLE"):
        requests.called(method, pb.LeaveRoomRequest())
    assert len(method.ids) == 1
