"""Markers that a room's owner puts into its record, and following them across lost streams."""

import pytest

import chefshat
import chefshat.clock
from chefshat import Backoff, ChefsHatError, aio

QUICK = Backoff(first_s=0.001, max_s=0.05, attempts=100)


def test_markers_reach_the_owner_once_and_in_order(address: str) -> None:
    with chefshat.Client(address, backoff=QUICK) as client:
        created = client.rooms.create("markers")
        room_id, owner = created.room.room_id, created.owner_token
        sent = [client.rooms.add_marker(room_id, owner, f"stimulus {number}", elapsed_us=number) for number in range(1, 5)]
        assert [(marker.number, marker.elapsed_us) for marker in sent] == [(1, 1), (2, 2), (3, 3), (4, 4)]
        with pytest.raises(ChefsHatError) as caught:
            client.rooms.add_marker(room_id, "mine", "stimulus")
        assert caught.value.reason == "OWNER_TOKEN_WRONG"
        with pytest.raises(ChefsHatError) as caught:
            next(iter(client.rooms.follow_markers(room_id, "mine")))
        assert caught.value.reason == "OWNER_TOKEN_WRONG"
        client.rooms.close(room_id, owner)
        # The fake server breaks the first stream.
        assert list(client.rooms.follow_markers(room_id, owner)) == sent
        assert list(client.rooms.follow_markers(room_id, owner, from_number=3)) == sent[2:]


@pytest.mark.server
async def test_a_marker_without_a_moment_marks_now(real_address: str) -> None:
    async with aio.Client(real_address) as client:
        created = await client.rooms.create("markers")
        clock = await client.read_clock(created.room.room_id)
        before = clock.room_offset
        assert before is not None
        sent = chefshat.clock.TIME_OF_DAY()
        marker = await client.rooms.add_marker(created.room.room_id, created.owner_token, "EEG on")
        done = chefshat.clock.TIME_OF_DAY()
        moment = clock.local(marker.elapsed_us / 1e3)
        assert sent - clock.error <= moment <= done + clock.error
        async for followed in client.rooms.follow_markers(created.room.room_id, created.owner_token):
            assert followed == marker
            break
