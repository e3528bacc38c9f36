"""A server in Python that plays a toy game over the real protocol, and can be told to misbehave.

The toy game asks every seat that is played over the wire the same number of questions, seat after seat, and ends with a table in
seat order. It knows nothing of cards: which actions are legal is made up. It remembers what arrived, so that tests can ask.
"""

import queue
import threading
from collections.abc import Callable, Iterator
from concurrent import futures
from dataclasses import dataclass, field
from typing import Any, NoReturn, Self, TypeAlias

import grpc
from google.protobuf import any_pb2
from google.rpc import error_details_pb2, status_pb2

from chefshat import pb
from chefshat._gen.chefshat.v1 import play_service_pb2_grpc as play_grpc
from chefshat._gen.chefshat.v1 import record_service_pb2_grpc as record_grpc
from chefshat._gen.chefshat.v1 import room_service_pb2_grpc as room_grpc
from chefshat._gen.chefshat.v1 import server_service_pb2_grpc as server_grpc
from chefshat._gen.chefshat.v1 import spectator_service_pb2_grpc as spectator_grpc

SEATS = 4
SIZE = 214
MAX_INVALID = 3
# Questions a seat is asked unless the test says otherwise.
QUESTIONS = 5

Context = grpc.ServicerContext
Outbox = queue.SimpleQueue[pb.SeatUpdate | None]


def refuse(context: Context, code: grpc.StatusCode, reason: str, message: str, **metadata: str) -> NoReturn:
    """Ends a call the way the protocol says: with google.rpc.ErrorInfo."""
    detail = any_pb2.Any()
    detail.Pack(error_details_pb2.ErrorInfo(reason=reason, domain="chefshat", metadata=metadata))
    status = status_pb2.Status(code=code.value[0], message=message, details=[detail])
    context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()),))
    context.abort(code, message)
    raise AssertionError("abort always raises")


def legal(decision_id: int) -> set[int]:
    """The actions that are legal at a seat's decision: two, and different ones each time."""
    return {decision_id % SIZE, (decision_id * 37 + 100) % SIZE}


def mask(decision_id: int) -> bytes:
    """The same as a mask."""
    return sum(1 << action for action in legal(decision_id)).to_bytes((SIZE + 7) // 8, "little")


@dataclass
class FakeSeat:
    """One seat of the toy game."""

    number: int
    ticket: str
    outbox: Outbox | None = None
    handle: int = 0
    told: int = 0
    decision_id: int = 0
    open: bool = False
    attempts_left: int = MAX_INVALID
    last: pb.AnswerResult | None = None
    answers: list[pb.Answer] = field(default_factory=list)
    attaches: list[pb.Attach] = field(default_factory=list)


class FakeGame:
    """The toy game of one room. All methods want `lock` held."""

    def __init__(self, number: int, request: pb.CreateRoomRequest, questions: int) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.questions = questions
        self.join_code = f"CODE{number}"
        self.room = pb.Room(
            room_id=f"{number:032x}", game_id=f"{number + 4096:032x}", name=request.name, state=pb.ROOM_STATE_WAITING
        )
        built_in = [config.built_in_agent for config in request.seats] or [""] * SEATS
        for seat, agent in enumerate(built_in):
            self.room.seats.add(seat=seat, built_in_agent=agent, name=agent)
        self.seats = {seat: FakeSeat(seat, f"ticket-{number}-{seat}") for seat, agent in enumerate(built_in) if not agent}
        self.events: list[pb.GameEvent] = []
        self.over = False

    def add(self, **kind: Any) -> None:
        """Adds an event."""
        self.events.append(pb.GameEvent(sequence=len(self.events) + 1, **kind))
        self.changed.notify_all()

    def tell(self, seat: FakeSeat, **update: Any) -> None:
        """Tells a seat something, if it is attached."""
        if seat.outbox is not None:
            seat.outbox.put(pb.SeatUpdate(handle=seat.handle, **update))

    def tell_events(self, seat: FakeSeat) -> None:
        """Tells a seat the events it has not been told."""
        if self.events[seat.told :]:
            self.tell(seat, events=pb.EventBatch(events=self.events[seat.told :]))
            seat.told = len(self.events)

    def attach(self, seat: FakeSeat, attach: pb.Attach, outbox: Outbox, handle: int) -> None:
        """Attaches a seat to a stream and starts or resumes the game."""
        self.tell(seat, detached=pb.Detached(reason=pb.DETACH_REASON_SUPERSEDED))
        seat.outbox, seat.handle, seat.told = outbox, handle, max(attach.from_sequence - 1, 0)
        seat.attaches.append(attach)
        attached = pb.Attached(
            request_id=attach.request_id,
            room_id=self.room.room_id,
            game_id=self.room.game_id,
            seat=seat.number,
            next_sequence=len(self.events) + 1,
        )
        self.tell(seat, attached=attached)
        if self.over:
            self.tell_events(seat)
            self.tell(seat, detached=pb.Detached(reason=pb.DETACH_REASON_GAME_OVER))
        elif self.room.state == pb.ROOM_STATE_PLAYING:
            self.tell_events(seat)
            if seat.open:
                self.ask(seat)
        elif all(other.outbox is not None for other in self.seats.values()):
            self.room.state = pb.ROOM_STATE_PLAYING
            self.add(game_started=pb.GameStarted(game_id=self.room.game_id, hand_size=17, seats=self.room.seats))
            self.advance()

    def advance(self) -> None:
        """Asks the next seat, or ends the game."""
        seat = min(self.seats.values(), key=lambda seat: (seat.decision_id, seat.number))
        if seat.decision_id == self.questions:
            self.end()
            return
        seat.decision_id += 1
        seat.open, seat.attempts_left = True, MAX_INVALID
        self.ask(seat)

    def ask(self, seat: FakeSeat) -> None:
        """Puts the open decision to its seat."""
        self.tell_events(seat)
        observation = pb.Observation(
            shift=1,
            pizza=1,
            hand=bytes([0, 1, 0, 2, 0, 0, 0, 0, 0, 0, 3, 1]),
            board_face=0,
            cards_left=bytes([7] * SEATS),
            passed=bytes(SEATS),
            places=bytes(SEATS),
            roles=bytes(SEATS),
            points=[0] * SEATS,
            played=bytes(12),
        )
        request = pb.DecisionRequest(
            decision_id=seat.decision_id,
            kind=pb.DECISION_KIND_TURN,
            observation=observation,
            action_mask=mask(seat.decision_id),
            time_left_ms=10_000,
            bank_left_ms=60_000,
            invalid_attempts_left=seat.attempts_left,
        )
        self.tell(seat, decision=request)

    def answer(self, seat: FakeSeat, answer: pb.Answer) -> pb.AnswerResult:
        """Takes an answer; the result is the caller's to pass on, and `advance` is called already."""
        seat.answers.append(answer)
        result = pb.AnswerResult(decision_id=answer.decision_id, action=answer.action)
        if seat.last is not None and (seat.last.decision_id, seat.last.action) == (answer.decision_id, answer.action):
            return seat.last  # The same answer twice: the same acknowledgement.
        if answer.decision_id > seat.decision_id:
            result.status = pb.ANSWER_STATUS_UNKNOWN_DECISION
        elif answer.decision_id < seat.decision_id or not seat.open:
            result.status = pb.ANSWER_STATUS_CLOSED
        elif answer.action in legal(answer.decision_id):
            result.status = pb.ANSWER_STATUS_ACCEPTED
            seat.last, seat.open = result, False
            self.add(play=pb.Play(seat=seat.number, action=answer.action, source=pb.DECISION_SOURCE_AGENT))
        else:
            seat.attempts_left -= 1
            result.status = pb.ANSWER_STATUS_INVALID
            result.invalid_attempts_left = seat.attempts_left
            if seat.attempts_left == 0:
                seat.open = False
                self.add(play=pb.Play(seat=seat.number, action=min(legal(answer.decision_id)), source=pb.DECISION_SOURCE_INVALID))
        return result

    def end(self, reason: pb.AbortReason.ValueType | None = None) -> None:
        """Ends the game: with a table, or aborted for a reason."""
        self.over = True
        if reason is None:
            self.room.state = pb.ROOM_STATE_FINISHED
            self.add(shift_ended=pb.ShiftEnded(shift=1, order=range(SEATS), scores=[5, 3, 1, 0]))
            table = [pb.Standing(seat=seat, points=points, place=seat + 1) for seat, points in enumerate([5, 3, 1, 0])]
            self.add(game_ended=pb.GameEnded(standings=table))
        else:
            self.room.state = pb.ROOM_STATE_ABORTED
            self.add(game_aborted=pb.GameAborted(reason=reason))
        for seat in self.seats.values():
            self.tell_events(seat)
            self.tell(seat, detached=pb.Detached(reason=pb.DETACH_REASON_GAME_OVER))


# The seats of a stream by handle: every Attach has a number, a refused one too.
Handles: TypeAlias = list[tuple[FakeGame, FakeSeat] | None]


class FakeServer(
    play_grpc.PlayServiceServicer,
    room_grpc.RoomServiceServicer,
    server_grpc.ServerServiceServicer,
    record_grpc.RecordServiceServicer,
):
    """The fake server; a context manager.

    `fault` is called with a game, a seat and an answer before the answer is taken. If it returns "before", the stream breaks
    without the answer having been taken; if "after", the answer is taken and the stream breaks before anybody is told.
    """

    def __init__(self) -> None:
        self.games: list[FakeGame] = []
        self.streams = 0
        self.questions = QUESTIONS
        self.fault: Callable[[FakeGame, FakeSeat, pb.Answer], str] = lambda game, seat, answer: ""
        self._server = grpc.server(futures.ThreadPoolExecutor(max_workers=32))
        play_grpc.add_PlayServiceServicer_to_server(self, self._server)
        room_grpc.add_RoomServiceServicer_to_server(self, self._server)
        server_grpc.add_ServerServiceServicer_to_server(self, self._server)
        record_grpc.add_RecordServiceServicer_to_server(self, self._server)
        spectator_grpc.add_SpectatorServiceServicer_to_server(_Spectators(self), self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop(grace=None).wait()

    # Rooms.

    def CreateRoom(self, request: pb.CreateRoomRequest, context: Context) -> pb.CreateRoomResponse:
        """Makes a room."""
        game = FakeGame(len(self.games) + 1, request, self.questions)
        self.games.append(game)
        return pb.CreateRoomResponse(room=game.room, join_code=game.join_code, owner_token="owner")

    def GetRoom(self, request: pb.GetRoomRequest, context: Context) -> pb.GetRoomResponse:
        """One room."""
        return pb.GetRoomResponse(room=self.game(request.room_id, context).room)

    def ListRooms(self, request: pb.ListRoomsRequest, context: Context) -> pb.ListRoomsResponse:
        """Rooms, two a page."""
        at = int(request.page_token or "0")
        page = [game.room for game in self.games[at : at + 2]]
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

    def CloseRoom(self, request: pb.CloseRoomRequest, context: Context) -> pb.CloseRoomResponse:
        """Aborts the game."""
        if request.owner_token != "owner":
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "OWNER_TOKEN_WRONG", "not the token of this room's creator")
        game = self.game(request.room_id, context)
        with game.lock:
            game.end(pb.ABORT_REASON_CLOSED)
        return pb.CloseRoomResponse(room=game.room)

    def game(self, room_id: str, context: Context) -> FakeGame:
        """The game of a room, or NOT_FOUND."""
        for game in self.games:
            if game.room.room_id == room_id:
                return game
        refuse(context, grpc.StatusCode.NOT_FOUND, "ROOM_UNKNOWN", "there is no such room", room_id=room_id)

    # Server and records.

    def GetServerInfo(self, request: pb.GetServerInfoRequest, context: Context) -> pb.GetServerInfoResponse:
        """Says that it is fake."""
        return pb.GetServerInfoResponse(server_version="fake", built_in_agents=["random", "random_unmasked", "greedy"])

    def GetActionTable(self, request: pb.GetActionTableRequest, context: Context) -> pb.GetActionTableResponse:
        """The right number of texts, the right first one."""
        space = pb.ActionSpace(id="chefshat-11", size=SIZE, turn_actions=200)
        return pb.GetActionTableResponse(action_space=space, texts=["C1;Q1;J0", *["?"] * (SIZE - 1)])

    def GetRecord(self, request: pb.GetRecordRequest, context: Context) -> Iterator[pb.GetRecordResponse]:
        """The events of a game that is over, between a header and a footer."""
        for game in self.games:
            if game.room.game_id == request.game_id:
                yield pb.GetRecordResponse(lines=[pb.RecordLine(header=pb.RecordHeader(game_id=request.game_id))])
                yield pb.GetRecordResponse(lines=[pb.RecordLine(event=event) for event in game.events])
                yield pb.GetRecordResponse(lines=[pb.RecordLine(footer=pb.RecordFooter(events=len(game.events)))])
                return
        refuse(context, grpc.StatusCode.NOT_FOUND, "GAME_UNKNOWN", "there is no such game")

    # Playing.

    def Play(self, request_iterator: Iterator[pb.PlayRequest], context: Context) -> Iterator[pb.PlayResponse]:
        """One stream of seats."""
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
        """Not for clients that can stream."""
        context.abort(grpc.StatusCode.UNIMPLEMENTED, "the package does not use it")
        raise AssertionError("abort always raises")

    def Act(self, request: pb.ActRequest, context: Context) -> pb.ActResponse:
        """Notes an expression as an event."""
        found = self.find(request.ticket)
        if found is None:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, "TICKET_UNKNOWN", "no seat has this ticket")
        game, seat = found
        with game.lock:
            game.add(expression_shown=pb.ExpressionShown(seat=seat.number, expression=request.express))
        return pb.ActResponse()

    def find(self, ticket: str) -> tuple[FakeGame, FakeSeat] | None:
        """The seat of a ticket."""
        for game in self.games:
            for seat in game.seats.values():
                if seat.ticket == ticket:
                    return game, seat
        return None

    def _read(self, requests: Iterator[pb.PlayRequest], outbox: Outbox, broken: threading.Event) -> None:
        """Reads a stream's commands until it ends, or until a fault breaks it."""
        handles: Handles = []
        try:
            for request in requests:
                for command in request.commands:
                    if command.HasField("attach"):
                        self._attach(command.attach, outbox, handles)
                    elif command.HasField("answer") and not self._answer(command, outbox, handles):
                        broken.set()
                        return
        except grpc.RpcError:
            pass  # The client has cancelled.
        finally:
            for game, seat in filter(None, handles):
                with game.lock:
                    if seat.outbox is outbox:
                        seat.outbox = None
            outbox.put(None)

    def _attach(self, attach: pb.Attach, outbox: Outbox, handles: Handles) -> None:
        found = self.find(attach.ticket)
        handles.append(found)
        if found is None:
            refused = pb.Refused(request_id=attach.request_id, reason="TICKET_UNKNOWN", message="no seat has this ticket")
            outbox.put(pb.SeatUpdate(handle=len(handles) - 1, refused=refused))
            return
        game, seat = found
        with game.lock:
            game.attach(seat, attach, outbox, len(handles) - 1)

    def _answer(self, command: pb.SeatCommand, outbox: Outbox, handles: Handles) -> bool:
        """Takes an answer; returns whether the stream goes on."""
        found = handles[command.handle]
        assert found is not None
        game, seat = found
        with game.lock:
            fault = self.fault(game, seat, command.answer)
            if fault == "before":
                return False
            was_open = seat.open
            result = game.answer(seat, command.answer)
            if fault == "after":
                seat.outbox = None
            if seat.outbox is outbox:
                game.tell(seat, result=result)
            if was_open and not seat.open:
                game.advance()
            return fault != "after"


class _Spectators(spectator_grpc.SpectatorServiceServicer):
    """Watching; a class of its own because both services have a `Watch`."""

    def __init__(self, server: FakeServer) -> None:
        self._server = server

    def Watch(self, request: pb.SpectatorServiceWatchRequest, context: Context) -> Iterator[pb.SpectatorServiceWatchResponse]:
        """The events of a room until its game is over."""
        game = self._server.game(request.room_id, context)
        told = max(request.from_sequence - 1, 0)
        yield pb.SpectatorServiceWatchResponse(room=game.room)
        while context.is_active():
            with game.lock:
                if len(game.events) <= told and not game.over:
                    game.changed.wait(timeout=0.2)
                events, over = game.events[told:], game.over
            yield pb.SpectatorServiceWatchResponse(events=events)
            told += len(events)
            if over:
                return
