"""Complete states of games: saved, restored and forked, in this process and on the real server."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chefshat import ChefsHatError, VectorEnv
from chefshat.vector import Batch

OPTIONS: dict[str, Any] = {
    "client_seats": [0, 2],
    "opponents": ["random", "greedy"],
    "rewards": "paper_intended",
    "shift_statistics": True,
    "seed": 5,
}


@pytest.fixture(params=["process", "server"])
def place(request: pytest.FixtureRequest) -> str | None:
    """Where the games are played: None is this process."""
    if request.param == "process":
        pytest.importorskip("chefshat_native")
        return None
    address: str = request.getfixturevalue("real_address")
    return address


def shown(batch: Batch) -> dict[str, NDArray[Any]]:
    """Returns everything in a batch that does not count from the beginning of its environment."""
    columns: dict[str, NDArray[Any]] = {}
    for table in (batch, batch.observations, batch.endings, batch.beginnings, batch.shifts):
        if table is not None:
            columns |= {f"{table!r} {name}": values for name, values in table.as_dict().items()}
    return columns


def played(env: VectorEnv, steps: int, seed: int) -> list[dict[str, NDArray[Any]]]:
    """Plays random actions, which the seed determines, and returns what was shown."""
    chance = np.random.default_rng(seed)
    batches = []
    for _ in range(steps):
        masks = env.batch.masks
        env.step(np.where(masks, chance.random(masks.shape), -1).argmax(axis=1))
        batches.append(shown(env.batch))
    return batches


def check_equal(found: list[dict[str, NDArray[Any]]], expected: list[dict[str, NDArray[Any]]]) -> None:
    """Compares batches bit for bit."""
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.keys() == other.keys()
        for name, column in one.items():
            assert column.tobytes() == other[name].tobytes(), name


def test_restored_games_continue_identically(place: str | None) -> None:
    with VectorEnv(place, 6, **OPTIONS) as env, VectorEnv(place, 6, **OPTIONS | {"episode": "shift"}) as other:
        played(env, 37, seed=1)
        states = env.save()
        expected = played(env, 90, seed=2)
        # In the same environment, in any order.
        order = np.array([4, 0, 5, 2, 1, 3])
        env.restore(order, [states[game] for game in order])
        check_equal(played(env, 90, seed=2), expected)
        # In another one.
        other.restore(np.arange(6), states)
        assert other.save() == states
        check_equal(played(other, 90, seed=2), expected)
        # Only some games.
        others = env.save([0, 1])
        env.restore([3], [states[3]])
        assert env.save([0, 1, 3]) == [*others, states[3]]


def test_a_state_is_the_same_in_the_process_and_on_a_server(real_address: str) -> None:
    pytest.importorskip("chefshat_native")
    with VectorEnv(None, 4, **OPTIONS) as here, VectorEnv(real_address, 4, **OPTIONS) as there:
        played(here, 25, seed=3)
        there.restore(range(4), here.save())
        assert there.save() == here.save()
        check_equal(played(there, 60, seed=4), played(here, 60, seed=4))


def test_forks_are_copies(place: str | None) -> None:
    with VectorEnv(place, 3, transitions=True, **OPTIONS) as env:
        played(env, 20, seed=1)
        batch = env.batch
        before = env.save()
        row = 1
        game = int(batch.games[row])
        with env.fork([game, 0], times=3) as copies, env.fork([game, 0], times=3, seed=9) as varied:
            assert (copies.games, len(copies.batch)) == (6, 6)
            for column in ("hands", "played", "cards_left", "boards"):
                values = getattr(copies.batch.observations, column)
                assert (values[::2] == getattr(batch.observations, column)[row]).all(), column
                assert (getattr(varied.batch.observations, column) == values).all(), column
            assert (copies.batch.rewards[::2] == batch.rewards[row]).all()
            # The lowest action everywhere: copies stay equal, and those with seeds do not.
            hands = []
            for branch in (copies, varied):
                for _ in range(60):
                    branch.step(branch.batch.masks.argmax(axis=1))
                hands.append(len(np.unique(branch.batch.observations.hands, axis=0)))
            assert hands == [2, 6]
            assert len(copies.batch.transitions) == len(copies.batch)
        assert env.save() == before


def test_what_cannot_be_restored_is_refused(place: str | None) -> None:
    with VectorEnv(place, 2, **OPTIONS) as env:
        states = env.save()
        with pytest.raises(ValueError, match="one state for each: 2 games and 1 states"):
            env.restore([0, 1], states[:1])
        with pytest.raises(ValueError, match="games are integers"):
            env.save([2])
        with pytest.raises(ChefsHatError, match="not a state of a game: they are damaged") as refused:
            env.restore([0], [states[0][:-1] + b"?"])
        assert refused.value.reason == "STATES_REFUSED"
    with VectorEnv(place, 2, **OPTIONS | {"rules": {"faces": 9}}) as env:
        with pytest.raises(ChefsHatError, match="another number of faces: 11, here 9"):
            env.restore([0], states[:1])
        with pytest.raises(ChefsHatError, match="this VectorEnv has ended"):
            env.save()


@pytest.mark.server
def test_a_state_too_large_for_a_message_is_refused_before_it_is_sent(real_address: str) -> None:
    with VectorEnv(real_address, 2, **OPTIONS) as env:
        with pytest.raises(ValueError, match="a state of 1000000 bytes is too large for a server"):
            env.restore([0], [bytes(1_000_000)])
        assert len(env.step(env.sample())) == 2
