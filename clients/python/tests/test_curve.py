"""The plot of a training."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chefshat import pb
from chefshat.learn import __main__ as command
from chefshat.learn.curve import figure, interquartile_mean, read
from chefshat.learn.evaluation import evaluate
from chefshat.learn.runs import EVALUATION_SEED
from chefshat.learn.training_log import Progress, entries, last_evaluated, log_evaluations, log_setup, written


def a_look(decisions: int, points: float) -> dict[str, object]:
    one = {"opponents": ["greedy", "greedy", "greedy"], "points": points, "standard_error": 0.5}
    return {"event": "evaluation", "decisions": decisions, "evaluations": [one]}


LOG = "\n".join(
    json.dumps(line)
    for line in (
        {"event": "setup", "rules": {"players": 4, "points": [5, 3, 1, 0]}},
        {"event": "update", "decisions": 5},
        a_look(0, 0.5),
        a_look(2_000_000, 3.0),
    )
)


def test_each_evaluation_is_a_point_with_its_interval() -> None:
    (panel,) = figure([read(LOG)]).panels
    (line,) = panel.lines
    assert panel.title == "Against 3 greedy"
    assert (list(line.x), list(line.y)) == ([0.0, 2.0], [0.5, 3.0])
    assert line.high[1] == pytest.approx(3.98, abs=1e-3)
    assert panel.levels[0].y == 2.25


def test_evaluations_of_one_game_have_no_interval() -> None:
    (panel,) = figure([read(LOG.replace("0.5}]", "null}]"))]).panels
    assert panel.lines[0].y[1] == 3.0
    assert np.isnan([panel.lines[0].low, panel.lines[0].high]).all()


def test_the_command_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = tmp_path / "log.jsonl", tmp_path / "curve.png"
    log.write_text(LOG)
    assert command.main(["curve", str(log), "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["out"], len(printed["summary"])) == (str(out), 2)
    assert printed["summary"][0].items() >= {"panel": "Against 3 greedy", "label": "the policy", "points": 3.0}.items()
    assert printed["summary"][1] == {"panel": "Against 3 greedy", "label": "mean of all seats", "points": 2.25}
    assert out.read_bytes().startswith(b"\x89PNG")
    log.write_text(LOG.splitlines()[0])
    capsys.readouterr()
    assert command.main(["curve", str(log), "--out", str(out), "--json"]) == 1
    output = json.loads(capsys.readouterr().out)
    assert (output["event"], "has no evaluation" in output["message"], str(log) in output["message"]) == ("error", True, True)
    for no_log in ("garbage", "17", "[1]"):
        log.write_text(no_log)
        assert command.main(["curve", str(log), "--out", str(out)]) == 1
        assert capsys.readouterr().err.startswith(f"error: {log}: this is not a log")
    assert command.main(["curve", str(tmp_path / "missing"), "--out", str(out)]) == 1
    assert capsys.readouterr().err.startswith("error: there is no file")


def test_a_torn_line_is_left_out(tmp_path: Path) -> None:
    path, torn = tmp_path / "log.jsonl", json.dumps(a_look(3_000_000, 4.0))[:60]
    path.write_text(f"{LOG}\n{torn}")
    assert read(path.read_text()) == read(LOG)
    assert last_evaluated(path) == 2_000_000
    # The training is resumed. Earlier versions wrote on in the torn line.
    with written(path, append=True):
        log_setup("ppo", {}, 1, pb.RuleSet(), "test")
        log_evaluations(Progress(decisions=3_000_000), [], {})
    events = [entry["event"] for entry in entries(path.read_text())]
    assert events == ["setup", "update", "evaluation", "evaluation", "setup", "evaluation"]
    assert last_evaluated(path) == 3_000_000
    path.write_text(f"{LOG}\n{torn}{json.dumps({'event': 'setup'})}")
    assert last_evaluated(path) == 2_000_000


def a_run(seed: int, points: float, **plan: object) -> str:
    setup = {"event": "setup", "seed": seed, "plan": {"games": 256, "hyper": plan}, "rules": {"players": 4, "points": [5, 3, 1, 0]}}
    return "\n".join(map(json.dumps, (setup, a_look(0, 0.5), a_look(2_000_000 + 1000 * seed, points))))


def test_runs_that_differ_in_their_seed_are_one_line() -> None:
    runs = [read(a_run(seed, points, clip=0.2)) for seed, points in enumerate([3.0, 9.0, 2.0, 2.5, -7.0])]
    others = [read(a_run(seed, 4.0, clip=0.1)) for seed in range(2)]
    (panel,) = figure([*runs, *others, read(a_run(9, 1.0, clip=0.3))]).panels
    first, second, third = panel.lines
    assert first.label == "clip 0.2: interquartile mean of 5 runs"
    # The best and the worst are left out.
    assert first.y == [0.5, pytest.approx(2.5)]
    assert first.x[1] == pytest.approx(2.002)
    assert first.low[1] < 2.5 < first.high[1]
    assert (first.low[0], first.high[0]) == (0.5, 0.5)
    assert (second.label, second.y[1], second.low[1]) == ("clip 0.1: interquartile mean of 2 runs", 4.0, 4.0)
    assert third.label == "clip 0.3"
    assert third.high[1] == pytest.approx(1.98, abs=1e-3)
    shorter = read("\n".join(a_run(7, 1.0, clip=0.2).splitlines()[:2]))
    with pytest.raises(ValueError, match="have 1 and 2 evaluations: give them one budget"):
        figure([*runs, shorter])
    against_random = read(a_run(8, 1.0).replace("greedy", "random"))
    with pytest.raises(ValueError, match="against different opponents"):
        figure([runs[0], against_random])


def test_other_algorithms_are_other_lines() -> None:
    logs = [a_run(1, 3.0, all_hands=False), a_run(1, 4.0, all_hands=True)]
    deep_q = a_run(1, 1.0, mask=True).replace('"event": "setup"', '"event": "setup", "algorithm": "deep-q"')
    (panel,) = figure([read(log) for log in (*logs, deep_q, deep_q.replace('"seed": 1', '"seed": 2'))]).panels
    assert [line.label for line in panel.lines] == [
        "ppo, all_hands False",
        "ppo, all_hands True",
        "deep-q: interquartile mean of 2 runs",
    ]
    assert panel.x_label == "decisions of the training, millions"
    assert panel.lines[2].x[1] == 2.001
    (panel,) = figure([read(logs[0].replace("2001000", "2001"))]).panels
    assert (panel.x_label, panel.lines[0].x[1]) == ("decisions of the training, thousands", 2.001)
    more_games = read(logs[1].replace('"points": 0.5', '"games": 3, "points": 0.5'))
    with pytest.raises(ValueError, match="in different numbers of games"):
        figure([read(logs[0]), more_games])


def test_baselines_play_the_games_of_the_evaluations() -> None:
    pytest.importorskip("chefshat_native")
    rules = {"players": 2, "faces": 4, "jokers": 0, "targetShifts": 2, "points": [5, 0]}
    (setup, first, last) = (
        json.loads(line.replace('"points": 0.5', '"games": 3, "points": 0.5')) for line in a_run(1, 3.0).splitlines()
    )
    for line in (first, last):
        line["evaluations"][0]["opponents"] = ["random"]
    run = read("\n".join(map(json.dumps, ({**setup, "rules": rules}, first, last))))
    (panel,) = figure([run], ["greedy", "random"]).panels
    expected = [evaluate(name, "random", games=3, seed=EVALUATION_SEED, rules=run.rules).points for name in ("greedy", "random")]
    assert [(level.label, level.y) for level in panel.levels] == list(zip(("greedy", "random"), expected, strict=True))
    other_rules = replace(run, seed=2, rules=pb.RuleSet(players=2, faces=5))
    with pytest.raises(ValueError, match="must all have the same"):
        figure([run, other_rules], ["greedy"])


def test_runs_of_other_experiments_are_other_lines() -> None:
    def labelled(*logs: str) -> list[str]:
        return [line.label for line in figure([read(log) for log in logs]).panels[0].lines]

    one, other = a_run(1, 3.0), a_run(2, 3.0)
    assert labelled(one, other) == ["the policy: interquartile mean of 2 runs"]
    other_rules = other.replace("[5, 3, 1, 0]", "[3, 2, 1, 0]")
    assert labelled(one, other_rules) == ["rules points [5, 3, 1, 0]", "rules points [3, 2, 1, 0]"]
    assert not figure([read(one), read(other_rules)]).panels[0].levels
    begun = [log.replace('"games": 256', f'"games": 256, "begin_with": "{file}"') for log, file in ((one, ""), (other, "a"))]
    assert labelled(*begun) == ["begin_with none", "begin_with a"]
    with pytest.raises(ValueError, match="two runs of the same settings have the seed 1"):
        labelled(one, other, one)


def test_evaluations_of_a_resumed_training_count_once() -> None:
    (setup, first, last) = a_run(1, 3.0).splitlines()
    again, stopped = json.dumps(a_look(0, 0.75)), json.dumps({**a_look(5, 0.25), "stopped": True})
    assert [
        (line["decisions"], line["evaluations"][0]["points"])
        for line in read("\n".join([setup, first, stopped, setup, again, last])).evaluations
    ] == [
        (0, 0.75),
        (2_001_000, 3.0),
    ]
    assert [line["decisions"] for line in read("\n".join([setup, first, stopped])).evaluations] == [0, 5]
    # The checkpoint was written before some of the evaluations, and other games followed.
    looks = [json.dumps(a_look(decisions, 1.0)) for decisions in (0, 10, 20, 30, 12, 22, 32)]
    resumed = read("\n".join([setup, *looks[:4], setup, *looks[4:]]))
    assert [line["decisions"] for line in resumed.evaluations] == [0, 10, 12, 22, 32]


def test_interquartile_means() -> None:
    assert interquartile_mean(np.arange(8.0))[0] == 3.5
    assert interquartile_mean(np.array([0.0, 1, 2, 3, 100]))[0] == 2
    middle, low, high = interquartile_mean(np.random.default_rng(3).normal(7, 2, 400))
    # The interval of a normal sample is about 4 standard errors wide, a little more than that of its mean.
    assert 0.3 < high - low < 0.6
    assert low < middle < high
    with pytest.raises(ValueError, match="two runs or more"):
        interquartile_mean(np.ones(1))


def test_a_coalition_is_drawn_with_its_partner() -> None:
    def log(seed: int, plan: dict[str, object], opponents: list[str]) -> str:
        one = {"opponents": opponents, "points": 2.0, "standard_error": 0.5, "games": 2}
        looks = [{"event": "evaluation", "decisions": at, "evaluations": [one]} for at in (0, 10)]
        setup = {"event": "setup", "rules": {"players": 4, "points": [5, 3, 1, 0]}, "seed": seed, "plan": plan}
        return "\n".join(map(json.dumps, [setup, *looks]))

    pairs = [read(log(seed, {"coalition": True}, ["random", "itself", "random"])) for seed in (1, 2)]
    (panel,) = figure(pairs).panels
    assert (panel.title, len(panel.lines)) == ("Against random, itself, random", 1)
    with pytest.raises(ValueError, match="--baselines"):
        figure(pairs, ["greedy"])
    # Logs of earlier versions lack this setting.
    plans: list[dict[str, object]] = [{}, {"coalition": False}]
    alone = [read(log(seed, plan, ["greedy"] * 3)) for seed, plan in enumerate(plans)]
    (panel,) = figure(alone).panels
    assert [line.label for line in panel.lines] == ["the policy: interquartile mean of 2 runs"]
