"""The command line `python -m chefshat_paper.experiments`: its options, and the message for a missing package.

Imports only the standard library before parsing the options, so that `--help` always works.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from chefshat import join_options
from chefshat.errors import INTERRUPTED

EXAMPLES = """examples:
  python -m chefshat_paper.experiments all --quick
  python -m chefshat_paper.experiments mechanics --seed 1 --out results
  python -m chefshat_paper.experiments rules --seeds 5 --out results --address 127.0.0.1:50051
  python -m chefshat_paper.experiments report results

The same seeds give the same results. Without --address the command starts a server of its own.

exit code: 0 success, 1 failure (the last line gives the reason), 2 wrong arguments, 130 interrupted
"""
DEFAULT_SEEDS = 5
QUICK_SEEDS = 2
MAX_SEEDS = 1000


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    options = parse(arguments)
    try:
        from chefshat_paper.experiments import command
    except ModuleNotFoundError as error:
        return say_what_is_missing(error)
    try:
        return command.report(options) if options.what == "report" else command.run(options)
    except ModuleNotFoundError as error:
        return say_what_is_missing(error)
    except KeyboardInterrupt:
        print("interrupted; the results of finished experiments are saved", file=sys.stderr)
        return INTERRUPTED


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Parses the options. Exits with 2 if they are wrong, with 0 after --help."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat_paper.experiments",
        description="Replicates the experiments of the 2020 paper and prints their tables, with the paper's numbers next to ours.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    running = argparse.ArgumentParser(add_help=False)
    running.add_argument("--quick", action="store_true", help="only test that it works; the numbers are meaningless")
    running.add_argument(
        "--seeds",
        type=_positive,
        metavar="N",
        help=f"repetitions of the learning experiments (default: {DEFAULT_SEEDS}, 2 if quick)",
    )
    running.add_argument("--seed", type=_natural, default=1, metavar="S", help="the first of consecutive seeds (default: 1)")
    running.add_argument(
        "--out",
        type=Path,
        default=Path("experiments-results"),
        metavar="DIR",
        help="folder for results, plots and networks, created if missing (default: %(default)s)",
    )
    join_options.add_server_options(running)
    running.add_argument("--json", action="store_true", help="print one object of JSON: the results without the plots")
    commands = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    summaries = {
        "mechanics": "Experiment 1: the effect of each mechanic, among random agents",
        "rules": "Experiment 2: one agent learns the rules",
        "winning": "Experiment 3: agents learn to win",
        "all": "all three, in this order",
    }
    for name, summary in summaries.items():
        commands.add_parser(
            name,
            help=summary,
            description=summary,
            parents=[running],
            epilog=EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
    summary = "prints saved results and draws their plots"
    reporting = commands.add_parser(
        "report",
        help=summary,
        description=summary,
        epilog="example:\n  python -m chefshat_paper.experiments report results --page docs/experiments.md",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    reporting.add_argument("folder", type=Path, metavar="DIR", help="folder of results")
    reporting.add_argument(
        "--page",
        type=Path,
        metavar="FILE",
        help="a Markdown file to fill the results into; plots go to the folder images next to it",
    )
    reporting.add_argument("--json", action="store_true", help="print one object of JSON: the results without the plots")
    options = parser.parse_args(arguments)
    if options.what != "report" and options.seeds is None:
        options.seeds = QUICK_SEEDS if options.quick else DEFAULT_SEEDS
    return options


def say_what_is_missing(error: ModuleNotFoundError) -> int:
    """Prints how to install a missing package. Raises the error for a module of this package, which is a bug."""
    if error.name is None or error.name.partition(".")[0] in ("chefshat", "chefshat_paper"):
        raise error
    print(f"error: the experiments need {error.name}, which is not installed: pip install 'chefshat-paper[learn]'", file=sys.stderr)
    return 1


def _positive(text: str) -> int:
    number = int(text)
    if not 1 <= number <= MAX_SEEDS:
        raise argparse.ArgumentTypeError(f"must be 1 to {MAX_SEEDS}")
    return number


def _natural(text: str) -> int:
    number = int(text)
    if not 0 <= number < 2**32:
        raise argparse.ArgumentTypeError("must be 0 to 4294967295")
    return number


if __name__ == "__main__":
    sys.exit(main())
