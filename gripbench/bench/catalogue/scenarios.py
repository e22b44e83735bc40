"""The name of a scenario in, with level and faults; the scenario out, wherever its file lies.

A scenario is known by name (built in, or an entry point of the group `gripbench.scenarios` that
gives the path of a TOML file or a folder of them) or by the path of a TOML file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from gripbench.envs.instruments.faults import split_faults
from gripbench.envs.scenarios import Scenario
from gripbench.envs.worlds import (
    at_level,
    load_scenario,
    scenario_files,
    split_level,
    with_faults,
)
from gripbench.errors import unknown
from gripbench.extensions import entry_points, load

SCENARIO_GROUP = "gripbench.scenarios"

PREFIX = "recording:"
"""What the name of a recording begins with, where a scenario's name may stand."""


def all_scenario_files() -> dict[str, Path]:
    """Return the scenario files by name: those that ship and those of installed packages."""
    return dict(_plugged_scenarios()) | scenario_files()


def find_scenario(name: str) -> Scenario:
    """Return a scenario by name, by the path of a TOML file, or as `recording:NAME`.

    `NAME@LEVEL` is the scenario at a level of its population, `NAME+FAULT:SEVERITY` one with a
    fault of its instruments.

    Raises
    ------
    InputError
        If there is no such scenario; the message names the nearest one.
    """
    if name.startswith(PREFIX):
        from gripbench.bench.running.recorded_scenarios import recorded_scenario  # reads the log

        return recorded_scenario(name)
    plain, faults = split_faults(name)
    if faults:
        return with_faults(find_scenario(plain), faults)
    files = all_scenario_files()
    place, level = split_level(name)
    if not place.endswith(".toml"):
        if place not in files:
            raise unknown("scenario", name, files)
        place = str(files[place])
    return at_level(load_scenario(place), level)


def _plugged_scenarios() -> Iterator[tuple[str, Path]]:
    for name, point in entry_points(SCENARIO_GROUP).items():
        given = load(point)
        place = Path(given() if isinstance(given, Callable) else given)  # type: ignore[arg-type]
        if place.is_dir():
            yield from ((path.stem, path) for path in sorted(place.glob("*.toml")))
        else:
            yield name, place
