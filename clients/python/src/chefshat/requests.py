"""What both clients share around a call: building requests, paging and errors. Channels are in `channels`."""

import asyncio
import secrets
import time
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol, TypeAlias, TypeVar

from chefshat import pb
from chefshat.errors import closed, from_rpc_error
from chefshat.network import grpc


class PageRequest(Protocol):
    """A request of a listing."""

    page_token: str


class Page(Protocol):
    """A response of a listing; an empty `next_page_token` marks the last."""

    next_page_token: str


# Requests that carry an id, by which the server answers a repeated one like the first.
REPEATABLE = (
    pb.CreateRoomRequest,
    pb.JoinRoomRequest,
    pb.CreateTournamentRequest,
    pb.JoinTournamentRequest,
    pb.AddTableParticipantRequest,
    pb.ReplaceParticipantRequest,
)
# Requests that change nothing. The Rust SDK repeats the same. Not `GetServerInfo`, which tells at once whether the server answers.
READING = (
    pb.GetActionTableRequest,
    pb.GetClockRequest,
    pb.GetRoomRequest,
    pb.ListRoomsRequest,
    pb.ListRecordsRequest,
    pb.GetRecordRequest,
    pb.GetTournamentRequest,
    pb.ListTournamentsRequest,
    pb.GetTournamentResultsRequest,
    pb.ListTournamentGamesRequest,
    pb.GetPhysicalTableRequest,
    pb.GetLeaderboardRequest,
)
REQUEST_ID_BYTES = 32
# Reasons of calls without an answer of the server: no connection, or a proxy or a broken stream that has lost it.
LOST = (grpc.StatusCode.UNAVAILABLE.name, grpc.StatusCode.INTERNAL.name, grpc.StatusCode.UNKNOWN.name)
# Seconds before each further attempt of a request whose response was lost.
PAUSES_S = (0.1, 0.2, 0.4)
# The same while the server that runs its room or tournament cannot be reached: another one takes over within ten seconds.
OWNER_PAUSES_S = (0.1, 0.2, 0.4, 0.8) + 15 * (1.0,)
OWNER_UNREACHABLE = "OWNER_UNREACHABLE"
# The same while the server has just joined others and is not reached by them yet.
NODE_NOT_REACHED = "NODE_NOT_REACHED"
# The same while the server stops, and then is away: its running games may end first, and then it starts again.
RESTART_PAUSES_S = (0.1, 0.2, 0.4, 0.8) + 120 * (1.0,)
SHUTTING_DOWN = "SHUTTING_DOWN"

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")
AskedPage = TypeVar("AskedPage", bound=PageRequest)
AnsweredPage = TypeVar("AnsweredPage", bound=Page)
Item = TypeVar("Item")
Streaming = TypeVar("Streaming", covariant=True)


class Streamed(Protocol[Streaming]):
    """A call with several responses."""

    def __iter__(self) -> Iterator[Streaming]: ...

    def cancel(self) -> object:
        """Ends the call."""


class AsyncStreamed(Protocol[Streaming]):
    """A call of asyncio with several responses."""

    def __aiter__(self) -> AsyncIterator[Streaming]: ...

    def cancel(self) -> object:
        """Ends the call."""


# The messages of a stream. Close it unless you read it to its end.
Messages: TypeAlias = Generator[Item, None, None]
AsyncMessages: TypeAlias = AsyncGenerator[Item, None]

SeatSpec: TypeAlias = "pb.SeatConfig | pb.RecordedPlayer | pb.ParticipantKind.ValueType | str | None"
"""How to fill a seat: a built-in agent's name, a recorded player to imitate, the kind it is reserved for, None (open to all), or
the message itself."""


def create_room(
    name: str,
    rules: pb.RuleSet | str | None,
    seats: Sequence[SeatSpec],
    policy: pb.RoomPolicy | None,
    game_seed: bytes,
    branch: pb.BranchPoint | None,
    hands: pb.ScriptedShift | None,
    durability: pb.Durability.ValueType | None,
    visibility: pb.Visibility.ValueType | None,
    physical: bool,
) -> pb.CreateRoomRequest:
    """Builds the request to create a room."""
    if branch is not None and hands is not None:
        raise ValueError("a game begins from a record (branch) or with given hands (hands), not both")
    if isinstance(rules, str):
        rules = pb.RuleSet(preset=rules)
    if durability is not None or visibility is not None:
        # Copies the policy, which the caller may use for other rooms.
        asked = pb.RoomPolicy()
        asked.MergeFrom(policy or asked)
        if durability is not None:
            asked.durability = durability
        if visibility is not None:
            asked.visibility = visibility
        policy = asked
    configs = [seat_config(seat) for seat in seats]
    return pb.CreateRoomRequest(
        name=name,
        rules=rules,
        seats=configs,
        policy=policy,
        game_seed=game_seed,
        branch=branch,
        scripted=hands,
        physical=physical,
    )


def create_tournament(settings: pb.TournamentSettings, visibility: pb.Visibility.ValueType | None) -> pb.CreateTournamentRequest:
    """Builds the request to create a tournament."""
    request = pb.CreateTournamentRequest(settings=settings)
    if visibility is not None:
        request.settings.policy.visibility = visibility
    return request


def join_tournament(
    join_code: str,
    name: str,
    tournament_id: str,
    kind: pb.ParticipantKind.ValueType,
    max_games: int,
    stateless: bool,
    name_key: bytes,
) -> pb.JoinTournamentRequest:
    """Builds the request to join a tournament."""
    if max_games < 1:
        raise ValueError(f"max_games is {max_games}: a participant plays at least one game at a time")
    return pb.JoinTournamentRequest(
        tournament_id=tournament_id,
        join_code=join_code,
        name=name,
        kind=kind,
        max_games=max_games,
        stateless=stateless,
        name_key=name_key,
    )


def seat_config(seat: SeatSpec) -> pb.SeatConfig:
    """Builds the message for one seat."""
    if isinstance(seat, pb.SeatConfig):
        return seat
    if isinstance(seat, pb.RecordedPlayer):
        return pb.SeatConfig(replay=seat)
    if isinstance(seat, str):
        return pb.SeatConfig(built_in_agent=seat)
    return pb.SeatConfig(reserved_for=pb.PARTICIPANT_KIND_UNSPECIFIED if seat is None else seat)


def watch_request(room_id: str, last_sequence: int) -> pb.SpectatorServiceWatchRequest:
    """Builds the request for a room's events after `last_sequence`; all of them if that is 0."""
    return pb.SpectatorServiceWatchRequest(room_id=room_id, from_sequence=last_sequence + 1 if last_sequence else 0)


def attach(
    ticket: str, request_id: int, last_sequence: int, entropy: bytes, delivery: pb.EventDelivery.ValueType
) -> pb.SeatCommand:
    """Builds the command to attach a seat, from the event after `last_sequence` (0: from the first), or a participant."""
    command = pb.SeatCommand()
    command.attach.ticket = ticket
    command.attach.request_id = request_id
    command.attach.from_sequence = last_sequence + 1 if last_sequence else 0
    command.attach.delivery = delivery
    command.attach.entropy = entropy
    return command


def called(method: Callable[[Asked], Answered], request: Asked) -> Answered:
    """Makes a unary call. Raises a gRPC error as `ChefsHatError`.

    Repeats it, if that is safe, when its response was lost, its room or tournament is just changing servers, or the server is
    stopping: for two minutes, in which it may start again.
    """
    pauses = _pauses(request)
    while True:
        try:
            return method(request)
        except grpc.RpcError as error:
            pause = _pause_after(error, pauses)
        time.sleep(pause)


async def awaited(method: Callable[[Asked], Awaitable[Answered]], request: Asked) -> Answered:
    """Makes a unary call of asyncio, like `called`."""
    pauses = _pauses(request)
    while True:
        try:
            with closed_is_an_error():
                return await method(request)
        except grpc.RpcError as error:
            pause = _pause_after(error, pauses)
        await asyncio.sleep(pause)


@contextmanager
def closed_is_an_error() -> Iterator[None]:
    """Raises `ChefsHatError` if the channel is closed during a call of asyncio.

    gRPC cancels the call then, which looks as if the task were cancelled.
    """
    try:
        yield
    except asyncio.CancelledError:
        task = asyncio.current_task()
        if task is not None and task.cancelling():
            raise
        raise closed() from None


def received(call: Streamed[Answered]) -> Iterator[Answered]:
    """Returns the messages of a call."""
    return iter(call)


async def async_received(call: AsyncStreamed[Answered]) -> AsyncIterator[Answered]:
    """Yields the messages of a call of asyncio. Raises `ChefsHatError` if the channel is closed meanwhile."""
    with closed_is_an_error():
        async for message in call:
            yield message


def streamed(method: Callable[[Asked], Streamed[Answered]], request: Asked) -> Iterator[Answered]:
    """Yields the responses of a call. Before the first one, repeats the call like `called`."""
    pauses = _pauses(request)
    while True:
        call = method(request)
        try:
            for response in call:
                pauses = {}
                yield response
            return
        except grpc.RpcError as error:
            pause = _pause_after(error, pauses)
        finally:
            call.cancel()
        time.sleep(pause)


async def async_streamed(method: Callable[[Asked], AsyncStreamed[Answered]], request: Asked) -> AsyncIterator[Answered]:
    """Yields the responses of a call of asyncio, like `streamed`."""
    pauses = _pauses(request)
    while True:
        call = method(request)
        try:
            async for response in async_received(call):
                pauses = {}
                yield response
            return
        except grpc.RpcError as error:
            pause = _pause_after(error, pauses)
        finally:
            call.cancel()
        await asyncio.sleep(pause)


def _pauses(request: object) -> dict[str, Iterator[float]]:
    """Returns the pauses in seconds between the attempts of a call, by the reason to repeat it; gives the request its id."""
    if isinstance(request, pb.ReportRequest):
        request.report_id = request.report_id or secrets.token_hex(REQUEST_ID_BYTES)
    elif isinstance(request, pb.ReplaceParticipantRequest) and request.built_in_agent:
        return {}  # Its id would be for the ticket, and a built-in agent has none.
    elif isinstance(request, pb.ActRequest):
        if not request.HasField("hint"):
            return {}
        request.hint.request_id = request.hint.request_id or secrets.token_bytes(REQUEST_ID_BYTES)
    elif isinstance(request, REPEATABLE):
        request.request_id = request.request_id or secrets.token_bytes(REQUEST_ID_BYTES)
    elif not isinstance(request, READING):
        return {}
    return {
        **dict.fromkeys(LOST, iter(PAUSES_S)),
        OWNER_UNREACHABLE: iter(OWNER_PAUSES_S),
        NODE_NOT_REACHED: iter(OWNER_PAUSES_S),
        SHUTTING_DOWN: iter(RESTART_PAUSES_S),
    }


def _pause_after(error: grpc.RpcError, pauses: dict[str, Iterator[float]]) -> float:
    """Returns the pause before the next attempt; raises the error if the server refused the call or no attempt is left."""
    failure = from_rpc_error(error)
    if failure.reason == SHUTTING_DOWN and pauses:
        pauses.update(dict.fromkeys(LOST, pauses[SHUTTING_DOWN]))
    pause = next(pauses.get(failure.reason, iter(())), None)
    if pause is None:
        raise failure from error
    return pause


def pages(
    method: Callable[[AskedPage], AnsweredPage], request: AskedPage, items: Callable[[AnsweredPage], Iterable[Item]]
) -> Iterator[Item]:
    """Yields the items of a listing. Fetches pages on demand."""
    while True:
        page = called(method, request)
        yield from items(page)
        request.page_token = page.next_page_token
        if not request.page_token:
            return


async def async_pages(
    method: Callable[[AskedPage], Awaitable[AnsweredPage]], request: AskedPage, items: Callable[[AnsweredPage], Iterable[Item]]
) -> AsyncIterator[Item]:
    """Yields the items of a listing under asyncio. Fetches pages on demand."""
    while True:
        page = await awaited(method, request)
        for item in items(page):
            yield item
        request.page_token = page.next_page_token
        if not request.page_token:
            return
