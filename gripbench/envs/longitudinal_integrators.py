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

from gripbench.envs.longitudinal_plant import compiled, derivatives, evaluate_tyres, linearise

ROS3, RK4 = 0, 1
INTEGRATORS = {"ros3": ROS3, "rk4": RK4}

TOLERANCE = 3e-7
"""Largest local error of `ros3`, relative to 1 m/s + the speed (rolling speed for an axle)."""

_RK4_STEPS = 10

_GAMMA = 0.43586652150845899941601945119356
_C21 = -1.0156171083877702091975600115545
_C31, _C32 = 4.0759956452537699824805835358067, 9.2076794298330791242156818474003
_M2, _M3 = 6.1697947043828245592553615689730, -0.42772256543218573326238373806514
_E1, _E2, _E3 = 0.5, -2.9079558716805469821718236208017, 0.22354069897811569627360909276199


@compiled
def _solve_arrow(jac, shift, b):  # type: ignore[no-untyped-def]
    """Solve (shift I - jac) k = b in place for the arrow matrix of `linearise`."""
    d1 = shift - jac[1, 1]
    d2 = shift - jac[2, 2]
    pivot = shift - jac[0, 0] - jac[0, 1] * jac[1, 0] / d1 - jac[0, 2] * jac[2, 0] / d2
    b[0] = (b[0] + jac[0, 1] * b[1] / d1 + jac[0, 2] * b[2] / d2) / pivot
    b[1] = (b[1] + jac[1, 0] * b[0]) / d1
    b[2] = (b[2] + jac[2, 0] * b[0]) / d2


@compiled
def ros3(x, step, duration, inputs, plant, tyres, work):  # type: ignore[no-untyped-def]
    """Advance the state by `duration`; return the step size to try next.

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
    work
        Scratch, shape (10, 3).
    """
    jac, k1, k2, k3 = work[0:3], work[3], work[4], work[5]
    stage, first, second = work[6], work[7], work[8]
    radius = plant.wheel_radius
    done = 0.0
    linearise(x, inputs, plant, tyres, first, jac)
    while True:
        h = min(step, duration - done)
        last = h >= (duration - done) * (1.0 - 1e-9)
        shift = 1.0 / (_GAMMA * h)
        for i in range(3):
            k1[i] = first[i]
        _solve_arrow(jac, shift, k1)
        for i in range(3):
            stage[i] = x[i] + k1[i]
        derivatives(stage, inputs, plant, second)
        for i in range(3):
            k2[i] = second[i] + _C21 / h * k1[i]
        _solve_arrow(jac, shift, k2)
        for i in range(3):
            k3[i] = second[i] + (_C31 * k1[i] + _C32 * k2[i]) / h
        _solve_arrow(jac, shift, k3)
        error = 0.0
        for i in range(3):
            scale = 1.0 if i == 0 else radius
            difference = _E1 * k1[i] + _E2 * k2[i] + _E3 * k3[i]
            share = abs(difference) * scale / (1.0 + abs(x[i]) * scale)
            if not share <= error:  # a share that is not a number counts as well
                error = share
        error /= TOLERANCE
        if not isfinite(error):
            x[:] = np.nan  # nothing to retry: the simulation ends such a run by name
            return duration
        growth = 5.0 if error < 5e-3 else max(0.2, 0.9 / error ** (1.0 / 3.0))
        if error <= 1.0:
            for i in range(3):
                x[i] += k1[i] + _M2 * k2[i] + _M3 * k3[i]
            done += h
            if last:
                return max(step, h * growth)  # the sample's end cut this step short, not the error
            evaluate_tyres(x, plant, tyres)
            linearise(x, inputs, plant, tyres, first, jac)
        step = h * growth


@compiled
def rk4(x, duration, inputs, plant, work):  # type: ignore[no-untyped-def]
    """Advance the state by `duration` in ten equal steps; arguments as for `ros3`."""
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
def integrate(x, step, duration, inputs, plant, integrator, tyres, work):  # type: ignore[no-untyped-def]
    """Advance the state by `duration` with a named integrator; return the next step size."""
    if integrator == RK4:
        rk4(x, duration, inputs, plant, work)
        return step
    return ros3(x, step, duration, inputs, plant, tyres, work)


def scratch() -> np.ndarray:
    """Return the scratch array that `integrate` needs."""
    return np.zeros((10, 3))
