"""The options of the environments as types, for `chefshat.make` and the constructors. Their docstrings say what they mean."""

from pathlib import Path
from typing import TypedDict

from gymnasium.vector import AutoresetMode

from chefshat.envs.observing import ObservationFunction
from chefshat.transitions import RewardFunction
from chefshat.vector_setup import GameOptions, VectorOptions


class Connection(TypedDict, total=False):
    """Where games are played, and who computes rewards; see `VectorEnv`."""

    token: str | None
    ca: Path | str | None
    threads: int
    transitions: bool
    reward_function: RewardFunction | None


class EnvOptions(GameOptions, Connection, total=False):
    """What the environments pass on to their `VectorEnv`."""


class AllSeatsOptions(EnvOptions, total=False):
    """The arguments of `chefshat_v1.env`, besides the address."""

    observation: str | ObservationFunction
    rewards: str | None
    invalid: str
    invalid_penalty: float
    render_mode: str | None


class OneSeatOptions(AllSeatsOptions, total=False):
    """The arguments of `ChefsHatEnv`, besides the address."""

    seat: int


class ManyGamesOptions(OneSeatOptions, total=False):
    """The arguments of `ChefsHatVectorEnv`, besides the address."""

    num_envs: int
    autoreset_mode: AutoresetMode | str


class ColumnsOptions(VectorOptions, Connection, total=False):
    """The arguments of `VectorEnv`, besides the address."""

    games: int
