"""The history column, and its tokens."""

from collections.abc import Iterator

import numpy as np
import pytest

from chefshat import VectorEnv, history, pb


@pytest.fixture
def env(anywhere: str | None) -> Iterator[VectorEnv]:
    """Games of all seats with a history, in this process and on the real server."""
    with VectorEnv(anywhere, 3, history=24, seed=4) as games:
        yield games


def test_the_history_has_the_actions_of_the_shift(env: VectorEnv) -> None:
    chance = np.random.default_rng(1)
    done: list[list[tuple[int, int]]] = [[] for _ in range(3)]
    shifts = np.ones(3, int)
    checked = truncated = 0
    for _ in range(400):
        batch = env.batch
        seats, actions, tokens = history.actors(batch), history.actions(batch), history.tokens(batch)
        assert (tokens.shape, tokens.max() < history.vocabulary_size(batch.sizes)) == ((3, 48), True)
        for row, game in enumerate(batch.games):
            if batch.observations.shifts[row] != shifts[game]:
                shifts[game], done[game] = batch.observations.shifts[row], []
            # From the second Shift on there are gifts, which not all seats may know.
            if shifts[game] == 1:
                known = done[game][-24:]
                assert batch.observations.history_counts[row] == len(done[game])
                assert list(zip(seats[row], actions[row], strict=True)) == [(-1, -1)] * (24 - len(known)) + known
                expected = [token for seat, action in known for token in (1 + (seat - int(batch.seats[row])) % 4, 5 + action)]
                assert tokens[row].tolist() == [0] * (48 - len(expected)) + expected
                checked += 1
                truncated += len(done[game]) > 24
        chosen = np.where(batch.masks, chance.random(batch.masks.shape), -1).argmax(axis=1)
        for row, game in enumerate(batch.games):
            done[game].append((int(batch.seats[row]), int(chosen[row])))
        env.step(chosen)
    assert checked > 100
    assert truncated > 0


def test_gifts_are_known_to_giver_and_receiver(env: VectorEnv) -> None:
    unknown, known = env.num_actions, range(env.turn_actions, env.turn_actions + env.faces + 1)
    seen = set()
    for _ in range(1500):
        batch = env.batch
        seats, actions = history.actors(batch), history.actions(batch)
        # The first turn after the exchange: all six gifts, of which nothing has been cut off.
        for row in np.flatnonzero((batch.kinds == pb.DECISION_KIND_TURN) & (batch.observations.played.sum(axis=1) == 0)):
            given = actions[row] >= env.turn_actions
            if given.sum() != 6:
                continue
            roles = batch.observations.roles[row]
            role = roles[batch.seats[row]]
            mine = {pb.ROLE_CHEF, pb.ROLE_DISHWASHER} if role in (1, 5) else {pb.ROLE_SOUS_CHEF, pb.ROLE_WAITER}
            for seat, action in zip(seats[row][given], actions[row][given], strict=True):
                assert (action in known) == (roles[seat] in mine), (role, roles[seat])
                assert action in known or action == unknown
            seen.add(int(role))
        env.step(batch.masks.argmax(axis=1))
    assert len(seen) >= 2


def test_without_a_history_there_are_no_tokens() -> None:
    pytest.importorskip("chefshat_native")
    with VectorEnv(games=2) as games:
        assert games.batch.observations.history.shape == (2, 0)
        with pytest.raises(ValueError, match="create the VectorEnv with history=K"):
            history.tokens(games.batch)
