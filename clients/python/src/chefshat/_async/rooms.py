"""The calls of RoomService, SpectatorService and InstrumentService. See `calls`."""

from collections.abc import AsyncIterator, Sequence
from contextlib import aclosing

from chefshat import pb, requests
from chefshat._async.connection import AsyncConnection
from chefshat._gen.chefshat.v1.instrument_service_pb2_grpc import InstrumentServiceStub
from chefshat._gen.chefshat.v1.room_service_pb2_grpc import RoomServiceStub
from chefshat._gen.chefshat.v1.spectator_service_pb2_grpc import SpectatorServiceStub
from chefshat.requests import AsyncStreamed, async_pages, awaited


class AsyncRooms:
    """Creates, joins and watches rooms, and records markers and samples beside their games."""

    def __init__(self, connection: AsyncConnection) -> None:
        self._connection = connection
        self._rooms = RoomServiceStub(connection.channel)
        self._spectators = SpectatorServiceStub(connection.channel)
        self._instruments = InstrumentServiceStub(connection.channel)

    async def create(
        self,
        name: str = "",
        *,
        rules: pb.RuleSet | str | None = None,
        seats: Sequence[requests.SeatSpec] = (),
        policy: pb.RoomPolicy | None = None,
        game_seed: bytes = b"",
        branch: pb.BranchPoint | None = None,
        hands: pb.ScriptedShift | None = None,
        durability: pb.Durability.ValueType | None = None,
        visibility: pb.Visibility.ValueType | None = None,
        physical: bool = False,
    ) -> pb.CreateRoomResponse:
        """Creates a room.

        Args:
            name: display name.
            rules: the rule set or the name of a preset; None: the default rules.
            seats: how each seat is filled, index = seat; empty: all seats are open. See `SeatSpec`.
            policy: times and limits; unset fields take their defaults.
            game_seed: 32 bytes that fix all deals, for experiments; empty: the server draws them.
            branch: the point of a recorded game to continue from, under the rules of that game (leave out `rules`).
            hands: the hands of the first Shift, instead of a deal.
            durability: what the game survives, overriding the policy; default: a restart of the server.
            visibility: who sees the room and its record, overriding the policy; default: everybody. See `secrets` of the client.
            physical: the cards are real: nothing is dealt, and what happens at the table is reported (`tables.report`).

        Returns:
            The room, its join code, the token that closes it and, if it is physical, the ticket of its table.
        """
        request = requests.create_room(name, rules, seats, policy, game_seed, branch, hands, durability, visibility, physical)
        return await awaited(self._rooms.CreateRoom, request)

    async def join(
        self,
        join_code: str,
        name: str,
        *,
        room_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        seat: int | None = None,
        name_key: bytes = b"",
    ) -> pb.JoinRoomResponse:
        """Takes `seat`, or the first free seat that admits `kind`. Returns the room, the seat and its ticket.

        `name_key` is empty, or 32 secret bytes that tell this name from the same name of others in ratings.
        """
        request = pb.JoinRoomRequest(room_id=room_id, join_code=join_code, name=name, kind=kind, seat=seat, name_key=name_key)
        return await awaited(self._rooms.JoinRoom, request)

    async def get(self, room_id: str = "", *, join_code: str = "") -> pb.Room:
        """Returns the public view of a room, by its id or its join code."""
        return (await awaited(self._rooms.GetRoom, pb.GetRoomRequest(room_id=room_id, join_code=join_code))).room

    def list(self, state: pb.RoomState.ValueType = pb.ROOM_STATE_UNSPECIFIED) -> AsyncIterator[pb.Room]:
        """Iterates over the server's rooms, newest first, optionally only those in one state. Fetches pages on demand."""
        return async_pages(self._rooms.ListRooms, pb.ListRoomsRequest(state=state), lambda page: page.rooms)

    async def leave(self, ticket: str) -> pb.Room:
        """Gives up a seat before the game begins. The seat becomes free and the ticket invalid."""
        return (await awaited(self._rooms.LeaveRoom, pb.LeaveRoomRequest(ticket=ticket))).room

    async def close(self, room_id: str, owner_token: str) -> pb.Room:
        """Closes a room with its creator's token. A running game is aborted."""
        request = pb.CloseRoomRequest(room_id=room_id, owner_token=owner_token)
        return (await awaited(self._rooms.CloseRoom, request)).room

    async def watch(self, room_id: str, *, from_sequence: int = 0) -> AsyncIterator[pb.GameEvent]:
        """Iterates over a room's public events until its game is over. Reconnects; each event arrives once and in order.

        Where numbers are missing, the room no longer has these events: of a long game it keeps the last ones alone.

        Args:
            room_id: the room.
            from_sequence: number of the first event wanted; 0: all.
        """
        last = max(from_sequence - 1, 0)

        def begin() -> AsyncStreamed[pb.SpectatorServiceWatchResponse]:
            return self._spectators.Watch(requests.watch_request(room_id, last))

        async with aclosing(self._connection.messages(begin)) as messages:
            async for message in messages:
                if message.HasField("snapshot"):
                    last = max(last, message.snapshot.next_sequence - 1)
                for event in message.events:
                    last = event.sequence
                    yield event

    async def add_marker(self, room_id: str, owner_token: str, label: str, *, elapsed_us: int | None = None) -> pb.Marker:
        """Puts a marker into the record of a room. Nobody but the owner of the room learns of it.

        Args:
            room_id: the room.
            owner_token: its creator's token, or that of the study whose game it is.
            label: what the marker says, 1..=128 characters.
            elapsed_us: the marked moment on the room's clock, microseconds since the room was created (see `Client.read_clock`);
                None: when the server reads the request.
        """
        request = pb.AddMarkerRequest(room_id=room_id, owner_token=owner_token, label=label, elapsed_us=elapsed_us)
        return (await awaited(self._instruments.AddMarker, request)).marker

    async def follow_markers(self, room_id: str, owner_token: str, *, from_number: int = 0) -> AsyncIterator[pb.Marker]:
        """Iterates over the markers of a room until its game is over. Reconnects; each marker arrives once and in order.

        Args:
            room_id: the room.
            owner_token: its creator's token.
            from_number: number of the first marker wanted; 0: all.
        """
        last = max(from_number - 1, 0)

        def begin() -> AsyncStreamed[pb.FollowMarkersResponse]:
            request = pb.FollowMarkersRequest(room_id=room_id, owner_token=owner_token, from_number=last + 1)
            return self._instruments.FollowMarkers(request)

        async with aclosing(self._connection.messages(begin)) as messages:
            async for message in messages:
                for marker in message.markers:
                    last = marker.number
                    yield marker

    async def add_samples(self, ticket: str | pb.OwnedSeat, chunk: pb.SampleChunk) -> int:
        """Records samples of a seat beside its game. See `chefshat.samples.SampleStream`.

        Args:
            ticket: the ticket of the seat, or for the owner of a room or study the seat itself.
            chunk: the samples.

        Returns:
            How many were new. Samples that are not later than the last one of their stream are ignored.
        """
        if isinstance(ticket, pb.OwnedSeat):
            request = pb.AddSamplesRequest(owned_seat=ticket, chunk=chunk)
        else:
            request = pb.AddSamplesRequest(ticket=ticket, chunk=chunk)
        return (await awaited(self._instruments.AddSamples, request)).recorded
