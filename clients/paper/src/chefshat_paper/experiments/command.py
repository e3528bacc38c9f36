"""The command: runs experiments against a server, saves, prints and draws their results, and shows saved ones again.

`__main__` parses the options. The modules of experiments are imported on demand, since they need different packages.
"""

import argparse
import contextlib
import importlib
import importlib.metadata
import json
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import chefshat
from chefshat import join_options
from chefshat.address import ServerAddress
from chefshat.errors import ChefsHatError, failed
from chefshat.files import write_atomically
from chefshat.learn import plots
from chefshat.local_server import LocalServer

from chefshat_paper.experiments import page, results, tables
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Config, Result

EXPERIMENTS = ("mechanics", "rules", "winning")
# Decimal places of an experiment's duration in seconds.
SECONDS_DIGITS = 1
COMMIT_DIGITS = 12


class Refused(Exception):
    """An error that the user can fix; the message says how."""


def run(options: argparse.Namespace) -> int:
    """Runs the experiments one after another and writes each result at once. Returns the exit code."""
    names = EXPERIMENTS if options.what == "all" else (options.what,)
    made: list[Result] = []
    files: list[Path] = []
    try:
        modules = {name: _experiment(name) for name in names}
        folder = _folder(options.out)
        for name in names:
            _keep_full_runs(results_file(folder, name), quick=options.quick)
        with _server(join_options.server_if_any(options)) as address:
            with chefshat.Client(address) as client:
                server_version = client.server_info().server_version
            seeds = tuple(range(options.seed, options.seed + options.seeds))
            commit = _commit()
            config = Config(address=address, seeds=seeds, quick=options.quick, out=folder)
            for experiment in modules.values():
                begun = time.monotonic()
                result = experiment(config, Progress())
                facts = {
                    "package_version": importlib.metadata.version("chefshat"),
                    "server_version": server_version,
                    "commit": commit,
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
    """Shows saved results and draws their plots, next to them or into a page. Returns the exit code."""
    try:
        # The folder may have other files, such as those of `tune`.
        found = [path for name in EXPERIMENTS if (path := results_file(options.folder, name)).is_file()]
        if not found:
            command = f"python -m chefshat_paper.experiments all --out {options.folder}"
            raise Refused(f"no results in {options.folder}: run `{command}` first")
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
    """Writes the results file and the plots. Returns their paths."""
    path = results_file(folder, result.experiment)
    results.write(result, path)
    # Draws the file's contents, so that drawing them again gives the same picture.
    return [path, *draw(results.read(path), folder)]


def draw(result: Result, folder: Path) -> list[Path]:
    """Writes the plots of a result. Returns their paths."""
    paths = []
    for figure in result.figures:
        path = folder / page.picture_name(result, figure)
        write_atomically(path, plots.png(figure))
        paths.append(path)
    return paths


def results_file(folder: Path, experiment: str) -> Path:
    """Returns the path of a results file."""
    return folder / f"{experiment}.json"


def as_text(result: Result) -> str:
    """Formats a result as text."""
    heading = f"{result.title} (quick: the numbers are meaningless)" if result.quick else result.title
    parts = [heading, "═" * len(heading), *(f"{tables.text(table)}\n" for table in result.tables)]
    return "\n".join([*parts, f"{page.provenance(result)}\n"])


def _experiment(name: str) -> Callable[[Config, Progress], Result]:
    found: Callable[[Config, Progress], Result] = importlib.import_module(f"chefshat_paper.experiments.{name}").run
    return found


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise Refused(f"--out {path}: {error.filename} is a file, not a folder") from error
    return path


def _keep_full_runs(path: Path, *, quick: bool) -> None:
    """Refuses to replace the result of a full run, which took hours, with that of a quick one."""
    if not (quick and path.exists()):
        return
    try:
        saved = results.read(path)
    except ValueError as error:
        raise Refused(f"{path} exists and is not a results file ({error}): give another --out") from error
    if not saved.quick:
        raise Refused(f"{path} is the result of a full run, which a quick run would replace: give another --out")


@contextlib.contextmanager
def _server(address: ServerAddress | None) -> Iterator[ServerAddress]:
    """Yields the given server's address, or that of a new server, which stops at the end."""
    if address is not None:
        yield address
        return
    with LocalServer() as server:
        yield ServerAddress(server.address, token="")


def _command(result: Result) -> str:
    """Returns the command that reproduces this result, without the folder and address, which do not affect it."""
    quick = " --quick" if result.quick else ""
    seeds = f"--seed {result.seeds[0]} --seeds {len(result.seeds)}"
    return f"python -m chefshat_paper.experiments {result.experiment} {seeds}{quick}"


def _commit(package: Path = Path(__file__).parents[1]) -> str:
    """Returns the commit of the checkout, with "-dirty" if its code has changed since; "unknown" without a checkout."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(package), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    try:
        # Fails for a package that is installed in somebody else's checkout.
        git("ls-files", "--error-unmatch", "__init__.py")
        changed = git("status", "--porcelain", "--untracked-files=no", "--", ".", ":/clients/python/src", ":/server")
        return git("rev-parse", f"--short={COMMIT_DIGITS}", "HEAD") + ("-dirty" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        print(f"warning: {package} is not in a git checkout: the results will not name a commit", file=sys.stderr)
        return "unknown"


def _fill(path: Path, made: list[Result]) -> list[Path]:
    """Fills the results into the page. Returns the paths of the files written."""
    text = path.read_text(encoding="utf-8")
    try:
        filled = page.fill(text, made)
    except ValueError as error:
        raise Refused(f"{path}: {error}") from error
    pictures = path.parent / page.PICTURES
    pictures.mkdir(exist_ok=True)
    files = [file for result in made for file in draw(result, pictures)]
    write_atomically(path, filled)
    return [*files, path]


def _finish(made: list[Result], files: list[Path], options: argparse.Namespace) -> None:
    if options.json:
        shown = [{key: value for key, value in results.as_json(result).items() if key != "figures"} for result in made]
        print(json.dumps({"results": shown, "files": [str(file) for file in files]}))
    else:
        print("\n  ".join(["wrote:", *(str(file) for file in files)]))
