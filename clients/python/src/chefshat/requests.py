"""What both clients share around a call: where the server is, how the channel behaves, what becomes of arguments and of errors."""

from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import grpc

from chefshat import pb
from chefshat.errors import from_rpc_error

Answered = TypeVar("Answered")

# Times in milliseconds. Waits between attempts to connect are `Backoff`'s business, so the channel's own are kept short. (But not
# "grpc.min_reconnect_backoff_ms", which despite its name bounds how long one attempt may take.) Pings notice a peer that is gone
# without having said so.
CHANNEL_OPTIONS: list[tuple[str, int]] = [
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 1000),
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    # Two clients of one process are two agents, and one connection each is how they would run apart.
    ("grpc.use_local_subchannel_pool", 1),
]

SeatSpec: TypeAlias = "pb.SeatConfig | pb.RecordedPlayer | pb.ParticipantKind.ValueType | str | None"
"""How to fill a seat: a built-in agent's name, a recorded player to play as, a kind it is reserved for, None (open to everybody),
or the message itself."""


class Target(NamedTuple):
    """Where a server is: what gRPC connects to, and whether by TLS."""

    authority: str
    tls: bool


def target(address: str) -> Target:
    """Reads "host:port", "http://host:port" (the same) or "https://host:port" (TLS)."""
    scheme, separator, rest = address.partition("://")
    if not separator:
        return Target(address, tls=False)
    if scheme not in ("http", "https"):
        raise ValueError(f"the address {address!r} begins with neither http:// nor https://")
    return Target(rest.rstrip("/"), tls=scheme == "https")


def channel(address: str, options: Sequence[tuple[str, int]] = ()) -> grpc.Channel:
    """A blocking channel to the server at the address; options are added to `CHANNEL_OPTIONS`."""
    where = target(address)
    together = [*CHANNEL_OPTIONS, *options]
    if where.tls:
        return grpc.secure_channel(where.authority, grpc.ssl_channel_credentials(), together)
    return grpc.insecure_channel(where.authority, together)


def create_room(
    name: str,
    rules: pb.RuleSet | str | None,
    seats: Sequence[SeatSpec],
    policy: pb.RoomPolicy | None,
    game_seed: bytes,
    branch: pb.BranchPoint | None,
    hands: pb.ScriptedShift | None,
    durability: pb.Durability.ValueType | None,
) -> pb.CreateRoomRequest:
    """The request for a room."""
    if branch is not None and hands is not None:
        raise ValueError("a game begins from a record (branch) or with given hands (hands), not with both")
    if isinstance(rules, str):
        rules = pb.RuleSet(preset=rules)
    if durability is not None:
        # A copy: the caller may use its policy for other rooms.
        asked = pb.RoomPolicy()
        asked.MergeFrom(policy or asked)
        asked.durability = durability
        policy = asked
    configs = [seat_config(seat) for seat in seats]
    return pb.CreateRoomRequest(
        name=name, rules=rules, seats=configs, policy=policy, game_seed=game_seed, branch=branch, scripted=hands
    )


def seat_config(seat: SeatSpec) -> pb.SeatConfig:
    """The message for one seat."""
    if isinstance(seat, pb.SeatConfig):
        return seat
    if isinstance(seat, pb.RecordedPlayer):
        return pb.SeatConfig(replay=seat)
    if isinstance(seat, str):
        return pb.SeatConfig(built_in_agent=seat)
    return pb.SeatConfig(reserved_for=pb.PARTICIPANT_KIND_UNSPECIFIED if seat is None else seat)


def watch_request(room_id: str, last_sequence: int) -> pb.SpectatorServiceWatchRequest:
    """The request for a room's events after `last_sequence`; all of them if that is 0."""
    return pb.SpectatorServiceWatchRequest(room_id=room_id, from_sequence=last_sequence + 1 if last_sequence else 0)


def attach(
    ticket: str, request_id: int, last_sequence: int, entropy: bytes, delivery: pb.EventDelivery.ValueType
) -> pb.SeatCommand:
    """The command that attaches a seat, from the event after `last_sequence` (0: from the first), or a tournament's participant."""
    command = pb.SeatCommand()
    command.attach.ticket = ticket
    command.attach.request_id = request_id
    command.attach.from_sequence = last_sequence + 1 if last_sequence else 0
    command.attach.delivery = delivery
    command.attach.entropy = entropy
    return command


def called(call: Callable[[], Answered]) -> Answered:
    """Runs one unary call, turning gRPC's error into ours."""
    try:
        return call()
    except grpc.RpcError as error:
        raise from_rpc_error(error) from error


async def awaited(call: Awaitable[Answered]) -> Answered:
    """Awaits one unary call, turning gRPC's error into ours."""
    try:
        return await call
    except grpc.RpcError as error:
        raise from_rpc_error(error) from error
