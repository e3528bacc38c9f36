"""The experiments of the 2020 paper, made again: `python -m chefshat.experiments mechanics|rules|winning|all`.

An experiment is a module of this package with one function, `run(config: Config, progress: Progress) -> Result`. It plays and
counts; it prints nothing. What is common to all stands here once: `results` (what an experiment hands back, and its file), `stats`
(intervals and spreads), `paper` (the figures the paper reports), `tables` (as text and as Markdown), `plots` (figures as PNG),
`progress`, `page` (the results in docs/experiments.md) and `command` (the command, whose options `__main__` reads).
"""

from chefshat.experiments.results import Config, Estimate, Figure, Level, Line, Panel, Points, Result, Table

__all__ = ["Config", "Estimate", "Figure", "Level", "Line", "Panel", "Points", "Result", "Table"]
