"""A signal in, the smallest error that a reference instrument could tell from none out.

Scores are geometric means over scenarios: without a lower bound a cell that is exact to rounding
would outweigh all others. So no cell counts as better than what is measured as the truth in a
real vehicle.

Every value here is a guess of what reference instruments reach, by their usual classes and not by
a data sheet read: inertial systems with differential GPS (as OxTS RT3000: velocity .05 km/h, roll
and pitch .03 deg, heading .1 deg, sideslip .15 deg), wheel force transducers (as Kistler RoaDyn:
.1 kN, half a percent of 20 kN), locked-wheel friction (as ASTM E274: .02 for a repetition, half of
it for a mean of several).
"""

from __future__ import annotations

import math

from gripbench.envs.signals import signal

_BY_UNIT = {"m/s": 0.05 / 3.6, "rad": math.radians(0.1), "N": 100.0}
_BY_NAME = {"sideslip": math.radians(0.15), "roll": math.radians(0.03), "pitch": math.radians(0.03)}


def resolution(target: str) -> float:
    """Return the smallest RMS that counts for a target, in its SI unit; 0 where none is known."""
    if target == "mu" or target.startswith("mu_"):
        return 0.01
    return _BY_NAME.get(target, _BY_UNIT.get(signal(target).unit, 0.0))
