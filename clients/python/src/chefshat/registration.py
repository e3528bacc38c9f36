"""Registers the environments with Gymnasium, by name alone, so that `gymnasium.make` imports `envs` when it is needed.

Gymnasium has no entry points for environments since version 1.0. Instead `chefshat.pth` in the wheel imports this module whenever
Python starts, and it waits for Gymnasium to be imported. It must therefore import nothing itself.
"""

import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

#: The id in Gymnasium's registry.
ENV_ID = "chefshat/ChefsHat-v1"
# The module of Gymnasium that has the registry.
_REGISTRY = "gymnasium.envs.registration"


def register(registry: "ModuleType") -> None:
    """Registers the environments, given `gymnasium.envs.registration`. Does nothing if they are registered."""
    if ENV_ID not in registry.registry:
        registry.register(
            ENV_ID,
            entry_point="chefshat.envs.gymnasium_env:ChefsHatEnv",
            vector_entry_point="chefshat.envs.gymnasium_vector:ChefsHatVectorEnv",
        )


class _Finder:
    """A finder of modules that registers the environments after Gymnasium's registry has been imported."""

    _searching = False

    def find_spec(self, name: str, path: "Sequence[str] | None" = None, target: "ModuleType | None" = None) -> "ModuleSpec | None":
        if name != _REGISTRY or self._searching:
            return None
        from importlib.util import find_spec

        self._searching = True
        try:
            spec = find_spec(name)
        finally:
            self._searching = False
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_register(module: "ModuleType") -> None:
                execute(module)
                register(module)
                if self in sys.meta_path:
                    sys.meta_path.remove(self)

            spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


def when_imported() -> None:
    """Registers the environments as soon as Gymnasium is imported."""
    if _REGISTRY in sys.modules:
        register(sys.modules[_REGISTRY])
    elif not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
