"""Training by self-play against the real server: learning a small game, and the command with its files."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chefshat.errors import INTERRUPTED
from chefshat.learn import __main__ as command
from chefshat.learn import curve, network, ppo_checkpoint, ppo_command
from chefshat.learn.evaluation import evaluate
from chefshat.learn.ppo import Hyperparameters
from chefshat.learn.ppo_checkpoint import Opponent, Plan
from chefshat.learn.ppo_training import Trainer
from chefshat.learn.runs import full_rules

pytestmark = pytest.mark.server

CLASSIC = Path(__file__).parents[3] / "tests" / "fixtures" / "network" / "classic-turns.safetensors"
SMALL = {"players": 2, "faces": 4}
PLAN = Plan(games=64, steps=32, learning_rate=2e-3, hyper=Hyperparameters(policy_widths=(32,), value_widths=(32,), minibatches=4))


def test_a_small_game_is_learned(real_address: str) -> None:
    rules = full_rules(SMALL, real_address)
    assert (rules.players, rules.faces, list(rules.points)) == (2, 4, [5, 0])
    before = ppo_checkpoint.begin(PLAN, 1, rules, "a test")
    with Trainer(before, address=real_address) as trainer:
        for _ in range(20):
            losses = trainer.update(0.0)
            assert all(np.isfinite(value) for value in losses.values())
        after = trainer.training
    assert after.progress.updates == 20
    assert after.progress.decisions == 20 * 32 * 64
    points = [
        evaluate(training.network("small"), "random", games=150, seed=2, rules=rules, address=real_address).points
        for training in (before, after)
    ]
    # A random player gets half of the 5 points; the untrained network is hardly better.
    assert points[1] > max(3.0, points[0] + 0.3), points


def test_some_games_may_be_against_built_in_agents(real_address: str) -> None:
    plan = replace(PLAN, games=8, opponent_games=8, opponents=(Opponent("random"),), steps=16)
    with Trainer(ppo_checkpoint.begin(plan, 1, full_rules(SMALL, real_address), "a test"), address=real_address) as trainer:
        trainer.update(0.0)
        assert trainer.training.progress.decisions == 16 * 16


def test_a_coalition_is_evaluated_with_its_partner(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "pair.safetensors"
    small = ["--steps", "16", "--minibatches", "2", "--width", "8", "--evaluations", "1", "--evaluation-games", "2"]
    common = ["ppo", "--out", str(out), "--address", real_address, "--decisions", "64", "--name", "pair", "--json", *small]
    assert command.main([*common, "--coalition"]) == 1
    assert "--coalition needs --opponent-games" in json.loads(capsys.readouterr().out)["message"]
    assert command.main([*common, "--games", "0", "--opponent-games", "8", "--opponents", "random", "--coalition"]) == 0
    trained = json.loads(capsys.readouterr().out)
    assert [one["opponents"] for one in trained["evaluations"]] == [["greedy"] * 3, ["random"] * 3, ["random", "itself", "random"]]


@pytest.mark.slow
def test_some_games_may_be_against_a_past_self(real_address: str, tmp_path: Path) -> None:
    rules = full_rules({**SMALL, "players": 3}, real_address)
    past = ppo_checkpoint.begin(PLAN, 1, rules, "a test").network("past")
    file = tmp_path / "past.safetensors"
    network.save(file, past.layers, past.info, dtype=np.float16)
    plan = replace(PLAN, games=0, opponent_games=8, opponents=(Opponent(str(file)), Opponent("greedy")), steps=16)
    with Trainer(ppo_checkpoint.begin(plan, 1, rules, "a test"), address=real_address) as trainer:
        trainer.update(0.0)
        # A game may have no decision within two Shifts, and then no row.
        assert 8 * 14 < trainer.training.progress.decisions <= 8 * 16
        assert trainer.training.plan == plan.checked() != plan
        found = evaluate(trainer.training.network("now"), [str(file), "greedy"], games=3, seed=2, rules=rules, address=real_address)
    assert found.opponents == (str(file), "greedy")


@pytest.mark.slow
def test_a_training_resumes_against_the_same_file_only(
    real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    past, out = tmp_path / "past.safetensors", tmp_path / "out.safetensors"
    games = ["--steps", "16", "--minibatches", "2", "--width", "8", "--evaluations", "1", "--evaluation-games", "2"]
    common = ["--address", real_address, "--decisions", "128"]
    assert command.main(["ppo", "--out", str(past), "--games", "8", *games, *common]) == 0
    first = past.read_bytes()
    against = ["--games", "0", "--opponent-games", "8", "--opponents", str(past), "greedy", "random"]
    assert command.main(["ppo", "--out", str(out), *against, *games, *common]) == 0
    setup = json.loads((tmp_path / "out.jsonl").read_text().splitlines()[0])
    digest = hashlib.sha256(first).hexdigest()
    assert [opponent["sha256"] for opponent in setup["plan"]["opponents"]] == [digest, "", ""]
    capsys.readouterr()

    resume = ["ppo", "--out", str(out), "--resume", "--address", real_address, "--decisions", "256"]
    past.write_bytes(out.read_bytes())
    assert command.main(resume) == 1
    assert f"past.safetensors is not the network that this training played against so far: put that back (SHA-256 {digest}" in (
        capsys.readouterr().err
    )
    past.unlink()
    assert command.main(resume) == 1
    assert "there is no file" in capsys.readouterr().err
    past.write_bytes(first)
    assert command.main([*resume, "--opponents", "greedy"]) == 1
    assert "opponents [" in capsys.readouterr().err
    assert command.main([*resume, "--opponents", str(past), "greedy", "random"]) == 0


@pytest.mark.slow
def test_the_value_network_may_see_all_hands_and_learn_first(real_address: str, tmp_path: Path) -> None:
    plan = replace(PLAN, games=8, steps=16, value_updates=1, hyper=replace(PLAN.hyper, all_hands=True))
    begun = ppo_checkpoint.begin(plan, 1, full_rules(SMALL, real_address), "a test")
    trainings = [begun]
    with Trainer(begun, address=real_address) as trainer:
        for _ in range(2):
            trainer.update(0.0)
            trainings.append(trainer.training)
    policies, values = (
        [network[kind]["Dense_0"]["kernel"] for network in (training.learner.params for training in trainings)] for kind in (0, 1)
    )
    np.testing.assert_array_equal(policies[0], policies[1])
    assert (policies[1] != policies[2]).any()
    assert (values[0] != values[1]).any()
    assert (values[1] != values[2]).any()
    ppo_checkpoint.save(tmp_path / "t", trainings[-1])
    assert ppo_checkpoint.load(tmp_path / "t").plan == plan


def test_the_command_writes_its_files_and_resumes(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "small.safetensors"
    options = ["ppo", "--out", str(out), "--address", real_address, "--seed", "3", "--name", "small", "--json"]
    plan = ["--games", "16", "--steps", "16", "--minibatches", "2", "--width", "8", "--evaluations", "2", "--evaluation-games", "4"]
    assert command.main([*options, *plan, "--decisions", "512"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert (output["event"], output["decisions"], output["updates"], output["runs"]) == ("trained", 512, 2, 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.jsonl", "small.safetensors", "small.training"]
    trained = network.load(out)
    assert trained.info.name == "small"
    assert trained.info.trained_by.startswith("python -m chefshat.learn ppo --out")
    assert json.loads(trained.info.rules)["players"] == 4
    lines = [json.loads(line) for line in (tmp_path / "small.jsonl").read_text().splitlines()]
    assert [line["event"] for line in lines] == ["setup", "evaluation", "evaluation", "evaluation"]
    assert [line["decisions"] for line in lines[1:]] == [0, 256, 512]

    assert command.main([*options, *plan, "--decisions", "256"]) == 1
    assert "with --resume, replace it with --force" in json.loads(capsys.readouterr().out)["message"]
    assert network.load(out).info.trained_by == trained.info.trained_by

    options = [*options, "--resume"]
    for option, given, stored in (("games", 32, 16), ("width", 9, 8), ("seed", 4, 3), ("evaluations", 3, 2)):
        assert command.main([*options, f"--{option}", str(given), "--decisions", "1024"]) == 1
        assert f"{option} {stored}, not {given}" in json.loads(capsys.readouterr().out)["message"]
    assert command.main([*options, "--rules", "rulebook", "--decisions", "1024"]) == 1
    assert "rules points" in json.loads(capsys.readouterr().out)["message"]

    assert command.main([*options, "--decisions", "1024"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert (output["decisions"], output["updates"], output["runs"]) == (1024, 4, 2)
    assert [evaluation["games"] for evaluation in output["evaluations"]] == [4, 4]
    lines = [json.loads(line) for line in (tmp_path / "small.jsonl").read_text().splitlines()]
    assert [line["decisions"] for line in lines if line["event"] == "evaluation"] == [0, 256, 512, 1024]
    assert network.load(out).info.trained_by.count("python -m chefshat.learn ppo") == 2
    assert any((old.weight != new.weight).any() for old, new in zip(trained.layers, network.load(out).layers, strict=True))

    assert command.main(["evaluate", str(out), "--opponents", "greedy", "--games", "3", "--address", real_address, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["opponents"], found["games"], sum(found["places"])) == (["greedy"] * 3, 3, found["shifts"])


def test_an_interrupted_training_is_evaluated_like_another(
    real_address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "small.jsonl"
    options = ["ppo", "--out", str(log.with_suffix(".safetensors")), "--address", real_address, "--decisions", "1024"]
    plan = ["--games", "16", "--steps", "16", "--minibatches", "2", "--width", "8", "--evaluations", "2", "--evaluation-games", "2"]
    update = Trainer.update

    def interrupted(trainer: Trainer, done: float) -> dict[str, float]:
        if trainer.training.progress.decisions == 256:
            raise KeyboardInterrupt
        return update(trainer, done)

    with monkeypatch.context() as patched:
        patched.setattr(Trainer, "update", interrupted)
        assert command.main([*options, *plan]) == INTERRUPTED
    assert [line["decisions"] for line in curve.read(log.read_text()).evaluations] == [0, 256]
    assert command.main([*options, "--resume"]) == 0
    assert [line["decisions"] for line in curve.read(log.read_text()).evaluations] == [0, 512, 1024]


@pytest.mark.slow
def test_a_best_response_begins_with_a_network(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["--steps", "16", "--minibatches", "2", "--evaluations", "1", "--evaluation-games", "2", "--address", real_address]
    first, second = tmp_path / "first.safetensors", tmp_path / "second.safetensors"
    assert command.main(["ppo", "--out", str(first), "--games", "8", "--width", "8", "--decisions", "128", *small]) == 0
    capsys.readouterr()
    begun = network.load(first)
    plan = replace(PLAN, hyper=replace(PLAN.hyper, policy_widths=(8, 8)))
    begin = ppo_checkpoint.begin(plan, 1, full_rules("paper", real_address), "a test", begun).network("begun")
    for old, new in zip(begun.layers, begin.layers, strict=True):
        np.testing.assert_array_equal(old.weight, new.weight)
        np.testing.assert_array_equal(old.bias, new.bias)

    best_response = ["ppo", "--out", str(second), "--games", "0", "--decisions", "128", *small]
    best_response += ["--tensorboard", str(tmp_path / "curves")]
    assert command.main(best_response) == 1
    assert "--opponent-games must be at least 1" in capsys.readouterr().err
    best_response += ["--opponent-games", "8", "--opponents", "trained", "--json"]
    assert command.main([*best_response, "--begin-with", str(CLASSIC)]) == 1
    assert "is not a policy of `ppo`" in json.loads(capsys.readouterr().out)["message"]
    assert command.main([*best_response, "--begin-with", str(first), "--width", "16"]) == 1
    assert f"--width 16: the layers of {first} have 8, 8 units" in json.loads(capsys.readouterr().out)["message"]
    assert command.main([*best_response, "--begin-with", str(first), "--width", "8"]) == 0
    trained = json.loads(capsys.readouterr().out)
    assert trained["decisions"] == 128
    assert [evaluation["opponents"][0] for evaluation in trained["evaluations"]] == ["greedy", "random", "trained"]
    assert [layer.bias.shape for layer in network.load(second).layers] == [layer.bias.shape for layer in begun.layers]
    (curves,) = (tmp_path / "curves").iterdir()
    assert all(tag in curves.read_bytes() for tag in (b"losses/entropy", b"points_per_shift/trained"))


def test_a_second_training_does_not_write_the_files_of_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    training = ["ppo", "--out", str(tmp_path / "one.safetensors"), "--decisions", "1"]

    def start(_: object) -> None:
        assert command.main(training) == 1
        raise ValueError("started")

    monkeypatch.setattr(ppo_command, "_start", start)
    assert command.main(training) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert "one.jsonl exists" in first
    assert second == "error: started"
    assert not list(tmp_path.iterdir())


def test_the_command_reports_errors(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nothing = str(tmp_path / "nothing.safetensors")
    assert command.main(["ppo", "--out", nothing, "--decisions", "1", "--resume", "--address", real_address]) == 1
    assert "leave out --resume" in capsys.readouterr().err
    assert (
        command.main(["ppo", "--out", nothing, "--decisions", "1", "--games", "3", "--steps", "3", "--address", real_address]) == 1
    )
    assert "do not split" in capsys.readouterr().err
    both = ["ppo", "--out", nothing, "--decisions", "1", "--all-hands", "--opponent-games", "8", "--address", real_address]
    assert command.main(both) == 1
    assert "leave out --all-hands" in capsys.readouterr().err
    for ignored in (["--opponent-python", "python"], ["--opponent-arguments", "{}"]):
        against = ["--opponent-games", "8", "--opponents", "greedy", "trained", "greedy", *ignored]
        assert command.main(["ppo", "--out", nothing, "--decisions", "1", *against, "--address", real_address]) == 1
        assert "none of greedy, trained, greedy is one of an installed package" in capsys.readouterr().err
    assert command.main(["evaluate", nothing, "--address", real_address]) == 1
    assert "nothing.safetensors" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    with pytest.raises(SystemExit) as ended:
        command.main(["ppo", "--out", nothing])
    assert ended.value.code == 2
    assert "--minutes" in capsys.readouterr().err
