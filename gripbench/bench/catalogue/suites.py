"""The name or TOML file of a suite in; the scenarios, methods and seeds that it names out."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from gripbench.bench.catalogue.registry import MethodSpec, choose_method
from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml
from gripbench.envs.scenarios import LEVELS


class SuiteMethod(Configuration):
    """A method of a suite with its settings."""

    name: str
    variant: str = ""
    parameters: dict[str, float | str | bool] = Field(default_factory=dict)


class Suite(Configuration):
    """A named choice of scenarios, methods and seeds.

    Attributes
    ----------
    name
        Unique name; the file has the same.
    description
        One sentence.
    scenarios
        Names or paths of scenario files.
    methods
        `name[:variant]`, or a table with `name`, `variant` and `parameters`.
    seeds
        Number of seeds, from 0.
    targets
        Signals that tables show; empty: all that are estimated.
    level
        Level of the scenarios' populations; a recording has none.
    """

    name: str
    description: str
    scenarios: tuple[str, ...] = Field(min_length=1)
    methods: tuple[str | SuiteMethod, ...] = Field(min_length=1)
    seeds: int = Field(default=100, ge=1)
    targets: tuple[str, ...] = ()
    level: int = Field(default=0, ge=0, le=LEVELS[-1])

    def names(self, level: int | None = None) -> list[str]:
        """Return the names of its scenarios at a level, its own unless one is given."""
        chosen = self.level if level is None else level
        return [
            f"{name}@{chosen}" if chosen and "@" not in name and ":" not in name else name
            for name in self.scenarios
        ]

    def specs(self) -> list[MethodSpec]:
        """Return its methods, ready to run."""
        return [
            choose_method(item)
            if isinstance(item, str)
            else choose_method(item.name, item.variant, item.parameters)
            for item in self.methods
        ]


def suite_files() -> dict[str, Path]:
    """Return the suites that ship with gripbench, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "suites").glob("*.toml"))}


def load_suite(name: str) -> Suite:
    """Return a suite by name or by the path of a TOML file.

    Raises
    ------
    InputError
        If there is no such suite or its file has a mistake.
    """
    path = named_file("suite", name, suite_files())
    return parse(Suite, read_toml(path), path)
