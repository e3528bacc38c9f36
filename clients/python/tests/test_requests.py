"""Calls that are repeated when their response was lost."""

import asyncio

import grpc
import pytest

from chefshat import ChefsHatError, pb, requests


class Lost(grpc.RpcError):
    """What gRPC raises when a call ends without the server's answer."""

    def __init__(self, code: grpc.StatusCode = grpc.StatusCode.UNAVAILABLE) -> None:
        self._code = code

    def code(self) -> grpc.StatusCode:
        """The status code."""
        return self._code


class Method:
    """A call that fails with each error in turn, then returns; records the ids of its requests."""

    def __init__(self, *errors: grpc.RpcError) -> None:
        self.errors = list(errors)
        self.ids: list[bytes] = []

    def __call__(self, request: pb.JoinRoomRequest) -> str:
        """Fails or returns."""
        self.ids.append(request.request_id)
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


@pytest.mark.parametrize("asynchronous", [False, True])
def test_a_request_whose_response_was_lost_is_repeated_with_its_id(*, asynchronous: bool) -> None:
    method = Method(Lost(), Lost())
    request = pb.JoinRoomRequest(join_code="ABCDEFGH")
    joined = asyncio.run(requests.awaited(method.awaited, request)) if asynchronous else requests.called(method, request)
    assert joined == "joined"
    assert len(method.ids) == 3
    assert len(set(method.ids)) == 1
    assert len(method.ids[0]) == requests.REQUEST_ID_BYTES


@pytest.mark.parametrize("errors", [[Lost(grpc.StatusCode.FAILED_PRECONDITION)], [Lost()] * 4])
def test_a_refusal_and_the_last_attempt_are_raised(errors: list[grpc.RpcError]) -> None:
    method = Method(*errors)
    with pytest.raises(ChefsHatError):
        requests.called(method, pb.JoinRoomRequest())
    assert len(method.ids) == len(errors)
