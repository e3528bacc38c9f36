"""The Deep Q agent of the 2020 paper: the agent (`deep_q`), its training, its files (`checkpoint`) and `tune`.

Needs the package's extra `learn`. Imports nothing, so that the command's help works without it.
`python -m chefshat_paper.learn --help` lists the commands.
"""
