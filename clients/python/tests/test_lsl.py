"""Markers for the Lab Streaming Layer: a real server and a real inlet.

All times that are compared come from clocks that were read: how fast the tests run does not matter.
"""

import json
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any, cast

import pytest
from waiting import LIMIT_S

import chefshat
from chefshat import Client, RandomAgent, pb
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import ParticipationServiceStub, StudyServiceStub
from chefshat.clock import DRIFT, WANTED_ERROR_S, RoomClock
from chefshat.network import grpc

pylsl = pytest.importorskip("pylsl")

from chefshat import lsl  # noqa: E402 (needs pylsl)

pytestmark = pytest.mark.server

# How far the time of day, which systems correct, may be off during a game, seconds.
TIME_OF_DAY_S = 1.0
# Events have times in milliseconds.
ROUNDING_S = 0.001
ONE_SHIFT = pb.RuleSet(target_shifts=1)
# The kinds of events: their names in JSON, and those of a seat.
KINDS = {field.name: field.json_name for field in pb.GameEvent.DESCRIPTOR.oneofs_by_name["kind"].fields}
WITH_SEAT = {name for name in KINDS if "seat" in type(getattr(pb.GameEvent(), name)).DESCRIPTOR.fields_by_name}


def inlet(source: str) -> Any:
    """An inlet that receives the stream with this id."""
    found = pylsl.resolve_byprop("source_id", source, timeout=LIMIT_S)
    assert found, f"no stream {source!r}"
    opened = pylsl.StreamInlet(found[0])
    opened.open_stream(timeout=LIMIT_S)
    return opened


def received(stream: Any) -> Iterator[tuple[dict[str, Any], float]]:
    """The markers of a stream and their times, until the game is over."""
    while True:
        sample, at = stream.pull_sample(timeout=LIMIT_S)
        assert sample is not None, "no marker"
        code, event = sample
        marker = json.loads(event)
        kind, *seat = code.split()
        inside = marker[KINDS[kind]]
        assert seat == ([str(inside.get("seat", 0))] if kind in WITH_SEAT else [])
        yield marker, at
        if "gameEnded" in marker or "gameAborted" in marker:
            return


def seated(client: chefshat.Client) -> tuple[pb.Room, list[str], str]:
    """A room with four seats that are taken, their tickets, and the join code."""
    created = client.rooms.create("markers", rules=ONE_SHIFT)
    tickets = [client.rooms.join(created.join_code, f"agent {seat}").ticket for seat in range(4)]
    return created.room, tickets, created.join_code


def time_of_day() -> float:
    """How far the time of day is ahead of LSL's clock, seconds."""
    return time.time() - float(pylsl.local_clock())


def check_times(client: chefshat.Client, room: pb.Room, markers: list[tuple[dict[str, Any], float]], error: float) -> None:
    """Compares the times of markers with those of the record, whose clock the stream knows to `error`."""
    clock = client.read_clock(room.room_id, local=pylsl.local_clock)
    ahead = time_of_day()
    header, *_ = list(client.records.read(room.game_id))
    for marker, at in markers:
        elapsed_ms = int(marker.get("elapsedMs", 0))
        assert abs(at - clock.local(elapsed_ms)) <= error + clock.error + ROUNDING_S
        recorded = (header.header.created_at_ms + elapsed_ms) / 1e3
        assert abs(at + ahead - recorded) <= TIME_OF_DAY_S


def test_each_event_of_the_record_is_one_marker_with_its_time(real_address: str) -> None:
    with chefshat.Client(real_address) as client, ThreadPoolExecutor(2) as threads:
        room, tickets, _ = seated(client)
        markers = lsl.MarkerStream(client, room.room_id)
        stream = inlet(markers.source)
        assert markers.wait_for_recorder(LIMIT_S)
        playing = threads.submit(client.play_many, {ticket: RandomAgent(seat) for seat, ticket in enumerate(tickets)})

        def watch() -> None:
            for event in client.rooms.watch(room.room_id):
                markers.push(event)
                markers.push(event)  # A repetition is not sent.

        watching = threads.submit(watch)
        sent = list(received(stream))
        playing.result()
        watching.result()
        assert all(result.finished for result in playing.result().values())
        recorded = [line.event for line in client.records.read(room.game_id) if line.HasField("event")]
        assert [int(marker["sequence"]) for marker, _ in sent] == [event.sequence for event in recorded]
        camel = {name: field.json_name for name, field in pb.GameEvent.DESCRIPTOR.fields_by_name.items()}
        for (marker, _), event in zip(sent, recorded, strict=True):
            assert camel[str(event.WhichOneof("kind"))] in marker
            assert int(marker.get("elapsedMs", 0)) == event.elapsed_ms
            # A spectator sees no hands.
            assert "hands" not in marker.get("shiftStarted", {})
        check_times(client, room, sent, markers.clock.reading.error)
        description = stream.info(timeout=LIMIT_S).desc().child("game")
        assert description.child_value("room_id") == room.room_id
        assert description.child_value("game_id") == room.game_id
        assert description.child_value("viewer") == "spectator"
        markers.close()
        with pytest.raises(ValueError, match="closed"):
            markers.push(pb.GameEvent(sequence=1_000_000))


def test_the_clock_is_read_again_and_keeps_the_better_reading(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("clock").room
        with RoomClock(client, room.room_id, local=pylsl.local_clock, interval_s=0.01) as clock:
            first = clock.reading
            until = time.monotonic() + LIMIT_S
            while clock.readings < 10 and time.monotonic() < until:
                time.sleep(0.01)
            assert clock.readings >= 10
            assert clock.reading.error <= first.error + DRIFT * LIMIT_S
            now = clock.reading
            assert abs(now.local(0) - first.local(0)) <= now.error + first.error + DRIFT * LIMIT_S


def test_a_seat_sends_what_it_sees(real_address: str) -> None:
    with chefshat.Client(real_address) as client, ThreadPoolExecutor(1) as threads:
        room, tickets, _ = seated(client)
        marked = lsl.MarkedAgent(RandomAgent(1), client, wait_s=LIMIT_S)
        agents = {tickets[0]: marked, **{ticket: RandomAgent(2) for ticket in tickets[1:]}}
        playing = threads.submit(client.play_many, agents)
        stream = inlet(f"chefshat {room.game_id} seat 0")
        sent = list(received(stream))
        assert all(result.finished for result in playing.result().values())
        events = [line.event for line in client.records.read(room.game_id) if line.HasField("event")]
        assert [int(marker["sequence"]) for marker, _ in sent] == [event.sequence for event in events]
        (hands,) = [marker["shiftStarted"]["hands"] for marker, _ in sent if "shiftStarted" in marker]
        assert [hand.get("seat", 0) for hand in hands] == [0]
        clock = client.read_clock(room.room_id, local=pylsl.local_clock)
        check_times(client, room, sent, max(clock.error, WANTED_ERROR_S))
        marked.close()


def test_the_command_sends_a_room_by_its_join_code(real_address: str, processes: list[Popen[str]], tmp_path: Path) -> None:
    with chefshat.Client(real_address) as client:
        room, tickets, code = seated(client)
        command = [sys.executable, "-m", "chefshat.lsl", "--address", real_address, "--room", code, "--wait"]
        process = Popen(command, text=True, stdout=PIPE, stderr=PIPE, cwd=tmp_path)
        processes.append(process)
        stream = inlet(f"chefshat {room.game_id} spectator")
        playing = threading.Thread(target=client.play_many, args=({ticket: RandomAgent(3) for ticket in tickets},))
        playing.start()
        sent = [int(marker["sequence"]) for marker, _ in received(stream)]
        playing.join()
        stream.close_stream()
        out, err = process.communicate(timeout=LIMIT_S)
        assert process.returncode == 0, err
        assert out == ""
        assert "the game is over" in err
        assert sent == list(range(1, len(sent) + 1))


class Participant:
    """A participant of a study, who does what the study shows."""

    def __init__(self, address: str, link: str) -> None:
        self.channel = grpc.insecure_channel(address.removeprefix("http://"))
        self.service = ParticipationServiceStub(self.channel)
        opened = self.service.OpenStudy(pb.OpenStudyRequest(link=link))
        self.session, self.view = opened.session, opened.view

    def game(self) -> pb.StudyShownGame:
        """Waits for the room of the game that is due."""
        for response in self.service.FollowParticipation(pb.FollowParticipationRequest(session=self.session)):
            if response.HasField("view") and response.view.game.ticket:
                self.view = response.view
                return response.view.game
        raise AssertionError("the study ended")

    def go_on(self) -> None:
        """Waits for the end of the game, and continues."""
        for response in self.service.FollowParticipation(pb.FollowParticipationRequest(session=self.session)):
            if response.HasField("view") and response.view.game.ended:
                break
        request = pb.ContinueStudyRequest(session=self.session, step=self.view.step)
        self.view = self.service.ContinueStudy(request).view


@pytest.mark.parametrize("state", ["COMPLETED", "WITHDRAWN", "REMOVED", "SCREENED_OUT"])
def test_a_participation_that_is_over_has_no_more_games(state: str) -> None:
    class Followed:
        @property
        def studies(self) -> "Followed":
            return self

        def follow(self, study_id: str, owner_token: str) -> Iterator[pb.StudyParticipant]:
            assert (study_id, owner_token) == ("study", "owner")
            yield pb.StudyParticipant(number=3, state=pb.StudyParticipantState.Value(f"STUDY_PARTICIPANT_STATE_{state}"))
            raise AssertionError("it goes on")

    assert lsl.next_game(cast(Client, Followed()), "study", "owner", 3, set()) is None


def test_the_command_sends_all_games_of_a_participant_of_a_study(
    real_address: str, processes: list[Popen[str]], tmp_path: Path
) -> None:
    condition = pb.StudyCondition(
        id="cold", rules=ONE_SHIFT, policy=pb.RoomPolicy(pace_ms=0), seats=[pb.SeatConfig(built_in_agent="random")] * 3
    )
    settings = pb.StudySettings(
        name="warmth",
        title="Cards",
        participants=1,
        conditions=[condition],
        stages=[pb.StudyStage(games=pb.StudyGames(count=2))],
    )
    with chefshat.Client(real_address) as client:
        channel = grpc.insecure_channel(real_address.removeprefix("http://"))
        studies = StudyServiceStub(channel)
        made = studies.CreateStudy(pb.CreateStudyRequest(settings=settings))
        study_id, owner_token = made.study.study_id, made.owner_token
        request = pb.AddStudyParticipantsRequest(study_id=study_id, owner_token=owner_token, count=1)
        added = studies.AddStudyParticipants(request)
        command = [sys.executable, "-m", "chefshat.lsl", "--address", real_address, "--study", made.study.study_id]
        command += ["--participant", "1", "--secret", made.owner_token, "--wait"]
        processes.append(Popen(command, text=True, stdout=PIPE, stderr=PIPE, cwd=tmp_path))
        person = Participant(real_address, added.links[0].link)
        stream: Any = None
        for _ in range(2):
            game = person.game()
            stream = stream or inlet(f"chefshat {made.study.study_id} participant 1")
            result = client.play(RandomAgent(1), game.ticket)
            assert result.finished
            sent = list(received(stream))
            person.go_on()
            with chefshat.Client(real_address, secrets=[made.owner_token]) as owner:
                events = [line.event for line in owner.records.read(game.game_id) if line.HasField("event")]
                assert [int(marker["sequence"]) for marker, _ in sent] == [event.sequence for event in events]
                room = pb.Room(room_id=game.room_id, game_id=game.game_id)
                clock = owner.read_clock(game.room_id, local=pylsl.local_clock)
                check_times(owner, room, sent, max(clock.error, WANTED_ERROR_S))
        studies.CloseStudy(pb.CloseStudyRequest(study_id=study_id, owner_token=owner_token))
        _, said = processes[-1].communicate(timeout=LIMIT_S)
        assert processes[-1].returncode == 0, said
        assert "participant 1 has finished" in said
        channel.close()
