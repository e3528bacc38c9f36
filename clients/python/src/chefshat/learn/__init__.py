"""Agents that learn: what a network sees (`features`), how it is kept in a file (`network`), and the ways of training one.

Needs the package's extra `learn`. Nothing is imported here, so that what only reads network files does not load JAX.
`python -m chefshat.learn --help` lists the commands.
"""
