"""Training of Deep Q agents; on the real server also tuning and the commands."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chefshat.learn import network, runs
from chefshat.vector import VectorEnv
from test_deep_q import TINY, ids

from chefshat_paper.learn import checkpoint, deep_q, deep_q_training, tune
from chefshat_paper.learn.__main__ import main, parse
from chefshat_paper.learn.deep_q import DeepQConfig
from chefshat_paper.learn.deep_q_training import LockStep


def rewards(*numbers: float) -> Any:
    return np.array(numbers, np.float32)


def seen(*numbers: int) -> Any:
    """States that are numbered."""
    states = np.zeros((len(numbers), 4), np.float32)
    states[:, 0] = numbers
    return states


def legal(rows: int) -> Any:
    return np.ones((rows, 3), np.bool_)


def test_agents_store_the_outcome_of_each_decision() -> None:
    """Agent 0 decides three times in two episodes, agent 2 once and then again in the next, agent 1 never."""
    stack = LockStep(TINY, deep_q.start(TINY, [1, 2, 3]), 2)
    first = stack.decide(ids(0, 2), rewards(9, 9), seen(10, 12), legal(2), ids(0, 0))
    second = stack.decide(ids(0), rewards(1), seen(20), legal(1), ids(0))
    stack.end(ids(0, 1, 2, 0), rewards(2, 3, 4, 5))
    third = stack.decide(ids(2, 0), rewards(9, 9), seen(32, 30), legal(2), ids(0, 0))
    stack.decide(ids(0), rewards(6), seen(40), legal(1), ids(0))
    memory = stack.agents.memory
    assert np.asarray(stack.agents.remembered).tolist() == [3, 0, 1]
    assert np.asarray(memory.states[0, :3, 0]).tolist() == [10, 20, 30]
    assert np.asarray(memory.actions[0, :3]).tolist() == [first[0], second[0], third[1]]
    assert np.asarray(memory.rewards[0, :3]).tolist() == [1, 2, 6]
    assert np.asarray(memory.next_states[0, :3, 0]).tolist() == [20, 0, 40]
    assert np.asarray(memory.done[0, :3]).tolist() == [False, True, False]
    assert np.asarray(memory.next_masks[0, :3]).all(axis=1).tolist() == [True, False, True]
    assert (float(memory.states[2, 0, 0]), float(memory.rewards[2, 0]), bool(memory.done[2, 0])) == (12, 4, True)


def test_agents_that_do_not_learn_store_nothing() -> None:
    stack = LockStep(TINY, deep_q.start(TINY, [1]), 1, explore=False, learn=False)
    actions = {int(stack.decide(ids(0), rewards(1), seen(10), legal(1), ids(0))[0]) for _ in range(20)}
    stack.end(ids(0), rewards(1))
    assert len(actions) == 1
    assert int(stack.agents.remembered[0]) == 0


def games(address: str, *, seats: list[int], seeds: list[bytes], shifts: int = 2, invalid: str = "ask_again") -> VectorEnv:
    return VectorEnv(
        address,
        len(seeds),
        client_seats=seats,
        rewards="validity",
        decisions="turns",
        invalid=invalid,
        total_games=len(seeds),
        seed=seeds,
        rules={"target_shifts": shifts},
        shift_statistics=True,
    )


@pytest.mark.slow
@pytest.mark.server
def test_a_game_does_not_depend_on_the_games_beside_it(real_address: str) -> None:
    config = DeepQConfig(hidden=(16,), batch_size=8, memory_size=64, wrong_limit=5)
    seeds = [bytes([number]) * 32 for number in range(3)]
    with games(real_address, seats=[0, 2], seeds=seeds) as env:
        agents, played = deep_q_training.play(env, config, deep_q.start(config, [1, 2, 3, 4, 5, 6]))
    with games(real_address, seats=[0, 2], seeds=seeds[1:2]) as env:
        alone, played_alone = deep_q_training.play(env, config, deep_q.start(config, [3, 4]))
    assert played.of_seats["places"].shape == (3, 2, 4)
    assert np.sort(played.of_seats["places"], axis=2).tolist() == [[[1, 2, 3, 4]] * 2] * 3
    for name, counted in played.of_seats.items():
        assert np.array_equal(counted[1:2], played_alone.of_seats[name]), name
    assert int(played.of_seats["wrong"][:, :, [0, 2]].sum()) > 0
    assert played.most_attempts == 5
    # Every decision that the server counted is a transition, including those that ended an episode.
    attempts = played.of_seats["valid"] + played.of_seats["wrong"]
    assert np.asarray(agents.remembered).tolist() == attempts[:, :, [0, 2]].sum(axis=1).ravel().tolist()
    assert np.asarray(alone.remembered).tolist() == np.asarray(agents.remembered[2:4]).tolist()
    # The memory has the server's rewards: 1 for a valid action, -1 for an invalid one.
    assert set(np.asarray(agents.memory.rewards).ravel().tolist()) == {1.0, -1.0}


@pytest.mark.server
def test_agents_with_a_mask_take_no_illegal_action(real_address: str) -> None:
    config = DeepQConfig(hidden=(16,), batch_size=8, memory_size=64, mask=True)
    with games(real_address, seats=[1], seeds=[bytes(32)], invalid="error") as env:
        agents, played = deep_q_training.play(env, config, deep_q.start(config, [1]))
    assert int(played.of_seats["wrong"].sum()) == 0
    assert int(agents.updates[0]) > 0
    with (
        games(real_address, seats=[0, 1], seeds=[bytes(32)]) as env,
        pytest.raises(ValueError, match="1 agents for 1 games of 2 seats"),
    ):
        deep_q_training.play(env, config, agents)


@pytest.mark.server
def test_statistics_are_kept_of_any_number_of_shifts(real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    config = DeepQConfig(hidden=(16,), batch_size=8, memory_size=64, mask=True)

    def played() -> deep_q_training.Played:
        with games(real_address, seats=[1], seeds=[bytes(32), bytes([1]) * 32], invalid="error") as env:
            return deep_q_training.play(env, config, deep_q.start(config, [1, 2]))[1]

    expected = played()
    assert expected.of_seats["places"].shape == (2, 2, 4)
    monkeypatch.setattr(deep_q_training, "FIRST_SHIFTS", 1)
    found = played()
    for ours, theirs in ((found.of_shifts, expected.of_shifts), (found.of_seats, expected.of_seats)):
        for name in theirs:
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)


@pytest.mark.server
def test_an_agent_is_trained_and_resumed(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "agent.safetensors"
    command = ["deep-q", "--out", str(out), "--shifts", "2", "--mask", "--address", real_address, "--json"]
    command += ["--evaluations", "1", "--evaluation-games", "2"]
    assert main(command) == 0
    before = json.loads(capsys.readouterr().out)
    assert (before["event"], before["wrong_per_shift"]) == ("trained", 0)
    trained = checkpoint.load(tmp_path / "agent.training")
    assert network.load(out).info.rules == trained.networks("deep-q")[0].info.rules
    assert main(command) == 1
    assert "agent.safetensors exists" in json.loads(capsys.readouterr().out)["message"]
    # Shifts are counted from the start of the training: one more.
    assert main([*command, "--shifts", "3", "--resume"]) == 0
    resumed = checkpoint.load(tmp_path / "agent.training")
    assert int(resumed.agents.updates[0]) > int(trained.agents.updates[0]) > 0


@pytest.mark.slow
@pytest.mark.server
def test_parameters_are_tuned_and_trained_with(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = tmp_path / "tuned.json"
    command = ["tune", "--out", str(found), "--trials", "2", "--agents", "2", "--shifts", "2", "--mask", "--address", real_address]
    assert main(command) == 0
    table = capsys.readouterr().out
    assert "Shifts won" in table
    assert "Trial 0 has the paper's parameters." in table
    tuned = json.loads(found.read_text())
    assert [trial["number"] for trial in tuned["trials"]] == [0, 1]
    first, second = (trial["parameters"] for trial in tuned["trials"])
    assert (first["hidden"], first["batch_size"], first["discount"]) == ([128, 256], 32, 0.95)
    assert first != second
    assert tuned["parameters"] == tuned["trials"][tuned["best"]]["parameters"]
    # The best and the paper's parameters once more, with values that were not selected.
    again = tuned["trained_afresh"]
    assert [trial["number"] for trial in again] == sorted({0, tuned["best"]})
    for trial in again:
        assert trial["parameters"] == tuned["trials"][trial["number"]]["parameters"]
        assert f"{trial['value']:.1%} ({trial['least']:.1%} to {trial['most']:.1%}): trial {trial['number']}" in table
    assert main(command) == 1
    assert "tuned.json exists: replace it with --force" in capsys.readouterr().err
    # Everything is seeded: the same command has the same result.
    assert main([*command[:2], str(tmp_path / "again.json"), *command[3:], "--json"]) == 0
    same = json.loads(capsys.readouterr().out)
    assert (same["trials"], same["trained_afresh"]) == (tuned["trials"], again)
    out = tmp_path / "agent.safetensors"
    assert main(["deep-q", "--out", str(out), "--shifts", "1", "--parameters", str(found), "--address", real_address]) == 0
    assert checkpoint.load(tmp_path / "agent.training").config.batch_size == tuned["parameters"]["batch_size"]


def test_trials_play_no_games_of_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    options = parse(["tune", "--out", "o", "--seed", "7"])
    seeds = []

    def asked(*_: object, seed: int, **__: object) -> None:
        seeds.append(seed)
        raise InterruptedError

    monkeypatch.setattr(tune, "VectorEnv", asked)
    for afresh in (False, True):
        with pytest.raises(InterruptedError):
            tune.evaluate(options, DeepQConfig(), afresh=afresh)
    assert seeds == [7 + runs.SEED_STEP, 7 + 2 * runs.SEED_STEP]


def test_a_missing_parameter_file_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "p.json"
    options = ["deep-q", "--out", str(tmp_path / "a"), "--parameters", str(path), "--address", "127.0.0.1:1"]
    assert main(options) == 1
    assert f"there is no file {path}: give a file of hyper-parameters" in capsys.readouterr().err
    for text in ('{"parameters": {"inputs": 3}}', "garbage"):
        path.write_text(text)
        assert main(options) == 1
        assert f'{path} has no object "parameters"' in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.server
def test_results_of_a_few_shifts_are_counts(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # With other seeds an untrained agent without a mask may take thousands of attempts.
    options = ["--shifts", "2", "--seed", "2", "--address", real_address]
    assert main(["deep-q", "--out", str(tmp_path / "a.safetensors"), *options]) == 0
    summary = capsys.readouterr().out.splitlines()[1]
    assert re.search(r"won [01] of the last 1, ", summary)
    assert "%" not in summary
