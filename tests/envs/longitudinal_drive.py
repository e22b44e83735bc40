"""What the tests of the longitudinal world share: scenarios without noise, an independent plant."""

import numpy as np

from gripbench.configuration import parse
from gripbench.envs.plants.longitudinal.scenario import LongitudinalScenario
from gripbench.envs.worlds import load_scenario

GRAVITY = 9.81

ACCURATE = (
    "constant_mu",
    "friction_step",
    "noisy_acceleration",
    "large_torque",
    "gradient",
    "combined_traction_braking",
)


def clean(name, **changes):
    """Return a scenario without process noise."""
    return load_scenario(name).model_copy(update={"wheel_speed_noise": 0.0} | changes)


def custom(front, horizon=10.0, **changes):
    """Return a scenario with its own torque profile, given as rows (start, end, first, last)."""
    pieces = [dict(zip(("start", "end", "first", "last"), row, strict=True)) for row in front]
    content = {
        "name": "custom",
        "environment": "gripbench/Custom-v0",
        "description": "Test",
        "world": "longitudinal",
        "vehicle": "li2014",
        "horizon": horizon,
        "integrator": "ros3",
        "sensor_suite": "li2014",
        "friction": [{"start": 0.0, "end": horizon, "first": 0.9, "last": 0.9}],
        "driver": {"front": pieces},
    }
    return parse(LongitudinalScenario, content | changes, "custom.toml")


def printed_derivatives(x, torques, mu, grade, car):
    """Return the derivatives of eq. 2-6 in plain NumPy, away from standstill."""
    wheelbase = car["cg_to_front"] + car["cg_to_rear"]
    weight = car["mass"] * GRAVITY
    loads = weight * np.array([car["cg_to_rear"], car["cg_to_front"]]) / wheelbase
    rolling = car["wheel_radius"] * np.asarray(x[1:])
    slip = (rolling - x[0]) / np.maximum(rolling, x[0])
    b, c, e = car["magic_b"], car["magic_c"], car["magic_e"]
    inner = b * slip - e * (b * slip - np.arctan(b * slip))
    forces = np.asarray(mu) * loads * np.sin(c * np.arctan(inner))
    resistance = car["rolling_resistance"] * weight + car["drag"] * x[0] ** 2
    speed = (forces.sum() - resistance) / car["mass"] + GRAVITY * np.sin(grade)
    wheels = (np.asarray(torques) - car["wheel_radius"] * forces) / car["wheel_inertia"]
    return np.array([speed, *wheels]), forces
