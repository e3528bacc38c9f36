"""A server in Python that plays the toy game of `fake_game` over the real protocol, and can misbehave on request."""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from concurrent import futures
from pathlib import Path
from typing import NoReturn, Self

import grpc
from fake_game import QUESTIONS, SIZE, FakeGame, FakeSeat, Outbox
from fake_tournament import FakeTournaments, Stream
from fake_vector import ToyVector
from refusing import Context, Guard, refuse

from chefshat import pb
from chefshat._gen.chefshat.v1 import instrument_service_pb2_grpc as instrument_grpc
from chefshat._gen.chefshat.v1 import play_service_pb2_grpc as play_grpc
from chefshat._gen.chefshat.v1 import record_service_pb2_grpc as record_grpc
from chefshat._gen.chefshat.v1 import room_service_pb2_grpc as room_grpc
from chefshat._gen.chefshat.v1 import server_service_pb2_grpc as server_grpc
from chefshat._gen.chefshat.v1 import spectator_service_pb2_grpc as spectator_grpc
from chefshat._gen.chefshat.v1 import tournament_service_pb2_grpc as tournament_grpc
from chefshat._gen.chefshat.v1 import vector_service_pb2_grpc as vector_grpc

# Maximum size of a message, bytes, as on the real server.
MAX_MESSAGE_BYTES = 64 * 1024
#: How far the clock is ahead of this machine's, seconds.
CLOCK_AHEAD_S = 1000
#: A certificate for this machine, which is its own authority.
TLS = Path(__file__).resolve().parents[3] / "tests" / "fixtures" / "tls"


class FakeServer(
    play_grpc.PlayServiceServicer,
    room_grpc.RoomServiceServicer,
    server_grpc.ServerServiceServicer,
    record_grpc.RecordServiceServicer,
    instrument_grpc.InstrumentServiceServicer,
):
    """The fake server; a context manager.

    `fault` is called with a game, a seat and an answer before the answer is taken. If it returns "before", the stream breaks
    without the answer having been taken; if "after", the answer is taken and the stream breaks before the acknowledgement.

    With a `token` it uses TLS and refuses every call without this token. Without one it listens on
    `host`; `port` 0 is a free one.
    """

    def __init__(self, token: str = "", host: str = "127.0.0.1", port: int = 0) -> None:
        self.games: list[FakeGame] = []
        self.created: list[pb.CreateRoomRequest] = []
        self.streams = 0
        self.broke_markers = False
        # Events that spectators no longer get, and from which event each stream was asked for.
        self.gone = 0
        self.watched_from: list[int] = []
        self.samples: list[pb.SampleChunk] = []
        self.questions = QUESTIONS
        self.fault: Callable[[FakeGame, FakeSeat, pb.Answer], str] = lambda game, seat, answer: ""
        self.guard = Guard(token)
        options = [
            ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
            # Answers any number of pings, as the real server does.
            ("grpc.http2.max_ping_strikes", 0),
        ]
        interceptors: list[grpc.ServerInterceptor] = [self.guard] if token else []
        self._server = grpc.server(futures.ThreadPoolExecutor(max_workers=32), options=options, interceptors=interceptors)
        play_grpc.add_PlayServiceServicer_to_server(self, self._server)
        room_grpc.add_RoomServiceServicer_to_server(self, self._server)
        server_grpc.add_ServerServiceServicer_to_server(self, self._server)
        record_grpc.add_RecordServiceServicer_to_server(self, self._server)
        instrument_grpc.add_InstrumentServiceServicer_to_server(self, self._server)
        spectator_grpc.add_SpectatorServiceServicer_to_server(_Spectators(self), self._server)
        self.tournaments = FakeTournaments(self._tournament_game)
        tournament_grpc.add_TournamentServiceServicer_to_server(self.tournaments, self._server)
        vector_grpc.add_VectorServiceServicer_to_server(ToyVector(), self._server)
        if token:
            files = ((TLS / "localhost.key").read_bytes(), (TLS / "localhost.pem").read_bytes())
            port = self._server.add_secure_port("127.0.0.1:0", grpc.ssl_server_credentials([files]))
            self.address = f"https://127.0.0.1:{port}"
        else:
            self.address = f"{host}:{self._server.add_insecure_port(f'{host}:{port}')}"

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop(grace=None).wait()

    # Rooms.

    def CreateRoom(self, request: pb.CreateRoomRequest, context: Context) -> pb.CreateRoomResponse:
        self.created.append(request)
        game = self._make_game(request)
        return pb.CreateRoomResponse(room=game.room, join_code=game.join_code, owner_token="owner")

    def _make_game(self, request: pb.CreateRoomRequest) -> FakeGame:
        game = FakeGame(len(self.games) + 1, request, self.questions)
        self.games.append(game)
        return game

    def _tournament_game(self, built_in: list[str]) -> FakeGame:
        """Creates a game of a tournament: built-in agents by seat, empty for participants."""
        return self._make_game(pb.CreateRoomRequest(seats=[pb.SeatConfig(built_in_agent=name) for name in built_in]))

    def GetRoom(self, request: pb.GetRoomRequest, context: Context) -> pb.GetRoomResponse:
        return pb.GetRoomResponse(room=self.game(request.room_id, context).room)

    def ListRooms(self, request: pb.ListRoomsRequest, context: Context) -> pb.ListRoomsResponse:
        """Pages of two rooms, newest first."""
        at = int(request.page_token or "0")
        page = [game.room for game in self.games[::-1][at : at + 2]]
        return pb.ListRoomsResponse(rooms=page, next_page_token=str(at + 2) if at + 2 < len(self.games) else "")

    def JoinRoom(self, request: pb.JoinRoomRequest, context: Context) -> pb.JoinRoomResponse:
        """Takes the first free seat."""
        found = [game for game in self.games if game.join_code == request.join_code]
        if not found:
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "JOIN_CODE_WRONG", "no room has this join code", field="join_code")
        game = found[0]
        with game.lock:
            for seat in game.seats.values():
                if not game.room.seats[seat.number].name:
                    game.room.seats[seat.number].name = request.name
                    return pb.JoinRoomResponse(room=game.room, seat=seat.number, ticket=seat.ticket)
        refuse(context, grpc.StatusCode.RESOURCE_EXHAUSTED, "ROOM_FULL", "every seat is taken")

    def LeaveRoom(self, request: pb.LeaveRoomRequest, context: Context) -> pb.LeaveRoomResponse:
        """Frees the seat of a ticket."""
        for game in self.games:
            for seat in game.seats.values():
                if seat.ticket == request.ticket and game.room.seats[seat.number].name:
                    with game.lock:
                        game.room.seats[seat.number].name = ""
                    return pb.LeaveRoomResponse(room=game.room)
        refuse(context, grpc.StatusCode.UNAUTHENTICATED, "TICKET_UNKNOWN", "no seat has this ticket", field="ticket")

    def CloseRoom(self, request: pb.CloseRoomRequest, context: Context) -> pb.CloseRoomResponse:
        if request.owner_token != "owner":
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "OWNER_TOKEN_WRONG", "not the token of this room's creator")
        game = self.game(request.room_id, context)
        with game.lock:
            game.end(pb.ABORT_REASON_CLOSED)
        return pb.CloseRoomResponse(room=game.room)

    def SetNextRoom(self, request: pb.SetNextRoomRequest, context: Context) -> pb.SetNextRoomResponse:
        return refuse(context, grpc.StatusCode.UNIMPLEMENTED, "UNIMPLEMENTED", "the tests of the SDK play no rematch")

    def game(self, room_id: str, context: Context) -> FakeGame:
        """Returns the game of a room; refuses with NOT_FOUND if there is none."""
        for game in self.games:
            if game.room.room_id == room_id:
                return game
        refuse(context, grpc.StatusCode.NOT_FOUND, "ROOM_UNKNOWN", "there is no such room", room_id=room_id)

    # Server and records.

    def GetServerInfo(self, request: pb.GetServerInfoRequest, context: Context) -> pb.GetServerInfoResponse:
        return pb.GetServerInfoResponse(server_version="fake", built_in_agents=["random", "random_unmasked", "greedy"])

    def GetActionTable(self, request: pb.GetActionTableRequest, context: Context) -> pb.GetActionTableResponse:
        """Returns the right number of texts; only the first one is correct."""
        space = pb.ActionSpace(id="chefshat-11", size=SIZE, turn_actions=200)
        return pb.GetActionTableResponse(action_space=space, texts=["C1;Q1;J0", *["?"] * (SIZE - 1)])

    def GetClock(self, request: pb.GetClockRequest, context: Context) -> pb.GetClockResponse:
        """The time of day, `CLOCK_AHEAD_S` ahead of the true one. All rooms were created at the true start of 1970."""
        now = round(time.time() * 1e6)
        ahead = CLOCK_AHEAD_S * 1_000_000
        response = pb.GetClockResponse(received_at_us=now + ahead, sent_at_us=now + ahead)
        if request.room_id:
            game_id = self.game(request.room_id, context).room.game_id
            clock = pb.RoomClock(game_id=game_id, created_at_ms=CLOCK_AHEAD_S * 1000, received_us=now, sent_us=now)
            response.room.CopyFrom(clock)
        return response

    # Markers.

    def AddMarker(self, request: pb.AddMarkerRequest, context: Context) -> pb.AddMarkerResponse:
        """Adds a marker. Without a moment it marks the start of the room."""
        game = self._owned(request.room_id, request.owner_token, context)
        with game.lock:
            marker = pb.Marker(number=len(game.markers) + 1, label=request.label, elapsed_us=request.elapsed_us)
            game.markers.append(marker)
            game.changed.notify_all()
        return pb.AddMarkerResponse(marker=marker)

    def FollowMarkers(self, request: pb.FollowMarkersRequest, context: Context) -> Iterator[pb.FollowMarkersResponse]:
        """Streams the markers, each in a message; breaks after the first, once."""
        game = self._owned(request.room_id, request.owner_token, context)
        sent = max(request.from_number - 1, 0)
        while context.is_active():
            with game.lock:
                if len(game.markers) <= sent and not game.over:
                    game.changed.wait(timeout=0.2)
                markers, over = game.markers[sent:], game.over
            yield pb.FollowMarkersResponse(markers=markers[:1])
            sent += len(markers[:1])
            if sent == 1 and not self.broke_markers:
                self.broke_markers = True
                context.abort(grpc.StatusCode.UNAVAILABLE, "the stream was broken on purpose")
            if over and sent == len(game.markers):
                return

    def AddSamples(self, request: pb.AddSamplesRequest, context: Context) -> pb.AddSamplesResponse:
        """Keeps the chunks of a seat."""
        found = self.find(request.ticket)
        if found is None:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, "TICKET_UNKNOWN", "no seat has this ticket")
        self.samples.append(request.chunk)
        return pb.AddSamplesResponse(recorded=len(request.chunk.elapsed_us))

    def _owned(self, room_id: str, owner_token: str, context: Context) -> FakeGame:
        if owner_token != "owner":
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "OWNER_TOKEN_WRONG", "not the token of this room's creator")
        return self.game(room_id, context)

    def ListRecords(self, request: pb.ListRecordsRequest, context: Context) -> pb.ListRecordsResponse:
        """Pages of two games of rooms with a name, finished or not."""
        wanted = request.filter.room_name
        games = [game for game in self.games if not wanted or game.room.name == wanted]
        if request.newest_first:
            games.reverse()
        at = int(request.page_token or "0")
        page = [pb.RecordSummary(game_id=game.room.game_id, room_name=game.room.name) for game in games[at : at + 2]]
        return pb.ListRecordsResponse(records=page, next_page_token=str(at + 2) if at + 2 < len(games) else "")

    def GetRecord(self, request: pb.GetRecordRequest, context: Context) -> Iterator[pb.GetRecordResponse]:
        """Streams the events of a finished game, between a header and a footer."""
        for game in self.games:
            if game.room.game_id == request.game_id:
                yield pb.GetRecordResponse(lines=[pb.RecordLine(header=pb.RecordHeader(game_id=request.game_id))])
                yield pb.GetRecordResponse(lines=[pb.RecordLine(event=event) for event in game.events])
                yield pb.GetRecordResponse(lines=[pb.RecordLine(footer=pb.RecordFooter(events=len(game.events)))])
                return
        refuse(context, grpc.StatusCode.NOT_FOUND, "GAME_UNKNOWN", "there is no such game")

    def StreamRecords(self, request: pb.StreamRecordsRequest, context: Context) -> NoReturn:
        """Unused: the package fetches records one by one."""
        context.abort(grpc.StatusCode.UNIMPLEMENTED, "the package does not use it")
        raise AssertionError("abort always raises")

    def ImportRecord(self, request_iterator: Iterator[pb.ImportRecordRequest], context: Context) -> NoReturn:
        """Unused: the package adds no records."""
        context.abort(grpc.StatusCode.UNIMPLEMENTED, "the package does not use it")
        raise AssertionError("abort always raises")

    # Playing.

    def Play(self, request_iterator: Iterator[pb.PlayRequest], context: Context) -> Iterator[pb.PlayResponse]:
        self.streams += 1
        outbox: Outbox = queue.SimpleQueue()
        broken = threading.Event()
        threading.Thread(target=self._read, args=(request_iterator, outbox, broken), daemon=True).start()
        context.send_initial_metadata(())
        while (update := outbox.get()) is not None:
            updates = [update]
            while not outbox.empty():
                more = outbox.get()
                if more is None:
                    outbox.put(None)
                    break
                updates.append(more)
            yield pb.PlayResponse(updates=updates)
        if broken.is_set():
            context.abort(grpc.StatusCode.UNAVAILABLE, "the stream was broken on purpose")

    def Watch(self, request: pb.PlayServiceWatchRequest, context: Context) -> NoReturn:
        """Unused: the package uses `Play`."""
        context.abort(grpc.StatusCode.UNIMPLEMENTED, "the package does not use it")
        raise AssertionError("abort always raises")

    def Act(self, request: pb.ActRequest, context: Context) -> pb.ActResponse:
        """Records an expression as an event."""
        found = self.find(request.ticket)
        if found is None:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, "TICKET_UNKNOWN", "no seat has this ticket")
        game, seat = found
        with game.lock:
            game.add(expression_shown=pb.ExpressionShown(seat=seat.number, expression=request.express))
        return pb.ActResponse()

    def find(self, ticket: str) -> tuple[FakeGame, FakeSeat] | None:
        """Returns the seat of a ticket."""
        for game in self.games:
            for seat in game.seats.values():
                if seat.ticket == ticket:
                    return game, seat
        return None

    def _read(self, requests: Iterator[pb.PlayRequest], outbox: Outbox, broken: threading.Event) -> None:
        """Reads the commands of a stream until it ends or a fault breaks it."""
        stream = Stream(outbox)
        try:
            for request in requests:
                for command in request.commands:
                    if command.HasField("attach"):
                        self._attach(command.attach, stream)
                    elif command.HasField("answer") and not self._answer(command, stream):
                        broken.set()
                        return
        except grpc.RpcError:
            pass  # The client has cancelled.
        finally:
            for game, seat in list(stream.seats.values()):
                with game.lock:
                    if seat.outbox is outbox:
                        seat.outbox = None
            self.tournaments.left(stream)
            outbox.put(None)

    def _attach(self, attach: pb.Attach, stream: Stream) -> None:
        handle = stream.attaches
        stream.attaches += 1
        found = self.find(attach.ticket)
        if found is None:
            if not self.tournaments.enter(attach, stream, handle):
                refused = pb.Refused(request_id=attach.request_id, reason="TICKET_UNKNOWN", message="no seat has this ticket")
                stream.send(handle, refused=refused)
            return
        game, seat = found
        with game.lock:
            stream.seats[handle] = found
            game.attach(seat, attach, stream.outbox, handle)

    def _answer(self, command: pb.SeatCommand, stream: Stream) -> bool:
        """Takes an answer. Returns whether the stream continues."""
        game, seat = stream.seats[command.handle]
        with game.lock:
            fault = self.fault(game, seat, command.answer)
            if fault == "before":
                return False
            was_open = seat.open
            result = game.answer(seat, command.answer)
            if fault == "after":
                seat.outbox = None
            if seat.outbox is stream.outbox:
                game.send(seat, result=result)
            if was_open and not seat.open:
                game.advance()
        if game.over:
            self.tournaments.settle()
        return fault != "after"


class _Spectators(spectator_grpc.SpectatorServiceServicer):
    """The spectator service, in a separate class because both services have a `Watch`."""

    def __init__(self, server: FakeServer) -> None:
        self._server = server

    def Watch(self, request: pb.SpectatorServiceWatchRequest, context: Context) -> Iterator[pb.SpectatorServiceWatchResponse]:
        game = self._server.game(request.room_id, context)
        sent = max(request.from_sequence - 1, 0)
        self._server.watched_from.append(request.from_sequence)
        if sent < self._server.gone:
            yield pb.SpectatorServiceWatchResponse(room=game.room, snapshot=pb.Snapshot(next_sequence=self._server.gone + 1))
            context.abort(grpc.StatusCode.UNAVAILABLE, "the connection is lost")
        yield pb.SpectatorServiceWatchResponse(room=game.room)
        while context.is_active():
            with game.lock:
                if len(game.events) <= sent and not game.over:
                    game.changed.wait(timeout=0.2)
                events, over = game.events[sent:], game.over
            yield pb.SpectatorServiceWatchResponse(events=events)
            sent += len(events)
            if over:
                return
