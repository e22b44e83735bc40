"""Brush-tyre identification from pure lateral tests, Yoon, Li & Ahn (2015), section 5.1.

The model's lateral acceleration (eq. 15-16) is fitted to the measured one by least squares over
the cornering stiffness of both axles and the friction of the surface, with sideslip and yaw rate
of a reference instrument. The covariance of the fit gives each parameter's uncertainty.

The paper identifies "l and c_p". Only their product c_p l^2 enters the model: the Jacobian to
(c_p, l) has rank one at every slip angle, so no test can tell them apart, and what is identified
is the stiffness, 4 c_p l^2 for the two tyres of an axle (`separability` shows it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY
from gripbench.errors import InputError
from gripbench.logs.vehicle.brush_fit import brush_force, covariance, slip_angles

Array = npt.NDArray[np.float64]

PARAMETERS = ("cornering_stiffness_front", "cornering_stiffness_rear", "mu")
"""What is identified: stiffness of each axle [N/rad] and friction of the surface."""

_START = np.array([1e5, 1e5, 0.5])
_LOW, _HIGH = np.array([1e3, 1e3, 0.02]), np.array([1e7, 1e7, 1.5])
_LEAST_SAMPLES = 20


@dataclass(frozen=True)
class LateralTest:
    """Samples of a pure lateral test.

    Attributes
    ----------
    slip_front, slip_rear
        Slip angles of the axles [rad], shape (n,).
    steer
        Steering angle at the road [rad], shape (n,).
    accel_y
        Lateral acceleration that the tyre forces cause [m/s^2], shape (n,).
    """

    slip_front: Array
    slip_rear: Array
    steer: Array
    accel_y: Array


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes
    ----------
    values
        Parameters by name.
    standard_deviations
        Their standard deviations by name; inf where the tests do not excite a parameter.
    correlation
        Correlation of the parameters, shape (3, 3), in the order of `PARAMETERS`.
    residual_rms
        RMS of measured less modelled acceleration [m/s^2].
    samples
        Number of independent samples that the uncertainty counts.
    """

    values: dict[str, float]
    standard_deviations: dict[str, float]
    correlation: Array
    residual_rms: float
    samples: int


def modelled_acceleration(
    test: LateralTest, vehicle: Mapping[str, float], parameters: Array
) -> Array:
    """Return the lateral acceleration of eq. 16 [m/s^2] with the parameters of `PARAMETERS`."""
    front, rear, mu = parameters
    wheelbase = vehicle["cg_to_front"] + vehicle["cg_to_rear"]
    weight = vehicle["mass"] * GRAVITY
    grip = mu * weight / wheelbase
    at_front = brush_force(test.slip_front, front, grip * vehicle["cg_to_rear"])
    at_rear = brush_force(test.slip_rear, rear, grip * vehicle["cg_to_front"])
    return (at_front * np.cos(test.steer) + at_rear) / vehicle["mass"]


def lateral_test(recording: Recording, every: int = 1) -> LateralTest:
    """Return the samples of a recording as its reference instrument and sensors give them.

    Sideslip, speed and suspension roll come from the reference (the truth of a simulation);
    steering, yaw rate and acceleration are those that the vehicle's own sensors measured.

    Parameters
    ----------
    recording
        A run on a level road.
    every
        Take every so-manieth sample.
    """
    truth, seen = recording.truth, recording.observations
    scored = np.flatnonzero(truth["time"] >= recording.score_from)[::every]
    speed_x, speed_y = truth["speed_x"][scored], truth["speed_y"][scored]
    yaw_rate, steer = seen["yaw_rate"][scored], seen["steer_angle"][scored]
    ahead, behind = recording.vehicle["cg_to_front"], recording.vehicle["cg_to_rear"]
    front, rear = slip_angles(speed_x, speed_y, yaw_rate, steer, ahead, behind)
    return LateralTest(
        slip_front=front,
        slip_rear=rear,
        steer=steer,
        accel_y=seen["accel_y"][scored] - GRAVITY * np.sin(truth["suspension_roll"][scored]),
    )


def identify(tests: list[LateralTest], vehicle: Mapping[str, float]) -> Identification:
    """Fit the brush tyre to pure lateral tests on one surface.

    The bias of the accelerometer, one for each test, is fitted along with it.

    Parameters
    ----------
    tests
        At least one test.
    vehicle
        `mass`, `cg_to_front` and `cg_to_rear` by name.

    Raises
    ------
    InputError
        If there are too few samples, or a sample is not finite.
    """
    samples = sum(len(test.accel_y) for test in tests)
    if samples < _LEAST_SAMPLES:
        raise InputError(
            f"brush identification: {samples} samples, at least {_LEAST_SAMPLES} are needed"
        )
    for number, test in enumerate(tests):
        columns = (test.slip_front, test.slip_rear, test.steer, test.accel_y)
        if not all(np.isfinite(column).all() for column in columns):
            raise InputError(f"brush identification: test {number} has a sample that is not finite")

    def residuals(unknowns: Array) -> Array:
        parameters, biases = np.exp(unknowns[:3]), unknowns[3:]
        return np.concatenate(
            [
                modelled_acceleration(test, vehicle, parameters) + bias - test.accel_y
                for test, bias in zip(tests, biases, strict=True)
            ]
        )

    free = np.full(len(tests), 10.0)
    fit = least_squares(
        residuals,
        np.concatenate([np.log(_START), np.zeros(len(tests))]),
        bounds=(np.concatenate([np.log(_LOW), -free]), np.concatenate([np.log(_HIGH), free])),
        jac="3-point",
    )
    independent = _independent_samples(fit.fun, [len(test.accel_y) for test in tests])
    degrees = max(1.0 - len(fit.x) / independent, 1.0 / independent)
    variance = float(np.mean(fit.fun**2)) / degrees
    spread = covariance(np.asarray(fit.jac), variance, samples / independent)
    values = np.exp(fit.x[:3])
    relative = np.sqrt(np.diag(spread)[:3])
    with np.errstate(invalid="ignore"):
        correlation = spread[:3, :3] / np.outer(relative, relative)
    return Identification(
        values=dict(zip(PARAMETERS, values.tolist(), strict=True)),
        standard_deviations=dict(zip(PARAMETERS, (values * relative).tolist(), strict=True)),
        correlation=correlation,
        residual_rms=float(np.sqrt(np.mean(fit.fun**2))),
        samples=int(independent),
    )


def separability(
    slip_angle: Array, mu: float, load: float, tread_stiffness: float, half_length: float
) -> tuple[float, Array]:
    """Return how well a pure lateral test tells c_p and l apart.

    Parameters
    ----------
    slip_angle
        Slip angles of the test [rad], shape (n,).
    mu, load
        Friction coefficient and vertical load [N] of a tyre.
    tread_stiffness
        c_p, stiffness of the tread a unit length [N/m^2].
    half_length
        l, half the length of the contact patch [m].

    Returns
    -------
    ratio
        Smallest over largest singular value of the Jacobian of the force to (ln c_p, ln l); zero
        where the two cannot be told apart.
    direction
        Unit vector of the combination of (ln c_p, ln l) that can be: (1, 2) / sqrt(5) for
        ln(c_p l^2).
    """

    def force(logarithms: Array) -> Array:
        stiffness = 2.0 * np.exp(logarithms[0] + 2.0 * logarithms[1])
        return brush_force(slip_angle, float(stiffness), mu * load)

    at = np.log([tread_stiffness, half_length])
    small = 1e-6 * np.eye(2)
    jacobian = np.column_stack([(force(at + e) - force(at - e)) / 2e-6 for e in small])
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    return float(singular[1] / singular[0]), directions[0] * np.sign(directions[0, 0])


def _independent_samples(residuals: Array, lengths: list[int]) -> float:
    """Return how many independent samples the residuals are worth, by their autocorrelation."""
    following, product = 0.0, 0.0
    for part in np.split(residuals, np.cumsum(lengths)[:-1]):
        following += float(part[1:] @ part[:-1])
        product += float(part[:-1] @ part[:-1])
    correlation = min(max(following / product, 0.0), 0.999) if product > 0.0 else 0.0
    return len(residuals) * (1.0 - correlation) / (1.0 + correlation)
