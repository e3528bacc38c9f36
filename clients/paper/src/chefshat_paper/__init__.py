"""What belongs to the paper and the reference implementation of Chef's Hat, on top of the package `chefshat`.

- `experiments`: replications of the 2020 paper's experiments.
- `learn`: the paper's Deep Q agent.
- `players_club`: players written for the reference implementation, unchanged.
"""
