"""Moving-horizon estimator on the single-track model with brush tyres, solved by casadi and ipopt.

Rao, Rawlings & Mayne (2003), Constrained state estimation for nonlinear discrete-time systems:
stability and moving horizon approximations, IEEE Transactions on Automatic Control 48; of sideslip
and friction Zanon, Frasch & Diehl (2013), Nonlinear moving horizon estimation for combined state
and friction coefficient estimation in autonomous driving, European Control Conference. In every
window of 50 ms the states v_y, r of the last `HORIZON` windows and the constants ln C_f, ln C_r,
ln mu minimise

    |arrival|^2 + sum |x_k+1 - f(x_k)|^2_Q + sum |y_k - h(x_k)|^2_R,

with bounds on the constants. The arrival cost is the Gauss-Newton information of what has left the
horizon, at the present solution (the filtering update of Rao et al.). Variances are those of the
Gauss-Newton information of the whole horizon.

Casadi is the extra `mhe`; Andersson et al. (2019), CasADi, Mathematical Programming Computation 11.
"""

from __future__ import annotations

from math import log
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    LATERAL_ESTIMATES,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    write_friction,
    write_lateral,
)
from gripbench.methods.blocks.solved import SolvedMethod
from gripbench.methods.blocks.track_nodes import NODE_STATE, WINDOW, gather, take_window
from gripbench.methods.contract import Parameter, compiled

HORIZON = 15
"""Windows in the horizon: 0.75 s."""

_LOW = np.array([-1.0, -1.0, log(0.05)])
_HIGH = np.array([1.0, 1.0, log(1.4)])
_MOTION = 2 * (HORIZON + 1)
_SIZE = _MOTION + 3  # motion of every node, then the constants

Floats = npt.NDArray[np.float64]


def residuals(params: Any) -> Any:
    """Return the casadi function from (unknowns, data) to (residuals, their slopes).

    Parameters
    ----------
    params
        Record with the car on paper and the noise levels.

    Returns
    -------
    Function of the `_SIZE` unknowns and of the data: root of the arrival's information (25, by
    columns), its mean (5), then `WINDOW` of each window. Residuals: arrival (5), then of each
    window motion (2), yaw rate and a_y; those of a window without duration are zero at rest.
    """
    import casadi as ca

    z = ca.SX.sym("z", _SIZE)
    data = ca.SX.sym("data", 30 + len(WINDOW) * HORIZON)
    constants = z[_MOTION:]
    base = params["cg_to_front"] + params["cg_to_rear"]
    weight = params["mass"] * GRAVITY / base
    a, b = params["cg_to_front"], params["cg_to_rear"]

    def axle(tangent: Any, stiffness: Any, limit: Any) -> Any:
        share = ca.fmin(ca.fabs(stiffness * tangent) / (3.0 * limit), 1.0)
        return ca.sign(tangent) * limit * (1.0 - (1.0 - share) ** 3)

    def motion(x: Any, speed: Any, steer: Any) -> tuple[Any, Any]:
        """Return the rates of v_y and r, and a_y."""
        mu = ca.exp(constants[2])
        front = ca.tan(steer - ca.atan2(x[0] + a * x[1], speed))
        rear = -(x[0] - b * x[1]) / speed
        force_f = axle(front, params["cornering_stiffness_front"] * ca.exp(constants[0]),
                       mu * weight * b) * ca.cos(steer)  # fmt: skip
        force_r = axle(rear, params["cornering_stiffness_rear"] * ca.exp(constants[1]),
                       mu * weight * a)  # fmt: skip
        accel = (force_f + force_r) / params["mass"]
        turn = (a * force_f - b * force_r) / params["yaw_inertia"]
        return ca.vertcat(accel - speed * x[1], turn), accel

    root = ca.reshape(data[:25], 5, 5)
    found = [root @ (ca.vertcat(z[:2], constants) - data[25:30])]
    for k in range(HORIZON):
        before, after = z[2 * k : 2 * k + 2], z[2 * k + 2 : 2 * k + 4]
        at = 30 + len(WINDOW) * k
        span, speed, first, last = (data[at + i] for i in range(4))
        one, force = motion(before, speed, first)
        two, _ = motion(before + 0.5 * span * one, speed, 0.5 * (first + last))
        three, _ = motion(before + 0.5 * span * two, speed, 0.5 * (first + last))
        four, _ = motion(before + span * three, speed, last)
        moved = before + span / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        _, other = motion(after, speed, last)
        trust = ca.sqrt(span)
        walks = ca.vertcat(params["speed_y_walk"], params["yaw_rate_walk"])
        found += [
            (after - moved) / (walks * ca.fmax(trust, 1e-3)),
            trust * (data[at + 4] - 0.5 * (before[1] + after[1])) / params["gyro_noise"],
            trust * (data[at + 5] - 0.5 * (force + other)) / params["accel_y_noise"],
        ]
    vector = ca.vertcat(*found)
    return ca.Function("residuals", [z, data], [vector, ca.jacobian(vector, z)])


def solver(function: Any) -> Any:
    """Return casadi's solver of the least squares of `residuals`."""
    import casadi as ca

    z = ca.SX.sym("z", _SIZE)
    data = ca.SX.sym("data", 30 + len(WINDOW) * HORIZON)
    vector, _ = function(z, data)
    problem = {"x": z, "p": data, "f": 0.5 * ca.sumsqr(vector)}
    options: dict[str, Any] = {
        "print_time": False,
        "calc_lam_p": False,
        "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 30, "tol": 1e-6},
    }
    return ca.nlpsol("horizon", "ipopt", problem, options)


@compiled
def _write(states, params, estimates):
    state, est = states[0], estimates[0]
    write_lateral(state.inputs, state.x[0], state.x[1], state.variance[0], est)
    write_friction(state.x[4], state.variance[1], est)


class Horizon:
    """The problem of a car and the windows in it; see `blocks.solved.Solver`."""

    def __init__(self, params: npt.NDArray[Any]) -> None:
        self._params = params
        self._function = residuals(params[0])
        self._solver = solver(self._function)
        self._data = np.zeros(30 + len(WINDOW) * HORIZON)
        self._windows = self._data[30:].reshape(HORIZON, len(WINDOW))
        self._windows[:, 1] = 10.0  # those that are not there yet have no duration, but a speed
        self._filled = 0
        self._unknowns = np.zeros(_SIZE)

    def advance(
        self, state: npt.NDArray[Any], obs: npt.NDArray[Any], est: npt.NDArray[Any]
    ) -> None:
        """Take a sample; solve where a window is full."""
        params = self._params
        full = gather(state, obs, params)
        if obs["first"][0]:
            self._start(state[0], obs[0], params[0])
        if full:
            self._solve(state, params[0])
        _write(state, params, est)

    def _start(self, state: Any, obs: Any, params: Any) -> None:
        deviations = np.array(
            [params["speed_y_std"], 1.0, params["stiffness_std"], params["stiffness_std"],
             params["friction_std"]]
        )  # fmt: skip
        mean = np.array([0.0, obs["yaw_rate"], 0.0, 0.0, log(params["friction_mean"])])
        state["x"] = mean
        state["variance"] = deviations[[0, 4]] ** 2
        self._arrive(np.diag(1.0 / deviations), mean)
        self._unknowns[:_MOTION] = np.tile(mean[:2], HORIZON + 1)
        self._unknowns[_MOTION:] = mean[2:]

    def _arrive(self, root: Floats, mean: Floats) -> None:
        self._data[:25] = root.ravel(order="F")
        self._data[25:30] = mean

    def _solve(self, state: npt.NDArray[Any], params: Any) -> None:
        z = self._unknowns
        if self._filled == HORIZON:
            self._forget(params)
            self._windows[:-1] = self._windows[1:]
            z[: _MOTION - 2] = z[2:_MOTION]
        else:
            self._filled += 1
        last = self._filled
        take_window(state, self._windows[last - 1])
        z[2 * last : _MOTION] = np.tile(state["x"][0, :2], HORIZON + 1 - last)
        lower, upper = np.full(_SIZE, -np.inf), np.full(_SIZE, np.inf)
        lower[_MOTION:], upper[_MOTION:] = _LOW, _HIGH
        result = np.asarray(self._solver(x0=z, p=self._data, lbx=lower, ubx=upper)["x"]).ravel()
        if np.isfinite(result).all():
            self._unknowns = z = result
        _, slopes = self._function(z, self._data)
        slopes = np.asarray(slopes)
        place = [2 * last, _SIZE - 1]
        columns = np.linalg.solve(slopes.T @ slopes, np.eye(_SIZE)[:, place])
        state["x"][0] = (*z[2 * last : 2 * last + 2], *z[_MOTION:])
        state["variance"][0] = columns[place, [0, 1]]

    def _forget(self, params: Any) -> None:
        """Move the oldest node into the arrival cost, linear at the present solution."""
        z = self._unknowns
        found, slopes = self._function(z, self._data)
        columns = [0, 1, 2, 3, _SIZE - 3, _SIZE - 2, _SIZE - 1]
        rows = np.asarray(slopes)[:9][:, columns]  # arrival, motion, yaw rate and a_y of a window
        both = np.column_stack((rows, np.asarray(found)[:9]))
        triangle = np.asarray(np.linalg.qr(both, mode="r"))
        root, rest = triangle[2:7, 2:7], triangle[2:7, 7]
        covariance = np.linalg.inv(root.T @ root)
        span = self._windows[0, 0]
        covariance[[2, 3], [2, 3]] += params["stiffness_walk"] ** 2 * span
        covariance[4, 4] += params["friction_walk"] ** 2 * span
        mean = z[columns[2:]] - np.linalg.solve(root, rest)
        self._arrive(np.asarray(np.linalg.cholesky(np.linalg.inv(covariance)).T), mean)


class MovingHorizonEstimator(SingleTrackFilter, SolvedMethod):
    """Recent motion, stiffness and friction by nonlinear least squares."""

    name = "moving_horizon_estimator"
    title = "Moving-horizon estimator"
    reference = "Rao, Rawlings & Mayne (2003); Zanon, Frasch & Diehl (2013)"
    packages = ("casadi",)
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    parameters = (
        *ADAPTIVE_PARAMETERS,
        Parameter("window_time", 0.05, "s", "Time between two nodes", 5e-3, 0.5),
    )
    state = NODE_STATE
    solver = Horizon
