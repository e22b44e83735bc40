"""Integrators of the longitudinal plant over one sample interval with constant inputs.

`rodas3`
    The accurate default: L-stable Rosenbrock method of order 3 with an embedded order 2
    (Sandu et al., "Benchmarking stiff ODE solvers for atmospheric chemistry problems II",
    Atmospheric Environment 31, 1997), analytic Jacobian, step control. The wheel equation has the
    eigenvalue -C R^2/(I v), about -12000/v per second; an L-stable method follows the slow
    solution with steps as long as the sample.
`rk4`
    Classical Runge-Kutta with ten steps a sample: an independent check; unstable below 0.5 m/s.

The variable-step solver of the paper is in `longitudinal_paper_solver`.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from gripbench.envs.longitudinal_plant import compiled, derivatives, linearise

RODAS3, RK4 = 0, 1
INTEGRATORS = {"rodas3": RODAS3, "rk4": RK4}

TOLERANCE = 3e-7
"""Largest local error of `rodas3`, relative to 1 m/s + the speed (rolling speed for an axle)."""

_RK4_STEPS = 10


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
def rodas3(x, step, duration, inputs, plant, work):  # type: ignore[no-untyped-def]
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
    work
        Scratch, shape (12, 3).
    """
    jac, k1, k2, k3, k4 = work[0:3], work[3], work[4], work[5], work[6]
    stage, slope, slope0 = work[7], work[8], work[9]
    radius = plant.wheel_radius
    done = 0.0
    linearise(x, inputs, plant, slope0, jac)
    while True:
        h = min(step, duration - done)
        last = h >= (duration - done) * (1.0 - 1e-9)
        shift = 2.0 / h
        for i in range(3):
            k1[i] = slope0[i]
        _solve_arrow(jac, shift, k1)
        for i in range(3):
            k2[i] = slope0[i] + 4.0 / h * k1[i]
        _solve_arrow(jac, shift, k2)
        for i in range(3):
            stage[i] = x[i] + 2.0 * k1[i]
        derivatives(stage, inputs, plant, slope)
        for i in range(3):
            k3[i] = slope[i] + (k1[i] - k2[i]) / h
        _solve_arrow(jac, shift, k3)
        for i in range(3):
            stage[i] = x[i] + 2.0 * k1[i] + k3[i]
        derivatives(stage, inputs, plant, slope)
        for i in range(3):
            k4[i] = slope[i] + (k1[i] - k2[i] - 8.0 / 3.0 * k3[i]) / h
        _solve_arrow(jac, shift, k4)
        error = 0.0
        for i in range(3):
            scale = 1.0 if i == 0 else radius
            error = max(error, abs(k4[i]) * scale / (1.0 + abs(x[i]) * scale))
        error /= TOLERANCE
        if not isfinite(error):
            x[:] = np.nan  # nothing to retry: the simulation ends such a run by name
            return duration
        accepted = error <= 1.0
        if accepted:
            for i in range(3):
                x[i] += 2.0 * k1[i] + k3[i] + k4[i]
            done += h
        growth = 5.0 if error < 1e-4 else max(0.2, min(5.0, 0.9 / error ** (1.0 / 3.0)))
        if accepted and last:
            return max(step, h * growth)  # the sample's end, not the error, cut this step short
        step = h * growth
        if accepted:
            linearise(x, inputs, plant, slope0, jac)


@compiled
def rk4(x, duration, inputs, plant, work):  # type: ignore[no-untyped-def]
    """Advance the state by `duration` in ten equal steps; arguments as for `rodas3`."""
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
def integrate(x, step, duration, inputs, plant, integrator, work):  # type: ignore[no-untyped-def]
    """Advance the state by `duration` with a named integrator; return the next step size."""
    if integrator == RK4:
        rk4(x, duration, inputs, plant, work)
        return step
    return rodas3(x, step, duration, inputs, plant, work)


def scratch() -> np.ndarray:
    """Return the scratch array that `integrate` needs."""
    return np.zeros((12, 3))
