"""`make`: creates any of the environments in `vector` and `envs`."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack, overload

from chefshat.vector import VectorEnv

if TYPE_CHECKING:
    from pettingzoo import AECEnv

    from chefshat.address import ServerAddress
    from chefshat.envs import ChefsHatEnv, ChefsHatVectorEnv
    from chefshat.envs.options import AllSeatsOptions, ColumnsOptions, ManyGamesOptions, OneSeatOptions

    Address: TypeAlias = str | ServerAddress | None

# The kinds that need the extra `envs`, by module and name.
_KINDS = {
    "gymnasium": ("chefshat.envs", "ChefsHatEnv"),
    "gymnasium_vector": ("chefshat.envs", "ChefsHatVectorEnv"),
    "pettingzoo": ("chefshat.envs.chefshat_v1", "env"),
}


@overload
def make(kind: Literal["gymnasium"] = ..., *, address: Address = ..., **options: Unpack[OneSeatOptions]) -> ChefsHatEnv: ...
@overload
def make(
    kind: Literal["gymnasium_vector"], *, address: Address = ..., **options: Unpack[ManyGamesOptions]
) -> ChefsHatVectorEnv: ...
@overload
def make(kind: Literal["vector"], *, address: Address = ..., **options: Unpack[ColumnsOptions]) -> VectorEnv: ...
@overload
def make(kind: Literal["pettingzoo"], *, address: Address = ..., **options: Unpack[AllSeatsOptions]) -> AECEnv[str, Any, Any]: ...
def make(kind: str = "gymnasium", **options: Any) -> Any:
    """Creates an environment.

    Without an `address` it plays in this process if `chefshat-native` is installed, or else on the server shared by this process,
    which is started on demand.

    Args:
        kind: "gymnasium": `envs.ChefsHatEnv`, one seat against built-in agents; "gymnasium_vector": `envs.ChefsHatVectorEnv`, the
            same many times; "vector": `VectorEnv`, columns of any seats of many games; "pettingzoo": `envs.chefshat_v1`, all seats.
        options: arguments of that environment, for example `address`, `token`, `ca`, `opponents`, `rewards`, `observation`, `seed`.
            Their types are in `envs.options`.

    Raises:
        ImportError: the kind needs the extra `envs`.
        ChefsHatError: there is no server; the message says what to do.
    """
    if kind == "vector":
        return VectorEnv(**options)
    if kind not in _KINDS:
        raise ValueError(f"kind={kind!r}: choose one of {', '.join(map(repr, [*_KINDS, 'vector']))}")
    module, name = _KINDS[kind]
    return getattr(importlib.import_module(module), name)(**options)
