"""Value networks: their training, their files, and their use in a search."""

import dataclasses
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from chefshat import VectorEnv, search
from chefshat.learn import __main__ as command
from chefshat.learn import network, value

pytest.importorskip("chefshat_native")


def test_the_command_learns_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "points.safetensors"
    arguments = ["value", "trained", "--out", str(out), "--decisions", "12000", "--width", "32", "--json"]
    assert command.main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    # More than a constant, and than the numbers of cards.
    assert found["explained"] > found["explained_by_cards"] > 0.1
    assert found["decisions"] > 10_000
    net = network.load(out)
    assert (net.info.output, net.info.name, net.info.players) == ("points", "value of trained", 4)
    with VectorEnv(games=8, seed=1) as env:
        assert net.points_of(env.batch).shape == (8,)
        for choose in (net.actions_of, net.logits_of):
            with pytest.raises(ValueError, match="chooses no actions"):
                choose(env.batch)
        with pytest.raises(ValueError, match="`value` trains one for points"):
            network.load("trained").points_of(env.batch)
    # A second one does not replace it, and no agent plays by it.
    assert command.main(arguments) == 1
    refused = capsys.readouterr().out
    assert "--force" in refused
    assert "--resume" not in refused
    with pytest.raises(Exception, match="points"):
        VectorEnv(client_seats=[0], opponents=str(out))
    assert command.main(["value", str(out), "--out", str(tmp_path / "other")]) == 1
    assert "has outputs for points" in capsys.readouterr().err


def test_files_are_checked_before_games_are_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "points.safetensors"

    def play(*_: object) -> None:
        # A second command, while the first one plays.
        assert command.main(["value", "trained", "--out", str(out)]) == 1
        raise ValueError("played")

    monkeypatch.setattr(value, "play", play)
    assert command.main(["value", "trained", "--out", str(out)]) == 1
    assert [line.split(": ")[1] for line in capsys.readouterr().err.splitlines()] == [f"{out} exists", "played"]
    assert command.main(["value", "trained", "--out", str(tmp_path / "missing" / "points")]) == 1
    assert "there is no folder" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_samples_follow_from_the_seed() -> None:
    trained = network.load("trained")
    (samples, rules), (again, _) = (value.play(trained, Path("trained"), 1500, 1, "paper", None) for _ in range(2))
    for name in ("inputs", "cards", "points", "shifts"):
        assert np.array_equal(getattr(samples, name), getattr(again, name)), name
    assert samples.inputs.shape == (len(samples.points), trained.info.input_width)
    # All decisions of a Shift have its points, and who has fewer cards left than the others gets more of them.
    for shift in np.unique(samples.shifts):
        assert len(np.unique(samples.points[samples.shifts == shift])) == 1
    assert set(samples.points) <= set(rules.points)
    more_cards = samples.cards[:, 0] - samples.cards[:, 1:].mean(axis=1)
    assert np.corrcoef(more_cards, samples.points)[0, 1] < -0.3
    with pytest.raises(ValueError, match="too few to learn from"):
        value.learn(dataclasses.replace(samples, shifts=np.zeros_like(samples.shifts)), 8, 1, 1, 5)


def test_inputs_are_in_memory_once() -> None:
    trained = network.load("trained")
    tracemalloc.start()
    samples, _ = value.play(trained, Path("trained"), 4000, 1, "paper", None)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2 * samples.inputs.nbytes


def test_the_value_of_trained() -> None:
    points = network.load("trained_points")
    expected: list[float] = []
    reached: list[int] = []
    policy = network.load("trained")
    with VectorEnv(games=200, client_seats=[0], opponents="trained", seed=8, skip_forced=True) as env:
        open_ones: dict[int, list[float]] = {}
        while len(reached) < 1000:
            for game, number in zip(env.batch.games, points.points_of(env.batch), strict=True):
                open_ones.setdefault(int(game), []).append(float(number))
            endings = env.step(policy.actions_of(env.batch)).endings
            for game, place in zip(endings.games, endings.places_taken, strict=True):
                known = open_ones.pop(int(game), [])
                expected += known
                reached += [env.rules.points[place - 1]] * len(known)
    errors = np.square(np.array(expected) - reached).mean()
    assert errors < 0.65 * np.var(reached)


def test_leaves_valued_by_a_network() -> None:
    points = network.load("trained_points")
    with VectorEnv(seed=3, history=512) as env:
        env.sample(seed=1)
        while env.batch.masks[0].sum() < 8:
            env.step(env.sample())
        position = search.position(env)
    leaf = position.evaluate(deals=100, leaf=points.points_of, agent="trained", seed=1)
    played = position.evaluate(deals=400, agent="trained", seed=1)
    assert np.corrcoef(leaf.points, played.points)[0, 1] > 0.8
