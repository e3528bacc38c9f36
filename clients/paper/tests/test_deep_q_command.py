"""The command `deep-q` and its files: Ctrl-C saves the training, and a resumed training keeps its settings."""

import dataclasses
import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from chefshat import pb
from chefshat.learn import curve, network, runs, training_log
from chefshat.learn.__main__ import main as ppo_main
from chefshat.learn.evaluation import Evaluation
from waiting import LIMIT_S, wait_until

from chefshat_paper.learn import checkpoint, deep_q, deep_q_command, tune
from chefshat_paper.learn.__main__ import main, parse
from chefshat_paper.learn.deep_q import DeepQConfig

SMALL = {"hidden": [8], "batch_size": 4, "memory_size": 32}
FEW_EVALUATIONS = ["--evaluations", "2", "--evaluation-games", "2"]


class Place:
    """A folder with hyper-parameters of a small agent, and the command that trains it there."""

    def __init__(self, folder: Path, address: str) -> None:
        self.out = folder / "agent.safetensors"
        self.state = folder / "agent.training"
        self.address = address
        self.parameters = folder / "small.json"
        self.parameters.write_text(json.dumps({"parameters": SMALL}))

    def arguments(self, shifts: int, *more: str) -> list[str]:
        files = ["--out", str(self.out), "--parameters", str(self.parameters)]
        return ["deep-q", *files, "--shifts", str(shifts), "--address", self.address, *FEW_EVALUATIONS, *more]


@pytest.fixture
def place(tmp_path: Path, real_address: str) -> Place:
    return Place(tmp_path, real_address)


@pytest.mark.slow
@pytest.mark.server
def test_a_training_resumes_after_ctrl_c(
    place: Place, processes: list["subprocess.Popen[str]"], capsys: pytest.CaptureFixture[str]
) -> None:
    # Far more Shifts than are played before Ctrl-C.
    command = [sys.executable, "-m", "chefshat_paper.learn", *place.arguments(1_000_000, "--save-every", "1", "--seed", "5")]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    processes.append(running)
    # The network is written last, so both files exist during the training: first at the evaluation before it.
    wait_until(lambda: place.out.exists() and checkpoint.load(place.state).shifts >= 1, "the network is written", running)
    during = checkpoint.load(place.state)
    running.send_signal(signal.SIGINT)
    _, message = running.communicate(timeout=LIMIT_S)
    assert running.returncode == 130, message
    assert "of 1,000,000 Shifts" in message
    assert "resume by the same command with --resume" in message
    assert "Traceback" not in message

    stopped = checkpoint.load(place.state)
    assert stopped.shifts >= during.shifts >= 1
    assert int(stopped.agents.updates[0]) > 0
    (expected,) = stopped.networks("deep-q")
    for saved, layer in zip(network.load(place.out).layers, expected.layers, strict=True):
        np.testing.assert_array_equal(saved.weight, layer.weight)

    assert main(place.arguments(stopped.shifts + 2, "--resume", "--json")) == 0
    assert json.loads(capsys.readouterr().out)["event"] == "trained"
    after = checkpoint.load(place.state)
    assert (after.shifts, after.seed) == (stopped.shifts + 2, 5)
    assert int(after.agents.updates[0]) > int(stopped.agents.updates[0])
    assert int(after.agents.remembered[0]) > int(stopped.agents.remembered[0])
    assert after.rules == runs.full_rules("paper", place.address)
    assert after.progress.runs == 2
    assert after.progress.decisions > stopped.progress.decisions > 0
    first, second = after.trained_by.split("; ")
    assert ("--seed 5" in first, "--resume" in second) == (True, True)
    assert network.load(place.out).info.trained_by == after.trained_by


@pytest.mark.server
def test_its_log_is_like_that_of_ppo(place: Place, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deep_q_log, ppo_log = place.out.with_suffix(".jsonl"), tmp_path / "ppo.jsonl"
    # Without a mask, most of its answers are illegal, and each is a step.
    command = place.arguments(1, "--seed", "5", "--json", "--mask")
    command[command.index("--shifts")] = "--decisions"
    command[command.index("1")] = "40"
    assert main(command) == 0
    trained = json.loads(capsys.readouterr().out)
    assert (trained["decisions"], trained["runs"], [one["games"] for one in trained["evaluations"]]) == (40, 1, [2, 2])
    # Forced decisions do not count, but the agent learns from them. The first update waits for a batch.
    assert trained["updates"] > 40
    small = ["--games", "16", "--steps", "16", "--minibatches", "2", "--width", "8", "--value-width", "8", *FEW_EVALUATIONS]
    ppo = ["ppo", "--out", str(ppo_log.with_suffix(".safetensors")), "--decisions", "512", "--address", place.address]
    assert ppo_main([*ppo, *small]) == 0
    logs = [[json.loads(line) for line in log.read_text().splitlines()] for log in (deep_q_log, ppo_log)]
    assert [line["event"] for line in logs[0]] == ["setup", "evaluation", "evaluation", "evaluation"]
    assert [line["decisions"] for line in logs[0][1:]] == [0, 20, 40]
    assert [line["evaluations"][0]["games"] for line in logs[0][1:]] == [2, 2, 2]
    for ours, theirs in zip(logs[0], logs[1], strict=True):
        assert ours.keys() == theirs.keys()
    assert logs[0][0]["rules"] == logs[1][0]["rules"]
    panels = curve.figure([curve.read(log.read_text()) for log in (deep_q_log, ppo_log)]).panels
    assert [[line.label for line in panel.lines] for panel in panels] == [["deep-q", "ppo"]] * 2

    command[command.index("40")] = "60"
    assert main([*command, "--resume"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["runs"] == 2
    assert [line["decisions"] for line in curve.read(deep_q_log.read_text()).evaluations] == [0, 20, 40, 60]
    assert main([*command, "--resume"]) == 1
    assert "has taken 60 decisions already: give more than that with --decisions" in json.loads(capsys.readouterr().out)["message"]


@pytest.mark.server
@pytest.mark.parametrize("evaluation", range(5))
@pytest.mark.parametrize("is_logged", [False, True])
def test_a_training_that_was_killed_at_an_evaluation_has_each_of_them_once(
    place: Place, evaluation: int, is_logged: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = place.arguments(1, "--mask", "--save-every", "1000", "--evaluations", "4", "--evaluation-games", "1")
    command[command.index("--shifts")] = "--decisions"
    command[command.index("1")] = "40"
    evaluate, evaluated = deep_q_command._Running.evaluate, []

    def killed(running: deep_q_command._Running, agents: deep_q.Agents) -> list[Evaluation]:
        evaluated.append(running.decisions)
        if len(evaluated) <= evaluation:
            return evaluate(running, agents)
        if is_logged:
            evaluate(running, agents)
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr(deep_q_command._Running, "evaluate", killed)
        with pytest.raises(SystemExit):
            main(command)
    assert evaluated == [0, 10, 20, 30, 40][: evaluation + 1]
    # The checkpoint may be newer than the network.
    place.out.unlink()
    is_finished = evaluation == 4 and is_logged
    capsys.readouterr()
    assert main([*command, "--resume"]) == (1 if is_finished else 0)
    log = place.out.with_suffix(".jsonl").read_text()
    assert [line["decisions"] for line in training_log.entries(log) if line["event"] == "evaluation"] == [0, 10, 20, 30, 40]
    assert [line["decisions"] for line in curve.read(log).evaluations] == [0, 10, 20, 30, 40]
    assert ("has taken 40 decisions already" in capsys.readouterr().err) == is_finished
    assert place.out.exists() != is_finished


@pytest.fixture(scope="module")
def full_rules(real_address: str) -> pb.RuleSet:
    rules = runs.full_rules("paper", real_address)
    rules.ClearField("target_points")
    rules.target_shifts = 3
    return rules


@pytest.mark.server
@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--mask"], "mask False, not True"),
        (["--opponents", "greedy"], "opponents random, not greedy"),
        (["--rewards", "validity"], "rewards paper, not validity"),
        (["--seed", "2"], "seed 7, not 2"),
        (["--rules", "rulebook"], "rules points [5, 3, 1, 0], not [3, 2, 1, 0]"),
        (["--shifts", "3"], "has played 3 Shifts already: give more than that with --shifts"),
    ],
)
def test_contradicting_options_are_refused(
    place: Place, full_rules: pb.RuleSet, given: Sequence[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    begin(place, full_rules)
    before = place.state.read_bytes()
    assert main(place.arguments(5, "--resume", *given)) == 1
    found = capsys.readouterr().err
    assert message in found
    assert place.state.read_bytes() == before
    assert not place.out.exists()


@pytest.mark.server
def test_a_training_of_an_earlier_version_is_evaluated_in_games_of_the_usual_length(place: Place, full_rules: pb.RuleSet) -> None:
    begin(place, full_rules, mask=True)
    assert main(place.arguments(4, "--resume")) == 0
    assert checkpoint.load(place.state).rules == runs.full_rules("paper", place.address)
    (evaluated, *_) = curve.read(place.out.with_suffix(".jsonl").read_text()).evaluations
    assert evaluated["decisions"] == 0
    assert evaluated["evaluations"][0]["shifts"] >= 2 * 3  # Two games to 15 points, of which a Shift brings 5 at most.


@pytest.mark.server
def test_contradicting_parameters_are_refused(place: Place, full_rules: pb.RuleSet, capsys: pytest.CaptureFixture[str]) -> None:
    begin(place, full_rules)
    place.parameters.write_text(json.dumps({"parameters": {**SMALL, "batch_size": 8}}))
    assert main(place.arguments(5, "--resume")) == 1
    assert "batch size 4, not 8" in capsys.readouterr().err


@pytest.mark.server
def test_tuned_parameters_come_with_the_settings_for_which_they_were_found(
    place: Place, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tune, "evaluate", lambda *_, **__: [0.5])
    found = place.parameters.with_name("tuned.json")
    searched = ["tune", "--out", str(found), "--trials", "1", "--mask", "--opponents", "greedy", "--rewards", "validity"]
    assert main(searched) == 0
    _, command = capsys.readouterr().out.strip().split("python -m chefshat_paper.learn ")
    assert command == f"deep-q --parameters {found} --out FILE"
    tuned = json.loads(found.read_text())
    assert {name: tuned[name] for name in deep_q_command.TUNED_FOR} == {"mask": True, "opponents": "greedy", "rewards": "validity"}
    # Smaller networks, which learn sooner.
    place.parameters.write_text(json.dumps({**tuned, "parameters": SMALL}))
    assert main(place.arguments(1)) == 0
    training = checkpoint.load(place.state)
    assert (training.config.mask, training.opponents, training.rewards) == (True, "greedy", "validity")
    assert main(place.arguments(2, "--resume")) == 0
    assert main(place.arguments(1, "--force", "--opponents", "random")) == 0
    training = checkpoint.load(place.state)
    assert (training.config.mask, training.opponents, training.rewards) == (True, "random", "validity")


def test_a_second_training_does_not_write_the_files_of_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    training = ["deep-q", "--out", str(tmp_path / "one.safetensors")]

    def train(*_: object) -> None:
        assert main(training) == 1
        raise ValueError("started")

    monkeypatch.setattr(deep_q_command, "_train", train)
    assert main(training) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert "one.training exists" in first
    assert second == "error: started"
    assert not list(tmp_path.iterdir())


def test_resuming_needs_a_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Place(tmp_path, "127.0.0.1:1").arguments(5, "--resume")) == 1
    assert "leave out --resume" in capsys.readouterr().err


def begin(place: Place, rules: pb.RuleSet, *, mask: bool = False) -> None:
    """Writes a checkpoint after 3 Shifts."""
    config = dataclasses.replace(DeepQConfig(), hidden=(8,), batch_size=4, memory_size=32, mask=mask)
    agents = deep_q.start(config, [7])
    checkpoint.save(place.state, checkpoint.Training(config, agents, rules, "a command", "random", "paper", 7, 3))


def test_given_options_are_distinguished_from_defaults() -> None:
    options = parse(["deep-q", "--out", "o", "--shifts", "250", "--mask"])
    assert options.given == {"out": Path("o"), "shifts": 250, "mask": True}
    assert (options.mask, options.opponents, parse(["deep-q", "--out", "o"]).mask) == (True, "random", False)
