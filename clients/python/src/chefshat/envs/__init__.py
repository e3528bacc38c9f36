"""Environments with the interfaces of Gymnasium and PettingZoo, based on `VectorEnv`. They need the package's extra `envs`.

- `ChefsHatEnv`, a `gymnasium.Env`: one seat against built-in agents, also `gymnasium.make("chefshat.envs:chefshat/ChefsHat-v1")`.
- `ChefsHatVectorEnv`, a `gymnasium.vector.VectorEnv`: many such games, stepped together.
- `chefshat_v1`, a module for PettingZoo: `chefshat_v1.env()` has all seats, which decide one at a time.

The forms of observations are in `observing`.
"""

from typing import TYPE_CHECKING, Any

try:
    import gymnasium
except ImportError as error:
    raise ImportError("chefshat.envs needs Gymnasium and PettingZoo: pip install 'chefshat[envs]'") from error

from chefshat.envs.gymnasium_env import ChefsHatEnv
from chefshat.envs.gymnasium_vector import ChefsHatVectorEnv

if TYPE_CHECKING:
    from chefshat.envs import chefshat_v1

__all__ = ["ENV_ID", "ChefsHatEnv", "ChefsHatVectorEnv", "chefshat_v1"]

#: The id in Gymnasium's registry, once this module has been imported.
ENV_ID = "chefshat/ChefsHat-v1"
gymnasium.register(
    ENV_ID,
    entry_point="chefshat.envs.gymnasium_env:ChefsHatEnv",
    vector_entry_point="chefshat.envs.gymnasium_vector:ChefsHatVectorEnv",
)


def __getattr__(name: str) -> Any:  # noqa: ANN401 - A module.
    # Loads PettingZoo on demand.
    if name == "chefshat_v1":
        import importlib

        return importlib.import_module("chefshat.envs.chefshat_v1")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
