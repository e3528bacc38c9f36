"""Fills results into a page of Markdown: tables, plots and provenance between the marks of an experiment.

The text between the marks is generated from results files. The text outside is never changed.
"""

from collections.abc import Iterable

from chefshat.learn.figures import Figure

from chefshat_paper.experiments import tables
from chefshat_paper.experiments.results import Result

# The folder of plots, next to the page.
PICTURES = "images"


def fill(text: str, results: Iterable[Result]) -> str:
    """Returns the page with these results between their marks. Raises ValueError if a result has no marks."""
    for result in results:
        begin, end = marks(result.experiment)
        if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
            raise ValueError(f"there is no place for {result.experiment}: add the lines {begin} and {end}, once and in this order")
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(end)
        text = f"{before}{begin}\n\n{section(result)}\n\n{end}{after}"
    return text


def marks(experiment: str) -> tuple[str, str]:
    """Returns the lines around an experiment's results."""
    return f"<!-- results of {experiment} -->", f"<!-- end of {experiment} -->"


def section(result: Result) -> str:
    """Formats the text between the marks."""
    parts = [tables.markdown(table) for table in result.tables]
    parts += [f"![{figure.title}]({PICTURES}/{picture_name(result, figure)})" for figure in result.figures]
    return "\n\n".join([*parts, provenance(result)])


def picture_name(result: Result, figure: Figure) -> str:
    """Returns the file name of a plot."""
    return f"experiments-{result.experiment}-{figure.name}.png"


def provenance(result: Result) -> str:
    """Describes how a result was made, in a sentence."""
    run = result.run
    seeds = f"seed {result.seeds[0]}" if len(result.seeds) == 1 else f"seeds {result.seeds[0]} to {result.seeds[-1]}"
    return (
        f"Made with {seeds} by `{run.get('command', 'a program')}` in {run.get('seconds', 0):,} s "
        f"(commit {run.get('commit', 'unknown')}, package {run.get('package_version')}, server {run.get('server_version')}, "
        f"Python {run.get('python')})."
    )
