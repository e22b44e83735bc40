"""The single-track model with brush tyres once more, in plain NumPy, and a drive to try it on."""

from dataclasses import replace
from functools import cache

import numpy as np

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.worlds import record


@cache
def drive(name="slalom_snow@1", seed=1000, horizon=14.0):
    """Return the first seconds of a drive every 10 ms; seeds from 1000 on are never tested."""
    run = record(find_scenario(name).model_copy(update={"horizon": horizon}), seed)
    every = round(0.01 / (run.truth["time"][1] - run.truth["time"][0]))
    return replace(run, observations=run.observations[::every], truth=run.truth[::every])


def brush(tangent, stiffness, limit):
    """Return the force of a brush tyre by its share of sliding contact."""
    gripping = max(1.0 - abs(stiffness * tangent) / (3.0 * limit), 0.0)
    return np.sign(tangent) * limit * (1.0 - gripping**3)


def rates(x, speed, steer, car):
    """Return d v_y/dt, d r/dt and a_y at (v_y, r, ln C_f, ln C_r, ln mu)."""
    m, a, b = car["mass"], car["cg_to_front"], car["cg_to_rear"]
    limit = np.exp(x[4]) * m * 9.81 / (a + b)
    front = brush(
        np.tan(steer - np.arctan((x[0] + a * x[1]) / speed)),
        car["cornering_stiffness_front"] * np.exp(x[2]),
        limit * b,
    ) * np.cos(steer)
    rear = brush(
        -(x[0] - b * x[1]) / speed, car["cornering_stiffness_rear"] * np.exp(x[3]), limit * a
    )
    accel = (front + rear) / m
    return accel - speed * x[1], (a * front - b * rear) / car["yaw_inertia"], accel
