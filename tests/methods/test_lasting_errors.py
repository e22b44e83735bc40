"""Variants whose noise is larger by one factor: the same estimates, a variance larger by it."""

import numpy as np
import pytest

from gripbench.bench.catalogue.registry import choose_method
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import load_vehicle

FACTORS = {"extended_kalman_filter": 2.5}


def samples(channels, number=300):
    """A drive that sways: not a real one, for what is held does not depend on it."""
    time = 0.01 * np.arange(number)
    made = np.zeros(number, record_type(("time", *channels)))
    made["time"] = time
    for k, name in enumerate(channels):
        scale = {"wheel_speed": 60.0, "speed": 20.0, "steer": 0.03, "yaw": 0.2, "torque": 200.0}
        size = next((value for key, value in scale.items() if name.startswith(key)), 2.0)
        sway = np.sin(2.0 * np.pi * 0.4 * time + k)
        made[name] = size * (1.0 + 0.01 * sway) if size >= 20.0 else size * sway
    return made


@pytest.mark.parametrize("name", FACTORS)
def test_estimates_stay_and_the_variance_grows(name):
    plain, lasting = choose_method(name), choose_method(f"{name}:lasting_errors")
    car = load_vehicle("li2014").values() | load_vehicle("dakhlallah2008").values()
    drive = samples(plain.declaration.sensors)
    one, other = (spec.make().run(car, drive) for spec in (plain, lasting))
    for target in plain.declaration.variances:
        spread = one[f"{target}_variance"][100:]
        scale = np.sqrt(spread.max())
        np.testing.assert_allclose(other[target][100:], one[target][100:], atol=1e-3 * scale)
        np.testing.assert_allclose(
            other[f"{target}_variance"][100:], FACTORS[name] * spread, rtol=1e-3
        )
    for channel in plain.declaration.innovations:
        name_of = f"{channel}_innovation_variance"
        np.testing.assert_allclose(
            other[name_of][100:], FACTORS[name] * one[name_of][100:], rtol=1e-3
        )
