"""Plans with faults: every scenario stays, and stands once more for each fault that it can have."""

from __future__ import annotations

from dataclasses import replace

from gripbench.bench.running.recorded_scenarios import RecordedScenario
from gripbench.bench.running.runner import Plan
from gripbench.envs.instruments.faults import SEVERITIES, choose_fault, fault_files, load_fault
from gripbench.envs.scenarios import Scenario
from gripbench.envs.worlds import with_faults
from gripbench.errors import InputError

ALL = "all"
"""Every fault that ships, at the severities 1, 3 and 5."""


def fault_names(text: str) -> tuple[str, ...]:
    """Return the faults that a text with commas names; a fault without a severity has all five.

    Raises
    ------
    InputError
        If there is no such fault or severity.
    """
    if text == ALL:
        return tuple(f"{name}:{severity}" for name in fault_files() for severity in (1, 3, 5))
    found: list[str] = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        if ":" in part:
            found.append("+".join(choose_fault(one).name for one in part.split("+")))
        else:
            load_fault(part)
            found += [f"{part}:{severity}" for severity in SEVERITIES]
    if not found:
        raise InputError(f"faults '{text}': give some, such as dropout:3, or '{ALL}'")
    return tuple(dict.fromkeys(found))


def with_fault_scenarios(plan: Plan, text: str) -> Plan:
    """Return a plan of the clean scenarios and of each with each fault.

    A scenario whose instruments a fault does not touch goes without that fault.

    Raises
    ------
    InputError
        If a fault that is named fits no scenario of the plan.
    """
    scenarios: list[Scenario] = list(plan.scenarios)
    for name in fault_names(text):
        refused = f"fault '{name}': a recording of a real vehicle has its own"
        fitting = []
        for scenario in plan.scenarios:
            if isinstance(scenario, RecordedScenario):
                continue
            try:
                fitting.append(with_faults(scenario, name.split("+")))
            except InputError as error:
                refused = str(error)
        if not fitting and text != ALL:
            raise InputError(refused)
        scenarios += fitting
    return replace(plan, scenarios=tuple(scenarios))
