"""Export to Minari: the episodes of a dataset are those of the transitions. Runs where Minari is installed."""

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import chefshat
from chefshat.transitions import Transitions, concatenate

pytest.importorskip("minari")
pytest.importorskip("chefshat_native")


def played() -> Transitions:
    """All transitions of a few games."""
    rng = np.random.default_rng(1)
    parts = []
    with chefshat.VectorEnv(games=3, transitions=True, rewards="points", total_games=3, episode="shift", seed=1) as env:
        batch = env.batch
        while not batch.done:
            batch = env.step(chefshat.sample_legal(batch.mask_bits, rng))
            parts.append(batch.transitions)
    return concatenate(parts)


@pytest.mark.parametrize("observation", ["table", "columns"])
def test_episodes_are_those_of_the_seats(observation: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    module = importlib.import_module("chefshat.replay.minari")
    transitions = played()
    dataset: Any = module.to_minari(transitions, "chefshat/test-v0", observation=observation, author="Ada")
    assert dataset.total_steps == len(transitions)
    assert dataset.total_episodes == int(transitions.ended.sum())
    total = 0.0
    for episode in dataset.iterate_episodes():
        masks = episode.infos["action_mask"]
        assert len(masks) == len(episode.actions) + 1
        # Every action was legal, and there is none at the end.
        assert masks[np.arange(len(episode.actions)), episode.actions].all()
        assert not masks[-1].any()
        assert episode.terminations[-1]
        assert not episode.terminations[:-1].any()
        total += float(episode.rewards.sum())
    assert total == pytest.approx(float(transitions.rewards.sum()))


def test_an_episode_without_its_end_is_truncated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    module = importlib.import_module("chefshat.replay.minari")
    transitions = played()
    some = transitions.take(np.flatnonzero((transitions.games == 0) & (transitions.seats == 0))[:2])
    dataset: Any = module.to_minari(some, "chefshat/some-v0")
    (episode,) = dataset.iterate_episodes()
    assert episode.truncations.tolist() == [False, True]
    assert not episode.terminations.any()
    with pytest.raises(ValueError, match="no transitions"):
        module.to_minari(some.take(np.zeros(0, np.intp)), "chefshat/none-v0")


def interrupted() -> Iterator[Transitions]:
    """Transitions of the same games between interruptions: a reset of one, of all, a restored state."""
    rng = np.random.default_rng(4)
    with chefshat.VectorEnv(games=2, transitions=True, rewards="points", seed=1, history=4) as env:
        state = env.save([0])
        interruptions: list[Callable[[], object]] = [
            lambda: env.reset(games=[1]),
            env.reset,
            lambda: env.restore([0], state),
            lambda: None,
        ]
        for interrupt in interruptions:
            parts = []
            for _ in range(30):
                batch = env.step(chefshat.sample_legal(env.batch.mask_bits, rng))
                parts.append(batch.transitions)
            yield concatenate(parts)
            interrupt()


def test_an_abandoned_game_ends_its_episodes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    module = importlib.import_module("chefshat.replay.minari")
    transitions = concatenate(list(interrupted()))
    episodes = list(module.to_minari(transitions, "chefshat/resets-v0", observation="columns").iterate_episodes())
    cut = 0
    for episode in episodes:
        hands = episode.observations["hands"].sum(axis=1, dtype=int)
        # Within a Shift hands only shrink: the first one has no exchange.
        assert (np.diff(hands) <= 0).all()
        assert not episode.truncations[:-1].any()
        assert not episode.terminations[:-1].any()
        assert episode.truncations[-1] != episode.terminations[-1]
        cut += int(episode.truncations[-1])
    # The seats of the abandoned games, and of those that were not over.
    assert cut == 4 + 8 + 4 + 8
    assert len(episodes) == cut + int(transitions.ended.sum())
