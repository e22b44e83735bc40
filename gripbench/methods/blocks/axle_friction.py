"""Friction of an axle from tyre forces and slips, as every method of Li, Du & Li (2014) ends.

Eq. 5, 6 and 8 (slip, axle loads, sum of the tyre forces), recursive least squares with forgetting
on one parameter (eq. 11-14), and the map from slip slope to friction (eq. 15).

Departures: with `memory_time` the forgetting factor is exp(-dt/memory_time), so that it does not
depend on how the samples are spaced (the paper's 0.9 a sample forgets in some 10 ms); and the
update can be left out while the tyre is not excited, because slip and force are then both noise
and the quotient drifts (the paper has no such gate).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp

from gripbench.compilation import inlined
from gripbench.envs.tyres.longitudinal import magic_formula, slip_ratio
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.settings import Parameter, Setting

AXLE_LOAD_PARAMETERS = ("mass", "cg_to_front", "cg_to_rear")
RESISTANCE_PARAMETERS = ("rolling_resistance", "drag")
TYRE_PARAMETERS = ("magic_b", "magic_c", "magic_e")

LARGEST_COVARIANCE = 1e100

RLS_PARAMETERS = (
    Parameter("memory_time", 0.5, "s", "Time constant of forgetting; 0: `forgetting` is used", 0.0),
    Parameter("forgetting", 0.9, "-", "Forgetting factor a sample, lambda", 0.5, 1.0),
    Parameter("covariance", 1.0, "-", "Initial covariance P", 1e-12),
    Parameter(
        "excitation_force", 85.0, "N", "Update only above this force on an axle; 0: always", 0.0
    ),
)
"""Parameters of every method that ends in this regression."""

FRICTION_MAP_PARAMETERS = (
    Parameter(
        "slope_gain", 0.0, "-",
        "Friction over slip slope, eq. 15: alpha; 0: 1/(B C) of the tyre on paper", 0.0, 2.0,
    ),
    Parameter("slope_offset", 0.0, "-", "Friction at slip slope zero, eq. 15: b", -1.0, 1.0),
    Parameter("tyre_shape", False, "-", "Regress on the Magic Formula instead of the slip"),
)  # fmt: skip
"""Parameters of the map from slip slope to friction, eq. 15."""

PRINTED = {
    "memory_time": 0.0,
    "forgetting": 0.9,
    "excitation_force": 0.0,
    "slope_gain": 0.03,
    "slope_offset": 0.1,
}
"""What the paper's tables rest on: lambda 0.9 a sample, no gate, the map of Table III."""

MAGIC_FORMULA = {"tyre_shape": True, "slope_gain": 1.0}
"""Regression on the tyre's known shape: its parameter is the friction coefficient itself."""

AXLE_FRICTION_PARAMETERS = (*RLS_PARAMETERS, *FRICTION_MAP_PARAMETERS)
AXLE_FRICTION_STATE = ("slope_front", "covariance_front", "slope_rear", "covariance_rear")
AXLE_FRICTION_VEHICLE = (*AXLE_LOAD_PARAMETERS, *TYRE_PARAMETERS)


def unread_tyre(settings: Mapping[str, Setting]) -> tuple[str, ...]:
    """Return the tyre's parameters that the map of these settings does not need."""
    if settings["tyre_shape"]:
        return ()
    return TYRE_PARAMETERS if settings["slope_gain"] else ("magic_e",)


@inlined
def front_load(params):
    """Return the static load of the front axle [N], eq. 6a."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    return params.mass * GRAVITY * params.cg_to_rear / wheelbase


@inlined
def rear_load(params):
    """Return the static load of the rear axle [N], eq. 6b."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    return params.mass * GRAVITY * params.cg_to_front / wheelbase


@inlined
def total_force(accel_x, speed, params):
    """Return the sum of the tyre forces [N], eq. 8.

    Erratum: `accel_x` is the accelerometer's reading, the rate of change of speed less gravity's
    component, so no term of the gradient belongs here (eq. 29 has one too many).
    """
    return (
        params.mass * accel_x
        + params.rolling_resistance * params.mass * GRAVITY
        + params.drag * speed * speed
    )


@inlined
def rls(theta, covariance, regressor, output, forgetting):
    """Return the parameter and its covariance after one sample, eq. 11-14.

    Parameters
    ----------
    theta, covariance
        Parameter and covariance P before the sample.
    regressor, output
        phi(t) and y(t).
    forgetting
        Forgetting factor lambda.
    """
    innovation = output - regressor * theta
    weight = forgetting + regressor * covariance * regressor
    gain = covariance * regressor / weight
    # eq. 14 for one parameter, (P - K phi P)/lambda, is P/weight: nothing cancels. Without
    # excitation P grows by 1/lambda a sample; it must not overflow while a vehicle stands.
    return theta + gain * innovation, min(covariance / weight, LARGEST_COVARIANCE)


@inlined
def forgetting_factor(params, elapsed):
    """Return lambda for a sample that comes `elapsed` seconds after the last."""
    if params.memory_time > 0.0:
        return exp(-elapsed / params.memory_time)
    return params.forgetting


@inlined
def slip_regressor(slip, params):
    """Return what the normalised force is proportional to: the slip, or the tyre's shape."""
    if params.tyre_shape > 0.5:
        return magic_formula(slip, params.magic_b, params.magic_c, params.magic_e)
    return slip


@inlined
def friction_of_slope(slope, params):
    """Return the friction coefficient of a slip slope, eq. 15."""
    gain = params.slope_gain
    if gain == 0.0:
        gain = 1.0 / (params.magic_b * params.magic_c)
    return gain * slope + params.slope_offset


@inlined
def excited(force, params):
    """Return whether the force of an axle [N] is large enough to tell the friction."""
    return abs(force) >= params.excitation_force


@inlined
def axle_friction(slope, covariance, force, slip, load, elapsed, params):
    """Return slip slope, covariance and friction of an axle after one sample.

    Parameters
    ----------
    slope, covariance
        State of the regression.
    force, slip, load
        Tyre force [N], slip ratio and vertical load [N] of the axle.
    elapsed
        Time since the last sample [s].
    params
        Record with `AXLE_FRICTION_PARAMETERS` and `AXLE_FRICTION_VEHICLE`.
    """
    if excited(force, params):
        regressor = load * slip_regressor(slip, params)
        forgetting = forgetting_factor(params, elapsed)
        slope, covariance = rls(slope, covariance, regressor, force, forgetting)
    return slope, covariance, friction_of_slope(slope, params)


@inlined
def axle_slips(wheel_speed_front, wheel_speed_rear, speed, params):
    """Return the slip ratios of both axles, eq. 5, for wheel speeds [rad/s] and a speed [m/s]."""
    front = slip_ratio(params.wheel_radius * wheel_speed_front, speed)
    return front, slip_ratio(params.wheel_radius * wheel_speed_rear, speed)


@inlined
def estimate_friction(state, est, slip_front, slip_rear, elapsed, params):
    """Write the friction of both axles from the forces that `est` holds already.

    `state` keeps the fields of `AXLE_FRICTION_STATE`.
    """
    state.slope_front, state.covariance_front, est.mu_front = axle_friction(
        state.slope_front,
        state.covariance_front,
        est.force_x_front,
        slip_front,
        front_load(params),
        elapsed,
        params,
    )
    state.slope_rear, state.covariance_rear, est.mu_rear = axle_friction(
        state.slope_rear,
        state.covariance_rear,
        est.force_x_rear,
        slip_rear,
        rear_load(params),
        elapsed,
        params,
    )


@inlined
def start_friction(state, params):
    """Set the first covariances of both axles."""
    state.covariance_front = params.covariance
    state.covariance_rear = params.covariance
