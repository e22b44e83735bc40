"""A signal in, the smallest error that a reference instrument could tell from none out.

Scores are geometric means over scenarios: without a lower bound a cell that is exact to rounding
would outweigh all others. So no cell counts as better than what is measured as the truth in a
real vehicle. Inertial reference systems: OxTS RT3000 data sheet (velocity .05 km/h, roll and pitch
.03 deg, heading .1 deg, sideslip .15 deg at 50 km/h). Wheel force: Kistler RoaDyn S635 data sheet
(hysteresis and linearity each .5 % of 20 kN: .1 kN at usual loads). Friction: ASTM E274 states .02
for repeated locked-wheel measurements; half of it is a guess for a mean of several.
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
