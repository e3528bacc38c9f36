"""The experiments: intervals, tables and files with made-up figures, and the complete command on the real server."""

import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chefshat.errors import INTERRUPTED
from chefshat.learn.figures import Line
from drawing import a_figure, png_size

from chefshat_paper.experiments import Estimate, Result, Table, paper, results, stats
from chefshat_paper.experiments.__main__ import main, parse

# These need the extra `learn`.
from chefshat_paper.experiments import command, mechanics, page, rules, tables  # isort: skip

PAGE = Path(__file__).resolve().parents[3] / "docs" / "experiments.md"

# A learning experiment compiles a program for each kind of agent.
LEARNING = ("rules", "winning")
QUICKER = [name for name in command.EXPERIMENTS if name not in LEARNING]
ALL = [*QUICKER, *(pytest.param(name, marks=pytest.mark.slow) for name in LEARNING)]


def a_result(experiment: str = "mechanics", *, quick: bool = False) -> Result:
    rows: list[list[results.Cell]] = [
        ["all", Estimate(0.28, percent=True, digits=0), stats.share(70, 250)],
        ["none", None, Estimate(-0.82, -0.9, 0.1, digits=2)],
    ]
    return Result(
        experiment=experiment,
        title="Experiment 1",
        seeds=[1],
        quick=quick,
        settings={"games": 250},
        rules={"all": {"preset": "paper"}},
        tables=[Table("starter", "Who wins | who loses", ["agents", "paper", "ours"], rows, note="In brackets intervals.")],
        figures=[a_figure()],
        run={"command": "python", "seconds": 1.5, "package_version": "0", "server_version": "0", "python": "3"},
    )


# From Newcombe (1998), table I, to four digits.
@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_interval(hits: int, of: int, low: float, high: float) -> None:
    estimate = stats.share(hits, of)
    assert (estimate.value, estimate.low, estimate.high) == pytest.approx((hits / of, low, high), abs=5e-5)
    mirrored = stats.share(of - hits, of)
    assert (mirrored.low, mirrored.high) == pytest.approx((1 - high, 1 - low), abs=5e-5)


def test_means_and_spreads() -> None:
    estimate = stats.mean([1, 2, 3, 4])
    half = 1.96 * np.sqrt(5 / 3 / 4)
    assert (estimate.value, estimate.low, estimate.high) == pytest.approx((2.5, 2.5 - half, 2.5 + half), abs=1e-4)
    assert stats.mean([7]) == Estimate(7.0)
    assert stats.spread([4.0, 2.0, 3.0, 1.0]) == Estimate(2.5, 1.0, 4.0, error=float(np.sqrt(5 / 3) / 2))
    assert stats.spread([3.0]) == Estimate(3.0, 3.0, 3.0)
    assert stats.clustered([4.0, 2.0, 3.0, 1.0]) == Estimate(2.5, error=float(np.sqrt(5 / 3) / 2))
    assert stats.spread([0.1] * 3).value == 0.1
    for refused in (
        lambda: stats.mean([]),
        lambda: stats.spread([]),
        lambda: stats.share(3, 2),
        lambda: stats.band("", [1], [[1, 2]]),
    ):
        with pytest.raises(ValueError):  # noqa: PT011 - that it is refused is all that is said
            refused()


def test_values_that_agree_within_a_cluster_are_less_certain() -> None:
    # Clusters of four equal values: only every fourth is independent. The errors differ by 2, and the few degrees of freedom.
    values = np.repeat([[1.0], [0.0], [0.0], [1.0]], 4, axis=1)
    assert stats.cluster_ratio(values) == pytest.approx(2 * np.sqrt((15 / 16) / (3 / 4)))
    independent = np.random.default_rng(1).random((400, 250))
    assert stats.cluster_ratio(independent) == pytest.approx(1, abs=0.1)
    with pytest.raises(ValueError, match="two clusters"):
        stats.cluster_ratio([[1, 2]])


def test_curves_over_repetitions() -> None:
    line = stats.band("learner", [1, 2, 3], [[1, 2, 3], [3, 2, 1]])
    assert line == Line("learner", [1, 2, 3], [2, 2, 2], [1, 2, 1], [3, 2, 3])
    assert stats.smooth([[1, 2, 3, 4], [4, 4, 4, 4]], 2).tolist() == [[1, 1.5, 2.5, 3.5], [4, 4, 4, 4]]
    assert stats.smooth([1, 2, 3], 1).tolist() == [1, 2, 3]


def test_a_table_as_text_and_as_markdown() -> None:
    (table,) = a_result().tables
    assert tables.text(table).splitlines() == [
        "Who wins | who loses",
        "",
        "agents  paper                   ours",
        "─" * 36,
        "all       28%      28.0% (22.8\u201333.9)",
        "none        \u2013  -0.82 (-0.90 to 0.10)",
        "",
        "In brackets intervals.",
    ]
    assert tables.markdown(table).splitlines() == [
        "**Who wins \\| who loses**",
        "",
        "| agents | paper | ours |",
        "| :--- | ---: | ---: |",
        "| all | 28% | 28.0% (22.8\u201333.9) |",
        "| none | \u2013 | -0.82 (-0.90 to 0.10) |",
        "",
        "In brackets intervals.",
    ]
    with pytest.raises(ValueError, match="has 2 columns"):
        Table("t", "T", ["one", "two"], [[1, 2], [1]])


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        (1234567, "1,234,567"),
        (0.5, "0.5"),
        ("word", "word"),
        (None, "\u2013"),
        (Estimate(-0.0001), "0.0"),
        (Estimate(1.0, percent=True), "100.0%"),
        (Estimate(0.5, 0.25, 0.75, percent=True, digits=0, error=0.1), "50 ± 10% (25\u201375)"),
        (Estimate(142.0, error=4.7, digits=0), "142 ± 5"),
    ],
)
def test_a_cell(cell: results.Cell, shown: str) -> None:
    assert tables.show(cell) == shown


def test_a_results_file_survives_writing_and_reading(tmp_path: Path) -> None:
    result = a_result()
    path = tmp_path / "mechanics.json"
    results.write(result, path)
    read = results.read(path)
    assert results.as_json(read) == results.as_json(result)
    assert tables.text(read.tables[0]) == tables.text(result.tables[0])
    assert read.figures[0].panels[0].lines[0].y[0] == 0.1235
    assert [file.name for file in tmp_path.iterdir()] == ["mechanics.json"]


@pytest.mark.parametrize(
    "spoil", [lambda plain: plain.pop("format"), lambda plain: plain.pop("tables"), lambda plain: plain.update(more=1)]
)
def test_other_files_are_refused(
    tmp_path: Path, spoil: Callable[[dict[str, object]], object], capsys: pytest.CaptureFixture[str]
) -> None:
    plain = results.as_json(a_result())
    spoil(plain)
    with pytest.raises(ValueError, match="results file"):
        results.from_json(plain)
    (tmp_path / "mechanics.json").write_text(json.dumps(plain))
    assert main(["report", str(tmp_path)]) == 1
    (tmp_path / "mechanics.json").write_text("[]")
    for arguments in (["report", str(tmp_path)], ["mechanics", "--quick", "--out", str(tmp_path), "--address", "127.0.0.1:1"]):
        assert main(arguments) == 1
        assert "not a results file" in capsys.readouterr().err.splitlines()[-1]


def test_a_page_is_filled_only_between_the_marks() -> None:
    result = a_result()
    begin, end = page.marks("mechanics")
    text = f"# Page\n\nBefore.\n\n{begin}\nold\n{end}\n\nAfter.\n\n{page.marks('rules')[0]}\n{page.marks('rules')[1]}\n"
    filled = page.fill(text, [result])
    assert filled.startswith(f"# Page\n\nBefore.\n\n{begin}\n")
    assert filled.endswith(text[text.index(end) :])
    assert "old" not in filled
    assert tables.markdown(result.tables[0]) in filled
    assert "![All of it](images/experiments-mechanics-curves.png)" in filled
    assert page.fill(filled, [result]) == filled
    for broken in ("# Page\n", f"{begin}\n", f"{end}\n{begin}\n", text + text):
        with pytest.raises(ValueError, match="no place for mechanics"):
            page.fill(broken, [result])


def test_report_prints_and_fills_in_saved_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved = tmp_path / "kept"
    saved.mkdir()
    assert main(["report", str(saved)]) == 1
    assert "no results in" in capsys.readouterr().err
    results.write(a_result(), saved / "mechanics.json")
    (saved / "tuned.json").write_text('{"format": "chefshat-tune-1"}')
    assert main(["report", str(saved)]) == 0
    assert "28.0% (22.8\u201333.9)" in capsys.readouterr().out
    drawn = (saved / "experiments-mechanics-curves.png").read_bytes()
    text = tmp_path / "page.md"
    text.write_text("nothing\n")
    assert main(["report", str(saved), "--page", str(text), "--json"]) == 1
    assert "no place for mechanics" in json.loads(capsys.readouterr().out)["message"]
    text.write_text("\n".join(page.marks("mechanics")))
    assert main(["report", str(saved), "--page", str(text), "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert [result["experiment"] for result in output["results"]] == ["mechanics"]
    assert [Path(file).is_file() for file in output["files"]] == [True, True]
    assert (tmp_path / "images" / "experiments-mechanics-curves.png").read_bytes() == drawn
    assert "| all | 28% |" in text.read_text(encoding="utf-8")


def test_the_page_of_this_project_matches_its_results() -> None:
    if not PAGE.is_file():
        pytest.skip("the page is in a checkout of the whole project alone")
    text = PAGE.read_text(encoding="utf-8")
    saved = [results.read(path) for path in sorted((PAGE.parent / "experiments").glob("*.json"))]
    assert {result.experiment for result in saved} >= set(command.EXPERIMENTS)
    assert page.fill(text, saved) == text
    for result in saved:
        assert not result.quick
        for figure in result.figures:
            assert png_size((PAGE.parent / page.PICTURES / page.picture_name(result, figure)).read_bytes())[0] > 400


def test_options() -> None:
    assert parse(["all"]).seeds == 5
    assert parse(["all", "--quick"]).seeds == 2
    assert parse(["rules", "--quick", "--seeds", "3"]).seeds == 3
    for wrong in ([], ["cooking"], ["all", "--seeds", "0"], ["all", "--seed", "-1"], ["report"], ["report", "x", "--quick"]):
        with pytest.raises(SystemExit) as exit_info:
            parse(wrong)
        assert exit_info.value.code == 2


@pytest.mark.parametrize("seeds", [(3,), (3, 4), (0, 1, 2, 3, 4)])
@pytest.mark.parametrize("quick", [False, True])
def test_the_command_of_a_result_reproduces_it(seeds: tuple[int, ...], quick: bool) -> None:
    made = replace(a_result("rules", quick=quick), seeds=seeds)
    _, _, module, *arguments = command._command(made).split()
    options = parse(arguments)
    assert module == "chefshat_paper.experiments"
    assert (options.what, options.quick, tuple(range(options.seed, options.seed + options.seeds))) == ("rules", quick, seeds)


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--help"], ["rules", "--help"], ["report", "--help"]):
        with pytest.raises(SystemExit) as exit_info:
            main(arguments)
        assert exit_info.value.code == 0
        assert "example" in capsys.readouterr().out


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def run(options: object) -> int:
        raise ModuleNotFoundError("No module named 'jax.numpy'", name="jax.numpy")

    monkeypatch.setattr(command, "run", run)
    assert main(["rules"]) == 1
    assert "jax" in (output := capsys.readouterr().err)
    assert "pip install 'chefshat-paper[learn]'" in output


def test_a_quick_run_never_replaces_a_full_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results.write(a_result(), tmp_path / "mechanics.json")
    before = (tmp_path / "mechanics.json").read_bytes()
    assert main(["mechanics", "--quick", "--out", str(tmp_path), "--address", "127.0.0.1:1"]) == 1
    assert "give another --out" in capsys.readouterr().err
    assert (tmp_path / "mechanics.json").read_bytes() == before


def test_results_need_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "a file"
    file.touch()
    for out in (file, file / "within"):
        assert main(["mechanics", "--quick", "--out", str(out), "--address", "127.0.0.1:1"]) == 1
        assert re.search(rf"--out {out}: .*is a file, not a folder", capsys.readouterr().err)


def test_results_name_the_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def git(*arguments: str) -> str:
        options = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org", "-C", str(tmp_path)]
        return subprocess.run(["git", *options, *arguments], check=True, capture_output=True, text=True).stdout.strip()

    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert command._commit(package) == "unknown"
    assert "not in a git checkout" in capsys.readouterr().err
    git("init", "-q")
    # A package within a checkout that does not contain it, such as an installed one.
    assert command._commit(package) == "unknown"
    git("add", ".")
    git("commit", "-q", "-m", "package")
    capsys.readouterr()
    commit = command._commit(package)
    assert git("rev-parse", "HEAD").startswith(commit)
    assert len(commit) == command.COMMIT_DIGITS
    (package / "__init__.py").write_text("changed = True")
    assert command._commit(package) == f"{commit}-dirty"
    assert capsys.readouterr().err == ""


def test_a_missing_server_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mechanics", "--quick", "--out", str(tmp_path), "--address", "127.0.0.1:1", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["reason"] == "UNAVAILABLE"
    assert list(tmp_path.iterdir()) == []


def test_the_papers_figures() -> None:
    assert list(paper.STARTER_WINS) == list(paper.LAPS) == list(mechanics.CONDITIONS)
    assert sum(paper.RULES_WINS) == sum(paper.WINNING_WINS_FOUR) == paper.SHIFTS


@pytest.fixture(scope="module")
def quick_run(request: pytest.FixtureRequest, real_address: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a quick run of all experiments, except for the longest unless a test that is run needs them."""
    folder = tmp_path_factory.mktemp("experiments")
    if any(item.get_closest_marker("slow") for item in request.session.items):
        assert main(["all", "--quick", "--out", str(folder), "--address", real_address]) == 0
        return folder
    for name in QUICKER:
        assert main([name, "--quick", "--out", str(folder), "--address", real_address]) == 0
    return folder


@pytest.mark.server
@pytest.mark.parametrize("name", ALL)
def test_a_quick_run_writes_results_and_plots(quick_run: Path, name: str) -> None:
    result = results.read(command.results_file(quick_run, name))
    assert result.experiment == name
    assert result.quick
    assert result.tables
    assert result.figures
    assert result.rules
    assert all(rules["faces"] == 11 for rules in result.rules.values())
    seeds = 1 if name == "mechanics" else 2
    assert result.run["command"] == f"python -m chefshat_paper.experiments {name} --seed 1 --seeds {seeds} --quick"
    assert result.run["package_version"]
    assert result.run["server_version"]
    assert result.run["commit"]
    for figure in result.figures:
        assert png_size((quick_run / page.picture_name(result, figure)).read_bytes())[0] > 400


@pytest.mark.server
@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("mechanics", ["28%", "35%", "60%", "31", "33", "35"]),
        pytest.param("rules", ["0.5", "-0.82", "65", "62", "63", "60"], marks=pytest.mark.slow),
        pytest.param("winning", ["215", "117", "45", "55", "33", "30%"], marks=pytest.mark.slow),
    ],
)
def test_the_papers_figures_are_beside_ours(quick_run: Path, name: str, reported: list[str]) -> None:
    result = results.read(command.results_file(quick_run, name))
    shown = [tables.show(cell).split(" ")[0] for table in result.tables for row in table.rows for cell in row]
    assert set(reported) <= set(shown)


@pytest.mark.server
def test_mechanics_counts_shifts(quick_run: Path) -> None:
    result = results.read(command.results_file(quick_run, "mechanics"))
    assert len(result.values) == len(mechanics.PRESETS) * (len(mechanics.CONDITIONS) + len(mechanics.OF_DEFAULTS))
    for counted in result.values.values():
        assert counted["shifts"] == mechanics.QUICK.shifts > mechanics.FEW
        assert 0 < counted["starter_won"] < counted["shifts"]
        # Four hands of seventeen cards need more than one lap, and a pizza at least one turn.
        assert counted["laps"] > counted["shifts"]
        assert counted["turns"] > counted["pizzas"] > counted["shifts"]
    rules = result.rules
    assert rules["original2020, without jokers"]["jokers"] == 0
    assert rules["paper, without exchange"]["exchange"] is False
    assert rules["paper, without special actions"]["special_actions"] is False
    assert all(each["target_shifts"] == mechanics.QUICK.shifts_per_game for each in rules.values())
    # No two conditions give the same game.
    assert len({json.dumps(values) for values in result.values.values()}) == len(result.values)


@pytest.mark.slow
@pytest.mark.server
def test_after_ten_illegal_actions_a_random_legal_one_is_taken(quick_run: Path) -> None:
    values = results.read(command.results_file(quick_run, "rules")).values
    assert values["may not pass idly"]["most_attempts_at_a_decision"] == rules.CONDITIONS["may not pass idly"].agent.wrong_limit
    # Without the limit idle passes are legal.
    assert values["sees what is legal"]["most_attempts_at_a_decision"] > 10


@pytest.mark.slow
@pytest.mark.server
def test_the_same_seed_gives_the_same_result(
    quick_run: Path, real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Without an address a server is started.
    arguments = ["mechanics", "--quick", "--out", str(tmp_path), "--json"]
    assert main(arguments) == 0
    (again,) = json.loads(capsys.readouterr().out)["results"]
    before = json.loads(command.results_file(quick_run, "mechanics").read_text(encoding="utf-8"))
    for key in ("tables", "values", "rules", "settings", "seeds"):
        assert again[key] == before[key]
    assert main([*arguments, "--address", real_address, "--seed", "2"]) == 0
    (other,) = json.loads(capsys.readouterr().out)["results"]
    assert other["values"] != before["values"]


@pytest.mark.slow
@pytest.mark.server
def test_trained_agents_are_the_same_with_the_same_seed(quick_run: Path, real_address: str, tmp_path: Path) -> None:
    assert main(["rules", "--quick", "--out", str(tmp_path), "--address", real_address]) == 0
    before, again = (results.read(command.results_file(folder, "rules")) for folder in (quick_run, tmp_path))
    assert (again.tables, again.values) == (before.tables, before.values)


def test_ctrl_c_has_the_exit_code_of_all_commands(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(options: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "run", interrupted)
    assert main(["mechanics", "--quick"]) == INTERRUPTED
    assert "the results of finished experiments are saved" in capsys.readouterr().err
