"""Speed, steering, yaw rate and a_y in, lateral velocity out: what the single-track filters share.

The speed comes from the fusion of production sensors or from a channel that measures it (variants
`measured_speed` and `gps_speed`, which share the step); readings that are missing are held as
inputs and left out as measurements.
"""

from __future__ import annotations

from math import atan2, exp, log
from typing import Any, ClassVar

import numpy as np

from gripbench.compilation import by_channels, compiled
from gripbench.methods.blocks.kalman import filter_type
from gripbench.methods.blocks.single_track import LOWEST_SPEED, SINGLE_TRACK_VEHICLE
from gripbench.methods.blocks.speed_fusion import (
    SPEED_PARAMETERS,
    SPEED_SENSORS,
    SPEED_STATE,
    SPEED_VEHICLE,
    advance_speed,
)
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.settings import Parameter, Variant

FUSED_SENSORS = (*SPEED_SENSORS, "accel_y")
MEASURED_SENSORS = ("speed_x", "steer_angle", "yaw_rate", "accel_y")
GPS_SENSORS = ("speed_gps", "steer_angle", "yaw_rate", "accel_y")
"""Channels by the source of the speed."""

FUSED_VEHICLE = tuple(dict.fromkeys((*SINGLE_TRACK_VEHICLE, *SPEED_VEHICLE)))
"""Vehicle parameters of a single-track filter behind the speed fusion."""

INPUT_STATE = np.dtype(
    [
        ("fusion", SPEED_STATE),
        ("speed", np.float64),
        ("steer", np.float64),
        ("last_steer", np.float64),
        ("speed_y", np.float64),  # that the fusion is told
    ]
)
"""Inputs of a single-track filter: the last that were there."""

LATERAL_ESTIMATES = ("sideslip", "speed_y", "yaw_rate")
LATERAL_VARIANCES = ("sideslip", "speed_y")
LATERAL_INNOVATIONS = ("yaw_rate", "accel_y")

NOISE_PARAMETERS = (
    Parameter("speed_y_walk", 0.3, "m/s^2/sqrt(Hz)", "Noise density of d v_y/dt", 1e-4, 10.0),
    Parameter("yaw_rate_walk", 0.1, "rad/s^2/sqrt(Hz)", "Noise density of d r/dt", 1e-4, 10.0),
    Parameter("gyro_noise", 5e-4, "rad/s/sqrt(Hz)", "Noise density of the gyroscope", 1e-6, 1.0),
    Parameter("accel_y_noise", 0.1, "m/s^2/sqrt(Hz)", "Noise density of a_y", 1e-4, 10.0),
    Parameter("speed_y_std", 0.3, "m/s", "Standard deviation of v_y at the start", 1e-3, 10.0),
)
"""Noise levels of the single-track filters."""

FUSED_PARAMETERS = (*NOISE_PARAMETERS, *SPEED_PARAMETERS)

ADAPTIVE_PARAMETERS = (
    *FUSED_PARAMETERS,
    Parameter("stiffness_std", 0.15, "-", "Relative error of the stiffness", 1e-3, 1.0),
    Parameter("stiffness_walk", 0.02, "1/sqrt(s)", "Walk of its logarithm", 0.0, 1.0),
    Parameter("friction_mean", 0.5, "-", "Friction at the start", 0.05, 1.4),
    Parameter("friction_std", 0.5, "-", "Standard deviation of its logarithm", 0.01, 3.0),
    Parameter("friction_walk", 0.1, "1/sqrt(s)", "Walk of its logarithm", 0.0, 3.0),
)
"""Parameters of the filters that adapt stiffness and friction."""


@compiled
def _read_fused(inputs, obs, params):
    advance_speed(inputs.fusion, obs, params, inputs.speed_y)
    _read(inputs, inputs.fusion.filter.x[0], obs)


@compiled
def _read_measured(inputs, obs, params):
    _read(inputs, obs.speed_x, obs)


@compiled
def _read_gps(inputs, obs, params):
    _read(inputs, obs.speed_gps, obs)


def _reading(channels: tuple[str, ...]) -> Any:
    if "speed_x" in channels:
        return _read_measured
    return _read_gps if "speed_gps" in channels else _read_fused


read_inputs = by_channels(_reading)
"""Read the inputs of a sample into a record of `INPUT_STATE`, the speed from whatever gives it."""


@compiled
def _read(inputs, speed, obs):
    if speed == speed:
        inputs.speed = max(speed, LOWEST_SPEED)
    elif inputs.speed < LOWEST_SPEED:
        inputs.speed = LOWEST_SPEED
    inputs.last_steer = inputs.steer
    if obs.steer_angle == obs.steer_angle:
        inputs.steer = obs.steer_angle
    if obs.first:
        inputs.last_steer = inputs.steer


@compiled
def start_lateral(filter, obs, params):
    """Set v_y, of which nothing is known, and the yaw rate at the first sample."""
    filter.P[0, 0], filter.P[1, 1] = params.speed_y_std**2, 1.0
    filter.x[1] = obs.yaw_rate


@compiled
def write_lateral(inputs, speed_y, yaw_rate, variance, est):
    """Write the estimates of a single-track filter; `variance` is that of v_y [m^2/s^2]."""
    inputs.speed_y = speed_y
    forward = inputs.speed
    est.sideslip = atan2(speed_y, forward)
    est.speed_y = speed_y
    est.yaw_rate = yaw_rate
    square = forward * forward + speed_y * speed_y
    est.sideslip_variance = variance * (forward / square) ** 2
    est.speed_y_variance = variance


@compiled
def write_no_innovations(est):
    """Write that no reading has been taken in this sample."""
    est.yaw_rate_innovation, est.yaw_rate_innovation_variance = 0.0, 0.0
    est.accel_y_innovation, est.accel_y_innovation_variance = 0.0, 0.0


@compiled
def write_innovations(rate, accel, est):
    """Write the innovations of yaw rate and a_y as `correct_track` returns them."""
    est.yaw_rate_innovation_variance, est.yaw_rate_innovation = rate[1], rate[2]
    est.accel_y_innovation_variance, est.accel_y_innovation = accel[1], accel[2]


@compiled
def start_adaptive(x, P, first, params):
    """Set ln C_f, ln C_r and ln mu, from state `first` on."""
    x[first + 2] = log(params.friction_mean)
    P[first, first] = P[first + 1, first + 1] = params.stiffness_std**2
    P[first + 2, first + 2] = params.friction_std**2


@compiled
def write_friction(logarithm, variance, est):
    """Write mean and variance of the friction from those of its logarithm (log-normal)."""
    spread = min(variance, 1.0)
    est.mu = exp(min(logarithm + 0.5 * spread, 0.5))
    est.mu_variance = est.mu * est.mu * (exp(spread) - 1.0)


def track_state(states: int, *others: tuple[Any, ...]) -> np.dtype[Any]:
    """Return the state of a filter on the single-track model with brush tyres.

    Parameters
    ----------
    states
        Number of states of its extended Kalman filter.
    *others
        Further fields.
    """
    filter = ("filter", filter_type(states))
    return np.dtype([("inputs", INPUT_STATE), filter, ("motion", np.float64, (2, 7)), *others])


def speed_sources(vehicle: tuple[str, ...]) -> dict[str, Variant]:
    """Return the variants by what measures the speed, for a method that needs these parameters."""
    return {
        "measured_speed": Variant(sensors=MEASURED_SENSORS, vehicle_parameters=vehicle),
        "gps_speed": Variant(sensors=GPS_SENSORS, vehicle_parameters=vehicle),
    }


class SingleTrackFilter(CompiledMethod):
    """Declaration of a filter on the single-track model; a subclass adds name, state and step."""

    sensors = FUSED_SENSORS
    estimates: ClassVar[tuple[str, ...]] = LATERAL_ESTIMATES
    variances: ClassVar[tuple[str, ...]] = LATERAL_VARIANCES
    vehicle_parameters = FUSED_VEHICLE
    parameters: ClassVar[tuple[Parameter, ...]] = FUSED_PARAMETERS
    variants: ClassVar[Any] = speed_sources(SINGLE_TRACK_VEHICLE)
