"""Extended Kalman filter: Li, Du & Li (2014), Section III.B, eq. 16-20 ("EKF method").

States v_x, w_f, w_r, F_f, F_r; measurements a_x, w_f, w_r; inputs are the axle torques. The slip
of each axle uses the GPS speed, the friction follows by the regression of eq. 11-15.

Corrected here:

- Eq. 16-20 are linear with the tyre forces as inputs, and nothing estimates a force then: the
  forces must be states. They are random walks here. The filter is linear in these states, so its
  "extended" form and the plain Kalman filter are the same.
- v_x of eq. 16a is open-loop, no measurement of eq. 20 corrects it. It cannot give a slip of a
  few thousandths, so the slip needs the GPS speed, although Table I ticks no GPS for this method
  (the abstract says that all three known methods need it).
- The measurement equation for a_x lacks the resistances and is compared with the rate of change
  of speed, which no sensor gives. Here the accelerometer's reading is compared with the tyre
  forces less rolling resistance and drag. The variant `paper` keeps the printed form, which is
  fed the idealised channel `speed_x_rate`.

Of its variance: radius, inertia and mass are those on paper and the torque is exact, so that an
error of a force that stays for the whole drive is no part of it.
The variant `lasting_errors` gives every noise 2.5 times the variance: the same estimates, and a
variance that is consistent over the suite of level 1.
"""

from __future__ import annotations

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.axle_friction import (
    AXLE_FRICTION_PARAMETERS,
    AXLE_FRICTION_STATE,
    AXLE_FRICTION_VEHICLE,
    MAGIC_FORMULA,
    PRINTED,
    RESISTANCE_PARAMETERS,
    axle_slips,
    estimate_friction,
    start_friction,
    unread_tyre,
)
from gripbench.methods.blocks.kalman import (
    correct_scalar,
    filter_type,
    innovation_variance,
    predict,
)
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled
from gripbench.methods.settings import scaled

SPEED, WHEEL_FRONT, WHEEL_REAR, FORCE_FRONT, FORCE_REAR = 0, 1, 2, 3, 4

STATE = np.dtype(
    [
        ("filter", filter_type(5)),
        *((name, np.float64) for name in AXLE_FRICTION_STATE),
    ]
)


@compiled
def start(state, params):
    """Set the first covariances and the constant entries of the model."""
    start_friction(state, params)
    kalman = state.filter
    for i in range(5):
        kalman.F[i, i] = 1.0
    kalman.P[SPEED, SPEED] = 1.0
    kalman.P[WHEEL_FRONT, WHEEL_FRONT] = params.wheel_speed_variance
    kalman.P[WHEEL_REAR, WHEEL_REAR] = params.wheel_speed_variance
    kalman.P[FORCE_FRONT, FORCE_FRONT] = params.force_variance
    kalman.P[FORCE_REAR, FORCE_REAR] = params.force_variance


@compiled
def advance(kalman, torque_front, torque_rear, elapsed, params):
    """Predict over `elapsed` seconds, eq. 16 and 18 (forward Euler), torques [N m] held."""
    F, Q = kalman.F, kalman.Q
    lever = params.wheel_radius / params.wheel_inertia
    F[SPEED, FORCE_FRONT] = elapsed / params.mass
    F[SPEED, FORCE_REAR] = elapsed / params.mass
    F[WHEEL_FRONT, FORCE_FRONT] = -elapsed * lever
    F[WHEEL_REAR, FORCE_REAR] = -elapsed * lever
    Q[WHEEL_FRONT, WHEEL_FRONT] = elapsed * params.wheel_speed_density
    Q[WHEEL_REAR, WHEEL_REAR] = elapsed * params.wheel_speed_density
    Q[FORCE_FRONT, FORCE_FRONT] = elapsed * params.force_density
    Q[FORCE_REAR, FORCE_REAR] = elapsed * params.force_density
    predict(kalman)
    kalman.x[WHEEL_FRONT] += elapsed * torque_front / params.wheel_inertia
    kalman.x[WHEEL_REAR] += elapsed * torque_rear / params.wheel_inertia


@compiled
def measure(kalman, accel_x, wheel_front, wheel_rear, speed, params, est):
    """Take a_x, w_f and w_r one after the other (their noises are independent), eq. 20."""
    h, x = kalman.h, kalman.x
    for i in range(5):
        h[i] = 0.0
    h[WHEEL_FRONT] = 1.0
    est.wheel_speed_front_innovation = wheel_front - x[WHEEL_FRONT]
    est.wheel_speed_front_innovation_variance = innovation_variance(
        kalman, params.wheel_speed_variance
    )
    correct_scalar(kalman, wheel_front - x[WHEEL_FRONT], params.wheel_speed_variance)
    h[WHEEL_FRONT], h[WHEEL_REAR] = 0.0, 1.0
    est.wheel_speed_rear_innovation = wheel_rear - x[WHEEL_REAR]
    est.wheel_speed_rear_innovation_variance = innovation_variance(
        kalman, params.wheel_speed_variance
    )
    correct_scalar(kalman, wheel_rear - x[WHEEL_REAR], params.wheel_speed_variance)
    h[WHEEL_REAR] = 0.0
    h[FORCE_FRONT] = 1.0 / params.mass
    h[FORCE_REAR] = 1.0 / params.mass
    resistance = 0.0
    if params.resistances > 0.5:
        resistance = params.rolling_resistance * GRAVITY
        resistance += params.drag * speed * speed / params.mass
    expected = (x[FORCE_FRONT] + x[FORCE_REAR]) / params.mass - resistance
    est.accel_x_innovation = accel_x - expected
    est.accel_x_innovation_variance = innovation_variance(kalman, params.acceleration_variance)
    correct_scalar(kalman, accel_x - expected, params.acceleration_variance)


@compiled
def _finish(state, obs, elapsed, params, est):
    kalman = state.filter
    slip_front, slip_rear = axle_slips(
        obs.wheel_speed_front, obs.wheel_speed_rear, obs.speed_gps, params
    )
    est.force_x_front = kalman.x[FORCE_FRONT]
    est.force_x_rear = kalman.x[FORCE_REAR]
    est.force_x_front_variance = kalman.P[FORCE_FRONT, FORCE_FRONT]
    est.force_x_rear_variance = kalman.P[FORCE_REAR, FORCE_REAR]
    estimate_friction(state, est, slip_front, slip_rear, elapsed, params)


@compiled
def _step(state, obs, accel_x, params, est):
    kalman = state.filter
    elapsed = obs.elapsed
    if obs.first:
        kalman.x[SPEED] = obs.speed_gps
        kalman.x[WHEEL_FRONT] = obs.wheel_speed_front
        kalman.x[WHEEL_REAR] = obs.wheel_speed_rear
    else:
        advance(kalman, obs.torque_front, obs.torque_rear, elapsed, params)
    measure(
        kalman, accel_x, obs.wheel_speed_front, obs.wheel_speed_rear, obs.speed_gps, params, est
    )
    _finish(state, obs, elapsed, params, est)


@compiled
def step(state, obs, params, est):
    """Take one sample with the accelerometer's reading."""
    _step(state, obs, obs.accel_x, params, est)


@compiled
def step_printed(state, obs, params, est):
    """Take one sample with the rate of change of speed, as the printed form needs it."""
    _step(state, obs, obs.speed_x_rate, params, est)


def _unread(settings):
    resistances = () if settings["resistances"] else RESISTANCE_PARAMETERS
    return (*unread_tyre(settings), *resistances)


_OWN_PARAMETERS = (
    Parameter("wheel_speed_density", 20.0, "rad^2/s^3", "Process noise of wheel speeds", 0.0),
    Parameter("force_density", 1e6, "N^2/s", "Process noise of the tyre forces", 0.0),
    Parameter("acceleration_variance", 1e-3, "m^2/s^4", "Variance of a_x", 1e-12),
    Parameter("wheel_speed_variance", 1e-5, "rad^2/s^2", "Variance of wheel speeds", 1e-12),
    Parameter("force_variance", 1e6, "N^2", "Initial variance of the tyre forces", 0.0),
    Parameter("resistances", True, "-", "Drag and rolling resistance in a_x"),
)

_NOISE = (
    "wheel_speed_density", "force_density", "acceleration_variance", "wheel_speed_variance",
    "force_variance",
)  # fmt: skip


class ExtendedKalmanFilter(CompiledMethod):
    """Tyre forces as random-walk states of a Kalman filter of eq. 16."""

    name = "extended_kalman_filter"
    title = "EKF"
    reference = "Li, Du & Li (2014), Section III.B, eq. 16-20"
    sensors = (
        "wheel_speed_front",
        "wheel_speed_rear",
        "torque_front",
        "torque_rear",
        "accel_x",
        "speed_gps",
    )
    estimates = ("force_x_front", "force_x_rear", "mu_front", "mu_rear")
    variances = ("force_x_front", "force_x_rear")
    innovations = ("wheel_speed_front", "wheel_speed_rear", "accel_x")
    vehicle_parameters = (
        *AXLE_FRICTION_VEHICLE,
        *RESISTANCE_PARAMETERS,
        "wheel_radius",
        "wheel_inertia",
    )
    unread = staticmethod(_unread)
    parameters = (*AXLE_FRICTION_PARAMETERS, *_OWN_PARAMETERS)
    variants = {
        "lasting_errors": scaled(_OWN_PARAMETERS, dict.fromkeys(_NOISE, 2.5)),
        "paper": Variant(
            PRINTED
            | {
                "wheel_speed_density": 0.01,
                "force_density": 2e8,
                "acceleration_variance": 0.09,
                "resistances": False,
            },
            sensors=(
                "wheel_speed_front",
                "wheel_speed_rear",
                "torque_front",
                "torque_rear",
                "speed_x_rate",
                "speed_gps",
            ),
            step=step_printed,
        ),
        "magic_formula": MAGIC_FORMULA,
    }
    state = STATE
    start = staticmethod(start)
    step = staticmethod(step)
