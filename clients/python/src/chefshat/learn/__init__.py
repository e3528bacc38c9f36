"""Agents that learn: the features of a network (`features`), its file (`network`), and training.

Needs the package's extra `learn`. Imports nothing, so that programs that only read network files do not load JAX.
`python -m chefshat.learn --help` lists the commands.
"""
