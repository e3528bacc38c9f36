"""The game in OpenSpiel: its own simulation test, and the same game as without it. Runs where OpenSpiel is installed."""

import importlib
from typing import Any

import numpy as np
import pytest

import chefshat

pyspiel = pytest.importorskip("pyspiel")
pytest.importorskip("chefshat_native")


@pytest.fixture(scope="module")
def game() -> Any:
    importlib.import_module("chefshat.envs.open_spiel")
    return pyspiel.load_game("python_chefshat", {"deals": 20, "shifts": 2})


def test_openspiel_accepts_the_game(game: Any) -> None:
    pyspiel.random_sim_test(game, num_sims=1, serialize=True, verbose=False)


def test_a_game_is_that_of_a_vector_env(game: Any) -> None:
    state = game.new_initial_state()
    assert state.is_chance_node()
    state.apply_action(7)
    rules = {"preset": "paper", "target_shifts": 2}
    with chefshat.VectorEnv(seed=7, rules=rules, episode="game", total_games=1) as env:
        batch = env.batch
        while not batch.done:
            assert state.current_player() == batch.seats[0]
            legal = np.flatnonzero(batch.masks[0]).tolist()
            assert state.legal_actions() == legal
            batch = env.step([legal[0]])
            state.apply_action(legal[0])
        assert state.is_terminal()
        assert state.returns() == batch.endings.observations.points[0].tolist()
        assert sum(state.returns()) == game.utility_sum()


def test_clones_are_independent_and_observations_are_those_of_the_player(game: Any) -> None:
    state = game.new_initial_state()
    state.apply_action(3)
    for _ in range(5):
        state.apply_action(state.legal_actions()[-1])
    player = state.current_player()
    before = state.observation_tensor(player)
    clone = state.clone()
    assert clone.history() == state.history()
    assert clone.observation_tensor(player) == before
    clone.apply_action(clone.legal_actions()[0])
    assert state.current_player() == player
    assert state.observation_tensor(player) == before
    assert len(clone.history()) == len(state.history()) + 1
