"""Integrators of the longitudinal plant over one sample interval with constant inputs.

`ros3`
    The accurate default: L-stable Rosenbrock method of order 3 with an embedded order 2 that needs
    two evaluations a step (Sandu et al., "Benchmarking stiff ODE solvers for atmospheric chemistry
    problems II", Atmospheric Environment 31, 1997), analytic Jacobian, step control. The wheel
    equation has the eigenvalue -C R^2/(I v), about -12000/v per second; an L-stable method follows
    the slow solution with steps as long as the sample.
`rk4`
    Classical Runge-Kutta with ten steps a sample: an independent check; unstable below 0.5 m/s.

The variable-step solver of the paper is in `longitudinal_paper_solver`.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from gripbench.compilation import compiled, inlined
from gripbench.envs.plants.longitudinal.plant import (
    derivatives,
    evaluate_tyres,
    gravity_along,
    jacobian,
    rates,
    state_rates,
)

ROS3, RK4 = 0, 1
INTEGRATORS = {"ros3": ROS3, "rk4": RK4}

TOLERANCE = 3e-7
"""Largest local error of `ros3`, relative to 1 m/s + the speed (rolling speed for an axle)."""

_MOST_TRIES = 100_000
"""Steps in one sample at most; a usual one takes one or two."""

_RK4_STEPS = 10

_GAMMA = 0.43586652150845899941601945119356
_C21 = -1.0156171083877702091975600115545
_C31, _C32 = 4.0759956452537699824805835358067, 9.2076794298330791242156818474003
_M2, _M3 = 6.1697947043828245592553615689730, -0.42772256543218573326238373806514
_E1, _E2, _E3 = 0.5, -2.9079558716805469821718236208017, 0.22354069897811569627360909276199


@inlined
def _solve_arrow(b0, b1, b2, arrow):
    """Return the solution k of (shift I - J) k = b for the arrow matrix J, axles eliminated."""
    to_front, to_rear, j10, j20, inverse, front, rear = arrow
    k0 = (b0 + to_front * b1 + to_rear * b2) * inverse
    return k0, (b1 + j10 * k0) * front, (b2 + j20 * k0) * rear


@compiled
def ros3(x, step, duration, inputs, plant, tyres):
    """Advance the state by `duration`; return the step size to try next.

    The three components stand as scalars, which compiles to half the time of arrays.

    Parameters
    ----------
    x
        State, shape (3,), changed in place.
    step
        First step size to try [s].
    duration
        Time to cover [s].
    inputs, plant
        Records of `INPUT_TYPE` and `PLANT_TYPE`, constant over the interval.
    tyres
        Record of `TYRE_TYPE` that belongs to `x` before the call.
    """
    gravity = gravity_along(inputs)
    radius = plant.wheel_radius  # a scale for the error, not the axles' own
    v, f, r = x[0], x[1], x[2]  # velocity, front axle, rear axle
    force_front = inputs.mu_front * plant.load_front * tyres.front
    force_rear = inputs.mu_rear * plant.load_rear * tyres.rear
    rate_v, rate_f, rate_r = rates(v, f, r, force_front, force_rear, gravity, inputs, plant)
    j00, j01, j02, j10, j11, j20, j22 = jacobian(v, f, r, inputs, plant, tyres)
    done = 0.0
    for _ in range(_MOST_TRIES):
        h = min(step, duration - done)
        last = h >= (duration - done) * (1.0 - 1e-9)
        shift, per_step = 1.0 / (_GAMMA * h), 1.0 / h
        front, rear = 1.0 / (shift - j11), 1.0 / (shift - j22)
        to_front, to_rear = j01 * front, j02 * rear
        inverse = 1.0 / (shift - j00 - to_front * j10 - to_rear * j20)
        arrow = (to_front, to_rear, j10, j20, inverse, front, rear)
        k1v, k1f, k1r = _solve_arrow(rate_v, rate_f, rate_r, arrow)
        next_v, next_f, next_r = state_rates(v + k1v, f + k1f, r + k1r, gravity, inputs, plant)
        c21, c31, c32 = _C21 * per_step, _C31 * per_step, _C32 * per_step
        k2v, k2f, k2r = _solve_arrow(
            next_v + c21 * k1v, next_f + c21 * k1f, next_r + c21 * k1r, arrow
        )
        k3v, k3f, k3r = _solve_arrow(
            next_v + c31 * k1v + c32 * k2v,
            next_f + c31 * k1f + c32 * k2f,
            next_r + c31 * k1r + c32 * k2r,
            arrow,
        )
        error_v = abs(_E1 * k1v + _E2 * k2v + _E3 * k3v) / (1.0 + abs(v))
        error_f = abs(_E1 * k1f + _E2 * k2f + _E3 * k3f) * radius / (1.0 + abs(f) * radius)
        error_r = abs(_E1 * k1r + _E2 * k2r + _E3 * k3r) * radius / (1.0 + abs(r) * radius)
        if not isfinite(error_v + error_f + error_r):
            x[:] = np.nan  # nothing to retry: the simulation ends such a run by name
            return duration
        error = max(error_v, error_f, error_r) / TOLERANCE
        growth = 5.0 if error < 5e-3 else max(0.2, 0.9 / error ** (1.0 / 3.0))
        if error <= 1.0:
            v += k1v + _M2 * k2v + _M3 * k3v
            f += k1f + _M2 * k2f + _M3 * k3f
            r += k1r + _M2 * k2r + _M3 * k3r
            x[0], x[1], x[2] = v, f, r
            done += h
            if last:
                return max(step, h * growth)  # the sample's end cut this step short, not the error
            evaluate_tyres(x, plant, tyres)
            force_front = inputs.mu_front * plant.load_front * tyres.front
            force_rear = inputs.mu_rear * plant.load_rear * tyres.rear
            rate_v, rate_f, rate_r = rates(v, f, r, force_front, force_rear, gravity, inputs, plant)
            j00, j01, j02, j10, j11, j20, j22 = jacobian(v, f, r, inputs, plant, tyres)
        step = h * growth
    x[:] = np.nan  # as above: no step is small enough
    return duration


@compiled
def rk4(x, duration, inputs, plant, work):
    """Advance the state by `duration` in ten equal steps.

    Arguments as for `ros3`; `work` is scratch, shape (5, 3).
    """
    k1, k2, k3, k4, stage = work[0], work[1], work[2], work[3], work[4]
    h = duration / _RK4_STEPS
    for _ in range(_RK4_STEPS):
        derivatives(x, inputs, plant, k1)
        for i in range(3):
            stage[i] = x[i] + 0.5 * h * k1[i]
        derivatives(stage, inputs, plant, k2)
        for i in range(3):
            stage[i] = x[i] + 0.5 * h * k2[i]
        derivatives(stage, inputs, plant, k3)
        for i in range(3):
            stage[i] = x[i] + h * k3[i]
        derivatives(stage, inputs, plant, k4)
        for i in range(3):
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])


@compiled
def integrate(x, step, duration, inputs, plant, integrator, tyres, work):
    """Advance the state by `duration` with a named integrator; return the next step size."""
    if integrator == RK4:
        rk4(x, duration, inputs, plant, work)
        return step
    return ros3(x, step, duration, inputs, plant, tyres)


def scratch() -> np.ndarray:
    """Return the scratch array that `integrate` needs."""
    return np.zeros((5, 3))
