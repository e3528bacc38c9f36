"""Transitions of a toy game: pairs of decisions, custom rewards, and slicing and concatenating tables."""

import numpy as np
import pytest
from fake_vector import PLAYERS, FakeVector
from numpy.typing import NDArray

from chefshat import ChefsHatError, Transitions, VectorEnv
from chefshat.columns import Endings, Observations
from chefshat.transitions import concatenate
from chefshat.vector import Batch


def legal(batch: Batch) -> NDArray[np.uint16]:
    """Returns the action 199 for every row."""
    return np.full(len(batch), 199, np.uint16)


def collect(env: VectorEnv, steps: int) -> list[tuple[Transitions, Batch]]:
    """Takes steps with the action 199. Returns the transitions of each step."""
    found = []
    for _ in range(steps):
        batch = env.step(legal(env.batch))
        found.append((batch.transitions, batch))
    return found


def test_transitions_pair_each_decision_with_the_seats_next(toy: FakeVector) -> None:
    games, steps = 5, 40
    # A plain loop over the same games: (game, episode, seat, decision) -> (next decision, reward, ended, place).
    expected: dict[tuple[int, ...], tuple[int, ...]] = {}
    for game in range(games):
        length = 5 + game % 3
        for episode in range(steps):
            for decision in range(length):
                seat = (game + decision) % PLAYERS
                follow = decision + PLAYERS
                if follow < length:
                    expected[game, episode, seat, decision] = (follow, decision + 1, 0, 0, 0)
                else:
                    ended = (length, decision + 1 + 100 + seat, 1, game % 2, 0 if game % 2 else seat + 1)
                    expected[game, episode, seat, decision] = ended
    found = 0
    with VectorEnv(toy.address, games, transitions=True) as env:
        assert len(env.batch.transitions) == 0
        played = dict.fromkeys(range(games), 0)
        for transitions, batch in collect(env, steps):
            seen, after = transitions.before.observations, transitions.after.observations
            for row in range(len(transitions)):
                game, seat, decision = seen.hands[row, :3].tolist()
                assert (game, seat) == (transitions.games[row], transitions.seats[row])
                assert after.hands[row, :2].tolist() == [game, seat]
                assert transitions.after.seats[row] == seat
                wanted = expected.pop((game, played[game], seat, decision))
                assert wanted == (
                    after.hands[row, 2],
                    transitions.rewards[row],
                    transitions.ended[row],
                    transitions.truncated[row],
                    transitions.places_taken[row],
                )
                found += 1
                legal_after = np.flatnonzero(transitions.after.masks[row]).tolist()
                assert legal_after == ([] if transitions.ended[row] else [after.hands[row, 2], 199])
                assert np.flatnonzero(transitions.before.masks[row]).tolist() == [decision, 199]
            assert transitions.actions.tolist() == [199] * len(transitions)
            assert not transitions.invalid.any()
            for game in np.unique(batch.endings.games).tolist():
                played[game] += 1
    # All decisions except the open ones, at most one per seat.
    assert games * steps - games * PLAYERS <= found < games * steps


def test_invalid_attempts_are_transitions_to_the_same_decision(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 2, invalid="ask_again", transitions=True) as env:
        first = env.step([150, 199]).transitions
        assert first.games.tolist() == [0]
        assert first.invalid.tolist() == [True]
        assert first.attempts.tolist() == [0]
        assert first.rewards.tolist() == [-1]
        assert first.before.observations.hands.tolist() == first.after.observations.hands.tolist()
        second = env.step([151, 1])
        assert second.attempts.tolist() == [2, 0]
        assert second.transitions.attempts.tolist() == [1]
        assert second.transitions.actions.tolist() == [151]


def test_a_reset_drops_open_decisions(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 3, transitions=True) as env:
        env.step(legal(env.batch))
        batch = env.reset(games=[1])
        assert toy.requests[-1].reset.games == np.array([1], "<u4").tobytes()
        assert batch.observations.hands[:, 2].tolist() == [1, 0, 1]
        assert len(batch.transitions) == 0
        found = [transitions.before.observations.hands[:, [0, 2]].tolist() for transitions, _ in collect(env, 4)]
    # The decision of game 1 before its reset has no transition; those of the others have.
    first = {game: min(pair[1] for step in found for pair in step if pair[0] == game) for game in range(3)}
    assert first == {0: 0, 1: 0, 2: 0}
    assert [sum(pair == [1, 0] for pair in step) for step in found] == [0, 0, 0, 1]


def test_custom_rewards_replace_the_servers(toy: FakeVector) -> None:
    def cards_shed(transitions: Transitions) -> NDArray[np.float32]:
        before, after = transitions.before.observations, transitions.after.observations
        return (after.hands[:, 2].astype(np.float32) - before.hands[:, 2]) / np.float32(2)

    with VectorEnv(toy.address, 2, reward_function=cards_shed) as env:
        assert env.batch.rewards.tolist() == [0, 0]
        batches = [batch for _, batch in collect(env, 5)]
    # In game 0 the fifth decision is seat 0's second, four decisions after its first.
    assert batches[3].rewards.tolist() == [2, 2]
    assert batches[4].endings.rewards.tolist() == [0.5, 2, 1.5, 1]
    assert batches[4].transitions.rewards.tolist() == [0.5, 2, 1.5, 1, 2]
    # Game 0 has started its next episode, without a decision so far; game 1 continues.
    assert batches[4].rewards.tolist() == [0, 2]


def test_a_reward_function_of_the_wrong_shape_is_reported(toy: FakeVector) -> None:
    with pytest.raises(ValueError, match="one reward for each row"):
        VectorEnv(toy.address, 2, reward_function=lambda transitions: np.zeros(7, np.float32))


def test_a_reward_function_that_fails_ends_the_env(toy: FakeVector) -> None:
    def fails(transitions: Transitions) -> NDArray[np.float32]:
        if len(transitions):
            raise FloatingPointError("no number comes of it")
        return np.zeros(0, np.float32)

    with VectorEnv(toy.address, 2, reward_function=fails) as env:
        for _ in range(3):
            env.step(legal(env.batch))
        with pytest.raises(FloatingPointError):
            env.step(legal(env.batch))
        with pytest.raises(ChefsHatError, match=r"REWARDS_FAILED.*make a new one"):
            env.step(legal(env.batch))


def test_transitions_are_optional(toy: FakeVector) -> None:
    with VectorEnv(toy.address) as env, pytest.raises(AttributeError, match="transitions=True"):
        assert env.batch.transitions


def test_tables_can_be_sliced_and_concatenated(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 3, transitions=True) as env:
        first, second = [transitions for transitions, _ in collect(env, 6)][4:]
    together = np.arange(len(second))
    assert second.take(together[::-1]).seats.tolist() == second.seats.tolist()[::-1]
    picked = second.take(second.games == 1)
    assert len(picked) > 0
    assert set(picked.games.tolist()) == {1}
    assert picked.before.observations.hands[:, 0].tolist() == [1] * len(picked)
    flat = first.flatten()
    assert {"actions", "before.kinds", "before.mask_bits", "after.points"} <= flat.keys()
    again = Transitions.unflatten(env.sizes, flat)
    assert {name: array.tolist() for name, array in again.flatten().items()} == {
        name: array.tolist() for name, array in flat.items()
    }
    both = concatenate([first, second])
    assert both.actions.tolist() == first.actions.tolist() + second.actions.tolist()
    assert both.after.observations.points.tolist() == [
        *first.after.observations.points.tolist(),
        *second.after.observations.points.tolist(),
    ]
    with pytest.raises(ValueError, match="nothing to concatenate"):
        concatenate([])
    # Both are flattened by name.
    assert not Observations.columns().keys() & Endings.columns().keys()
