"""What the command does: runs experiments against a server, keeps their results, prints and draws them, and shows kept ones again.

The options are read in `__main__`. An experiment's module is imported when it is its turn, since each needs other packages.
"""

import argparse
import contextlib
import importlib
import importlib.metadata
import json
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import chefshat
from chefshat.errors import ChefsHatError, failed
from chefshat.experiments import page, plots, results, tables
from chefshat.experiments.progress import Progress
from chefshat.experiments.results import Config, Result
from chefshat.files import write_whole
from chefshat.local_server import LocalServer

EXPERIMENTS = ("mechanics", "rules", "winning")
# Digits behind the point of the seconds an experiment took.
SECONDS_DIGITS = 1


class Refused(Exception):
    """Something the user can put right; its text says how."""


def run(options: argparse.Namespace) -> int:
    """Runs what was asked for, one after another; each result is written as soon as it is there. Returns the exit code."""
    names = EXPERIMENTS if options.what == "all" else (options.what,)
    made: list[Result] = []
    files: list[Path] = []
    try:
        modules = {name: _experiment(name) for name in names}
        folder = _folder(options.out)
        for name in names:
            _keep_full_runs(results_file(folder, name), quick=options.quick)
        with _server(options.address) as address:
            with chefshat.Client(address) as client:
                server_version = client.server_info().server_version
            seeds = tuple(range(options.seed, options.seed + options.seeds))
            config = Config(address=address, seeds=seeds, quick=options.quick, out=folder)
            for experiment in modules.values():
                begun = time.monotonic()
                result = experiment(config, Progress())
                facts = {
                    "package_version": importlib.metadata.version("chefshat"),
                    "server_version": server_version,
                    "python": platform.python_version(),
                    "command": _command(result),
                    "seconds": round(time.monotonic() - begun, SECONDS_DIGITS),
                }
                result = replace(result, run=facts)
                files += write(result, folder)
                made.append(result)
                if not options.json:
                    print(as_text(result), flush=True)
    except (Refused, ChefsHatError, OSError) as error:
        return failed(error, as_json=options.json)
    _finish(made, files, options)
    return 0


def report(options: argparse.Namespace) -> int:
    """Shows the results in a folder again and draws their plots, beside them or into the page that is to be filled.

    Returns the exit code.
    """
    try:
        found = [path for path in sorted(options.folder.glob("*.json")) if path.is_file()]
        if not found:
            raise Refused(f"no results in {options.folder}: run `python -m chefshat.experiments all --out {options.folder}` first")
        made = []
        for path in found:
            try:
                made.append(results.read(path))
            except ValueError as error:
                raise Refused(f"{path}: {error}") from error
        if options.page is None:
            files = [file for result in made for file in draw(result, options.folder)]
        else:
            files = _fill(options.page, made)
    except (Refused, OSError) as error:
        return failed(error, as_json=options.json)
    if not options.json:
        for result in made:
            print(as_text(result))
    _finish(made, files, options)
    return 0


def write(result: Result, folder: Path) -> list[Path]:
    """Writes the results file and the plots; returns their paths."""
    path = results_file(folder, result.experiment)
    results.write(result, path)
    # What is drawn is what the file holds, so that drawing it again gives the same picture.
    return [path, *draw(results.read(path), folder)]


def draw(result: Result, folder: Path) -> list[Path]:
    """Writes the plots of a result; returns their paths."""
    paths = []
    for figure in result.figures:
        path = folder / page.picture_name(result, figure)
        write_whole(path, plots.png(figure))
        paths.append(path)
    return paths


def results_file(folder: Path, experiment: str) -> Path:
    """Where a result is kept."""
    return folder / f"{experiment}.json"


def as_text(result: Result) -> str:
    """A result for people."""
    heading = f"{result.title} (quick: the figures say nothing)" if result.quick else result.title
    parts = [heading, "═" * len(heading), *(f"{tables.text(table)}\n" for table in result.tables)]
    return "\n".join([*parts, f"{page.provenance(result)}\n"])


def _experiment(name: str) -> Callable[[Config, Progress], Result]:
    found: Callable[[Config, Progress], Result] = importlib.import_module(f"chefshat.experiments.{name}").run
    return found


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise Refused(f"--out {path}: a file is in the way ({error.filename}), and a folder is wanted") from error
    return path


def _keep_full_runs(path: Path, *, quick: bool) -> None:
    """A quick run never takes the place of one that took hours."""
    if not (quick and path.exists()):
        return
    try:
        kept = results.read(path)
    except ValueError as error:
        raise Refused(f"{path} is in the way ({error}): give another --out") from error
    if not kept.quick:
        raise Refused(f"{path} holds a full run, which a quick one would replace: give another --out")


@contextlib.contextmanager
def _server(address: str | None) -> Iterator[str]:
    """The server that is named, or one of our own for as long as it is needed."""
    if address is not None:
        yield address
        return
    with LocalServer() as server:
        yield server.address


def _command(result: Result) -> str:
    """The command that makes this result again. Folder and address are left out, which change nothing."""
    repetitions = f" --seeds {len(result.seeds)}" if len(result.seeds) > 1 else ""
    quick = " --quick" if result.quick else ""
    return f"python -m chefshat.experiments {result.experiment} --seed {result.seeds[0]}{repetitions}{quick}"


def _fill(path: Path, made: list[Result]) -> list[Path]:
    """Fills the results into the page; returns the paths of what was written."""
    text = path.read_text(encoding="utf-8")
    try:
        filled = page.fill(text, made)
    except ValueError as error:
        raise Refused(f"{path}: {error}") from error
    pictures = path.parent / page.PICTURES
    pictures.mkdir(exist_ok=True)
    files = [file for result in made for file in draw(result, pictures)]
    write_whole(path, filled)
    return [*files, path]


def _finish(made: list[Result], files: list[Path], options: argparse.Namespace) -> None:
    if options.json:
        shown = [{key: value for key, value in results.as_json(result).items() if key != "figures"} for result in made]
        print(json.dumps({"results": shown, "files": [str(file) for file in files]}))
    else:
        print("\n  ".join(["written:", *(str(file) for file in files)]))
