"""Replications of the 2020 paper's experiments: `python -m chefshat_paper.experiments mechanics|rules|winning|all`.

An experiment is a module of this package with one function, `run(config: Config, progress: Progress) -> Result`, which prints
nothing. Shared modules: `results` (a result and its file), `stats` (intervals), `paper` (the figures the paper reports), `tables`
(text and Markdown), `progress`, `page` (the results in docs/experiments.md) and `command` (the command, whose options `__main__`
parses). `chefshat.learn.plots` draws figures as PNG.
"""

from chefshat_paper.experiments.results import Config, Estimate, Result, Table

__all__ = ["Config", "Estimate", "Result", "Table"]
