"""Complete states of games: saved, restored and forked, in this process and on the real server."""

from typing import Any

import numpy as np
import pytest

from chefshat import ChefsHatError, VectorEnv
from chefshat.vector import Batch

OPTIONS: dict[str, Any] = {
    "client_seats": [0, 2],
    "opponents": ["random", "greedy"],
    "rewards": "paper_intended",
    "shift_statistics": True,
    "seed": 5,
}


def shown(batch: Batch) -> dict[str, Any]:
    """Returns everything in a batch that does not count from the beginning of its environment."""
    columns: dict[str, Any] = {"records": batch.records}
    tables = {"rows": batch, "seen": batch.observations, "ends": batch.endings, "begins": batch.beginnings, "shifts": batch.shifts}
    for part, table in tables.items():
        if table is not None:
            columns |= {f"{part} {name}": (values.shape, values.tobytes()) for name, values in table.as_dict().items()}
    return columns


def played(env: VectorEnv, steps: int, seed: int, illegal: float = 0) -> list[dict[str, Any]]:
    """Plays random actions, which the seed determines, and returns what was shown. `illegal`: the share of illegal actions."""
    chance = np.random.default_rng(seed)
    batches = []
    for _ in range(steps):
        allowed = env.batch.masks ^ (chance.random((len(env.batch), 1)) < illegal)
        env.step(np.where(allowed, chance.random(allowed.shape), -1).argmax(axis=1))
        batches.append(shown(env.batch))
    return batches


def check_equal(found: list[dict[str, Any]], expected: list[dict[str, Any]]) -> None:
    """Compares batches bit for bit."""
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.keys() == other.keys()
        for name, column in one.items():
            assert column == other[name], name


RECORDED: dict[str, Any] = {
    "records": True,
    "invalid": "ask_again",
    "max_invalid_attempts": 4,
    "rules": {"target_shifts": 1},
}


@pytest.mark.parametrize(("options", "illegal"), [({}, 0), (RECORDED, 0.2)], ids=["unrecorded", "recorded"])
def test_restored_games_continue_identically(anywhere: str | None, options: dict[str, Any], illegal: float) -> None:
    options = OPTIONS | options
    with VectorEnv(anywhere, 6, **options) as env, VectorEnv(anywhere, 6, **options) as other:
        played(env, 37, 1, illegal)
        states = env.save()
        expected = played(env, 90, 2, illegal)
        # What was decided and attempted before counts, too.
        assert any(batch["records"] for batch in expected) == ("records" in options)
        assert (env.batch.totals.invalid_attempts > 0) == (illegal > 0)
        # In the same environment, in any order.
        order = np.array([4, 0, 5, 2, 1, 3])
        env.restore(order, [states[game] for game in order])
        check_equal(played(env, 90, 2, illegal), expected)
        # In another one.
        other.restore(np.arange(6), states)
        assert other.save() == states
        check_equal(played(other, 90, 2, illegal), expected)
        # Only some games.
        others = env.save([0, 1])
        env.restore([3], [states[3]])
        assert env.save([0, 1, 3]) == [*others, states[3]]


def choices(env: VectorEnv, game: int) -> list[dict[str, bytes]]:
    """Plays the lowest actions, and returns what a game shows at its next decisions with several of them."""
    found: list[dict[str, bytes]] = []
    while len(found) < 40:
        batch = env.batch
        (row,) = np.flatnonzero(batch.games == game)
        if batch.masks[row].sum() > 1:
            columns = batch.observations.as_dict() | {"seats": batch.seats, "masks": batch.masks}
            found.append({name: column[row].tobytes() for name, column in columns.items()})
        env.step(batch.masks.argmax(axis=1))
    return found


@pytest.mark.parametrize("differing", [{"seed": 6}, {"episode": "game"}, {"skip_forced": True}], ids=str)
def test_a_game_continues_where_other_options_differ(anywhere: str | None, differing: dict[str, Any]) -> None:
    with VectorEnv(anywhere, 2, **OPTIONS) as env, VectorEnv(anywhere, 4, **OPTIONS | differing) as other:
        played(env, 37, 1)
        other.restore([3], env.save([1]))
        assert choices(other, 3) == choices(env, 1)


@pytest.mark.server
def test_many_states_are_several_messages(real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with VectorEnv(real_address, 7, **OPTIONS) as env:
        played(env, 37, 1)
        states = env.save()
        expected = played(env, 20, 2)
        monkeypatch.setattr("chefshat._remote.SAVED_AT_ONCE", 3)
        monkeypatch.setattr("chefshat._remote.MAX_STATES_BYTES", 2 * max(map(len, states)))
        steps = env.batch.step
        env.restore(range(7), states)
        # A batch answers each message.
        assert env.batch.step > steps + 1
        assert env.save() == states
        check_equal(played(env, 20, 2), expected)


@pytest.mark.server
def test_a_state_is_the_same_in_the_process_and_on_a_server(real_address: str) -> None:
    pytest.importorskip("chefshat_native")
    with VectorEnv(None, 4, **OPTIONS) as here, VectorEnv(real_address, 4, **OPTIONS) as there:
        played(here, 25, 3)
        there.restore(range(4), here.save())
        assert there.save() == here.save()
        check_equal(played(there, 60, 4), played(here, 60, 4))


def test_forks_are_copies(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 3, transitions=True, **OPTIONS) as env:
        played(env, 20, 1)
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


OTHERS: dict[str, Any] = OPTIONS | {"client_seats": [1], "opponents": ["greedy", "trained", "greedy"]}


def test_others_take_seats_over(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 3, **OPTIONS) as env, VectorEnv(anywhere, 3, **OTHERS) as other:
        # Some Shifts, in which the agents of seat 1 would have been rewarded.
        played(env, 150, 1)
        shifts = env.batch.observations.shifts[env.batch.games == 2]
        batch = other.restore([0, 2], env.save([0, 2]))
        assert (batch.seats == 1).all()
        row = batch.games == 2
        assert batch.observations.shifts[row] - shifts in (0, 1)
        assert batch.rewards[row] == 0 or 2 in batch.endings.games
        played(other, 20, 2)
        # Back where they came from.
        env.restore([1], other.save([2]))
        played(env, 20, 3)


@pytest.mark.server
def test_what_happens_on_the_way_to_the_next_decision_is_kept(real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("chefshat_native")
    monkeypatch.setattr("chefshat._remote.MAX_STATES_BYTES", 1000)
    endings = 0
    with VectorEnv(None, 7, **OPTIONS) as env, VectorEnv(None, 7, **OTHERS) as here, VectorEnv(real_address, 7, **OTHERS) as there:
        for seed in range(150):
            played(env, 1, seed)
            states = env.save()
            found, expected = there.restore(range(7), states), here.restore(range(7), states)
            check_equal([shown(found)], [shown(expected)])
            endings += len(found.endings)
    assert endings > 2


def test_what_cannot_be_restored_is_refused(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 2, **OPTIONS) as env:
        states = env.save()
        with pytest.raises(ValueError, match="one state for each: 2 games and 1 states"):
            env.restore([0, 1], states[:1])
        with pytest.raises(ValueError, match="games are integers"):
            env.save([2])
        with pytest.raises(TypeError, match="state 1 is not bytes, as `save` returns them, but a str"):
            env.restore([0, 1], [states[0], "x"])  # type: ignore[list-item]
        # Nothing has changed.
        assert env.save() == states
        with pytest.raises(ChefsHatError, match="not a state of a game: they are damaged") as refused:
            env.restore([0], [states[0][:-1] + b"?"])
        assert refused.value.reason == "STATES_REFUSED"
    with VectorEnv(anywhere, 2, **OPTIONS | {"rules": {"faces": 9}}) as env:
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
