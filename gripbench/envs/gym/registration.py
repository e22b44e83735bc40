"""Gymnasium ids of the scenarios; `import gripbench` registers them, as Gymnasium's users expect.

Everybody who imports gripbench imports this module, few of them use Gymnasium: the ids wait until
it is imported. An entry point would do so too, but only where the package is installed.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

_SCENARIOS = Path(__file__).parents[2] / "configs" / "scenarios"
_IDENTITY = re.compile(r'^environment = "(gripbench/[^"]+)"', re.MULTILINE)


def register_with_gymnasium() -> None:
    """Register the environments now if Gymnasium is loaded, else as soon as it is."""
    if "gymnasium" in sys.modules:
        register_environments()
    else:
        sys.meta_path.insert(0, _WhenImported())


class _WhenImported(importlib.abc.MetaPathFinder):
    """Registers the environments after the import of Gymnasium; then it is gone."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return nothing, but for Gymnasium its own spec with a loader that registers."""
        if name != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                register_environments()

            spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


def register_environments() -> None:
    """Register the versioned id of every scenario that ships and can be stepped."""
    import gymnasium

    for path in sorted(_SCENARIOS.glob("*.toml")):
        found = _IDENTITY.search(path.read_text(encoding="utf-8"))
        if found and found.group(1) not in gymnasium.registry:
            gymnasium.register(
                id=found.group(1),
                entry_point="gripbench.envs.gym.environment:VehicleEnvironment",
                vector_entry_point="gripbench.envs.gym.vector_environment:VehicleVectorEnvironment",
                kwargs={"scenario": path.stem},
            )
