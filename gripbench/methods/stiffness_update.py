"""Model-based filter whose cornering stiffness a kinematic filter keeps up to date.

Anderson & Bevly (2004), section V (Figure 12): with the scale factor of the gyroscope known, the
sideslip of the kinematic filter does not depend on a vehicle model, and gives the slip angles from
which the axles' cornering stiffness follows. The stiffness also takes up errors of other
parameters, such as the weight split.

At each GPS course in a steady turn the axle forces that the motion needs,

    F_f = b m V r / L,   F_r = a m V r / L,

are set against the slip angles delta - beta - a r / V and b r / V - beta. Recursive least squares
finds each axle's compliance 1/C from alpha = F / C, with the vehicle's own as the prior value: the
noise is in the slip angle, so that the force has to be the regressor. Yaw rate and steering angle
are means since the last course.

Of its variance: that of the model-based filter, which takes the stiffness found here for known;
where the tyres slide, what is found is no stiffness at all.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.contract import CompiledMethod, Parameter, compiled
from gripbench.methods.kinematic_kalman_filter import (
    KINEMATIC_PARAMETERS,
    KINEMATIC_SENSORS,
    KINEMATIC_STATE,
    advance_kinematic,
    start_kinematic,
)
from gripbench.methods.model_based_kalman_filter import (
    MODEL_BASED_ESTIMATES,
    MODEL_BASED_INNOVATIONS,
    MODEL_BASED_PARAMETERS,
    MODEL_BASED_STATE,
    MODEL_BASED_VARIANCES,
    SINGLE_TRACK,
    advance_model_based,
    report_model_based,
    start_model_based,
)

STIFFNESS_UPDATE_STATE = np.dtype(
    [
        ("kinematic", KINEMATIC_STATE),
        ("model", MODEL_BASED_STATE),
        ("information", np.float64, (2,)),  # of the compliance, front and rear
        ("weighted", np.float64, (2,)),  # information times compliance
        ("rate_sum", np.float64),
        ("steer_sum", np.float64),
        ("count", np.float64),
        ("last_rate", np.float64),  # mean yaw rate between the two courses before
    ]
)
"""Both filters, and the least squares of the axles' compliance."""

_OWN_PARAMETERS = (
    Parameter(
        "stiffness_std", 0.5, "-", "Standard deviation of the vehicle's compliance, relative", 1e-6
    ),
    Parameter("slip_angle_noise", 5e-3, "rad", "Standard deviation of a slip angle's error", 1e-9),
    Parameter("smallest_accel", 1.0, "m/s^2", "Lateral acceleration that a sample must reach", 0.0),
    Parameter("steadiness", 0.1, "-", "Largest relative change of the yaw rate in a sample", 0.0),
)


def _joined(*tables: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """Return the parameters of several methods, those of the same name once."""
    return tuple({parameter.name: parameter for table in tables for parameter in table}.values())


@compiled
def _start(state, params):
    start_kinematic(state.kinematic, params)
    start_model_based(state.model, params)
    for axle in range(2):
        stiffness = params.cornering_stiffness_rear
        if axle == 0:
            stiffness = params.cornering_stiffness_front
        state.information[axle] = (stiffness / params.stiffness_std) ** 2
        state.weighted[axle] = state.information[axle] / stiffness


@compiled
def _learn(state, params):
    """Take the slip angles of the latest course, if the turn is steady."""
    kinematic = state.kinematic
    rate = (state.rate_sum / state.count - kinematic.filter.x[1]) / kinematic.filter.x[2]
    steer = state.steer_sum / state.count
    change = abs(rate - state.last_rate)
    state.last_rate = rate
    speed = kinematic.speed
    if abs(speed * rate) < params.smallest_accel or change > params.steadiness * abs(rate):
        return
    a, b = params.cg_to_front, params.cg_to_rear
    force = params.mass * speed * rate / (a + b)
    beta = kinematic.sideslip
    weight = 1.0 / params.slip_angle_noise**2
    for axle in range(2):
        if axle == 0:
            angle, load = steer - beta - a * rate / speed, b * force
        else:
            angle, load = b * rate / speed - beta, a * force
        state.information[axle] += weight * load * load
        state.weighted[axle] += weight * load * angle


@compiled
def _stiffness(state, axle):
    """Return the stiffness of an axle [N/rad]; the compliance is kept above zero."""
    compliance = state.weighted[axle] / state.information[axle]
    return 1.0 / max(compliance, 1e-7)


@compiled
def _step(state, obs, params, est):
    used = advance_kinematic(state.kinematic, obs, params)
    state.rate_sum += obs.yaw_rate
    state.steer_sum += obs.steer_angle
    state.count += 1.0
    if used:
        _learn(state, params)
        state.rate_sum, state.steer_sum, state.count = 0.0, 0.0, 0.0
    front, rear = _stiffness(state, 0), _stiffness(state, 1)
    advance_model_based(state.model, obs, params, 0.0, front, rear)
    report_model_based(state.model, est, params, front, rear)
    est.cornering_stiffness_front = front
    est.cornering_stiffness_rear = rear
    est.cornering_stiffness_front_variance = front**4 / state.information[0]
    est.cornering_stiffness_rear_variance = rear**4 / state.information[1]


class StiffnessUpdate(CompiledMethod):
    """Model-based Kalman filter with cornering stiffness from the kinematic filter."""

    name = "stiffness_update"
    title = "Model-based Kalman filter with stiffness update"
    reference = "Anderson & Bevly 2004, section V"
    sensors = (*KINEMATIC_SENSORS, "steer_angle")
    estimates = (
        *MODEL_BASED_ESTIMATES,
        "cornering_stiffness_front",
        "cornering_stiffness_rear",
    )
    variances = (
        *MODEL_BASED_VARIANCES,
        "cornering_stiffness_front",
        "cornering_stiffness_rear",
    )
    innovations = MODEL_BASED_INNOVATIONS
    vehicle_parameters = SINGLE_TRACK
    parameters = _joined(KINEMATIC_PARAMETERS, MODEL_BASED_PARAMETERS, _OWN_PARAMETERS)
    state = STIFFNESS_UPDATE_STATE
    start = staticmethod(_start)
    step = staticmethod(_step)
