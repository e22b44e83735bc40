"""The variable-step solver that Tables IV and V of Li, Du & Li (2014) rest on.

The paper attributes the oscillation in its figures to a "process error in the simulation model".
What reproduces it is not a noise term but the error of a Dormand-Prince 5(4) pair at a relative
tolerance of 1e-3: the wheel equation is stiff, so the step control settles at the stability
limit of the explicit method and the wheel speeds ring with the size of the tolerance. The size is
not a free setting.

Step control: the error is the largest of |h sum(E k)| over max(|x_old|, |x_new|, largest |x| so
far, 1e-3); a step whose error exceeds the tolerance is repeated with
h max(0.1, 0.8 (tol/error)^(1/5)), then with h/2; an accepted step is followed by
h / max(0.2, 1.25 (error/tol)^(1/5)), unchanged after a repeated one. Steps end exactly on the
profile's breakpoints, on a friction step and on every 0.1 s. Every accepted step is a sample.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.drivers.profiles import profile_value
from gripbench.envs.plants.longitudinal.plant import derivatives

TOLERANCE = 1e-3
FIRST_STEP = 1e-3
LARGEST_STEP = 0.6
STOP_EVERY = 0.1

MOST_TRIES = 100_000
"""Refused steps after which the solver returns to its caller, who may stop the run."""

CARRY_TYPE = np.dtype(
    [("time", "f8"), ("step", "f8"), ("stop", "i8"), ("failed", "?"), ("largest", "f8", (3,))]
)
"""What a run goes on with: time and size [s] of its next step, number of stops that are reached,
whether that step has been refused already, and the largest values of the state so far."""

# Dormand, J. R., Prince, P. J.: A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math.
# 6 (1980). Rows: stages 2 to 7; the last row is also the fifth-order solution.
_NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_STAGES = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_ERROR = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
)


@compiled
def set_inputs(inputs, time, front, rear, friction, grade):
    """Write the inputs that act at a time into a record of `INPUT_TYPE`."""
    inputs.torque_front = profile_value(time, front)
    inputs.torque_rear = profile_value(time, rear)
    mu = profile_value(time, friction)
    inputs.mu_front = mu
    inputs.mu_rear = mu
    inputs.road_grade = grade


def fresh(x0: npt.NDArray[np.float64]) -> npt.NDArray[np.void]:
    """Return the record with which a run begins at a state of shape (3,)."""
    carry = np.zeros(1, CARRY_TYPE)
    carry["step"] = FIRST_STEP
    carry["largest"] = np.abs(x0)
    return carry


@compiled
def paper_solver(x, carry, stops, inputs, plant, front, rear, friction, grade, times, states):
    """Integrate towards the last stop; write every accepted step.

    It returns when the outputs are full or after `MOST_TRIES` tries of a step, and goes on there
    when it is called again: a caller can stop a run that would take hours.

    Parameters
    ----------
    x
        State, shape (3,): the initial one, then that of the last accepted step.
    carry
        What it goes on with, one record of `CARRY_TYPE` in an array; `fresh` makes the first.
    stops
        Times [s] at which a step must end, ascending; the last is the horizon.
    inputs, plant
        Records of `INPUT_TYPE` (scratch) and `PLANT_TYPE`, arrays of length 1.
    front, rear, friction
        Segments of the torque and friction profiles.
    grade
        Road grade [rad].
    times, states
        Outputs, shapes (capacity,) and (capacity, 3).

    Returns
    -------
    Number of samples written; `carry.stop` is the number of stops that are reached.
    """
    n = x.shape[0]
    k = np.zeros((7, n))
    going = carry[0]
    stage, new, largest = np.zeros(n), np.zeros(n), going.largest
    time, h, stop, failed = going.time, going.step, going.stop, going.failed
    count, tries = 0, 0
    while stop < stops.shape[0] and count < times.shape[0]:
        # an interval never straddles a jump: within it the inputs are those of its inside
        while True:
            step = min(h, LARGEST_STEP)
            remaining = stops[stop] - time
            if step >= remaining * (1.0 - 1e-12):
                step = remaining
            for s in range(7):
                for i in range(n):
                    total = 0.0
                    for j in range(s):
                        total += _STAGES[s, j] * k[j, i]
                    stage[i] = x[i] + step * total
                at = min(time + _NODES[s] * step, stops[stop] - 1e-12)
                set_inputs(inputs[0], at, front, rear, friction, grade)
                derivatives(stage, inputs[0], plant[0], k[s])
            error = 0.0
            for i in range(n):
                new[i] = stage[i]  # the last stage is the fifth-order solution
                difference = 0.0
                for s in range(7):
                    difference += _ERROR[s] * k[s, i]
                scale = max(abs(x[i]), abs(new[i]), largest[i], 1e-3)
                error = max(error, abs(step * difference) / scale)
            if error <= TOLERANCE:
                break
            tries += 1
            if tries > MOST_TRIES:
                going.time, going.step, going.stop, going.failed = time, h, stop, failed
                return count
            shrink = 0.5 if failed else max(0.1, 0.8 * (TOLERANCE / error) ** 0.2)
            h = step * shrink
            failed = True
        if step == stops[stop] - time:
            time = stops[stop]
            stop += 1
        else:
            time += step
        h = step
        if not failed:
            h = step / max(0.2, 1.25 * (error / TOLERANCE) ** 0.2)
        for i in range(n):
            x[i] = new[i]
            largest[i] = max(largest[i], abs(x[i]))
        failed = False
        times[count] = time
        states[count] = x
        count += 1
    going.time, going.step, going.stop, going.failed = time, h, stop, failed
    return count
