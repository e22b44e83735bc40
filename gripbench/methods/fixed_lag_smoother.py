"""Fixed-lag smoother: a factor graph over the last half second, solved incrementally by gtsam.

Dellaert & Kaess (2017), Factor graphs for robot perception, Foundations and Trends in Robotics 6;
Kaess et al. (2012), iSAM2, International Journal of Robotics Research 31. A node holds v_y, r,
ln C_f and ln C_r over the values on paper and ln mu at the end of a window of 50 ms; a factor
between two nodes holds the single-track model with brush tyres, the walks of the parameters, and
the means of yaw rate and a_y (`blocks.track_nodes`). Nodes older than the lag are marginalised.

At time t it tells of t - `LAG`, from all samples up to t, and is scored there, against the truth of
that time: what it writes is causal and half a second old. Its name says so wherever it stands.

Gtsam is the extra `smoother`.
"""

from __future__ import annotations

from math import exp, log
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    LATERAL_ESTIMATES,
    LATERAL_VARIANCES,
    SingleTrackFilter,
)
from gripbench.methods.blocks.solved import SolvedMethod
from gripbench.methods.blocks.track_nodes import (
    NODE_STATE,
    STATES,
    WINDOW,
    between_slopes,
    gather,
    take_window,
)
from gripbench.methods.contract import Parameter

LAG = 0.5
"""Age of an estimate [s]."""

_RESIDUALS = 7

Floats = npt.NDArray[np.float64]


class Graph:
    """The nodes of the last half second; see `blocks.solved.Solver`."""

    def __init__(self, params: npt.NDArray[Any]) -> None:
        import gtsam

        settings = gtsam.ISAM2Params()
        settings.setRelinearizeThreshold(0.01)
        settings.relinearizeSkip = 1
        margin = 2.0 * float(params["window_time"][0])
        self._smoother = gtsam.IncrementalFixedLagSmoother(LAG + margin, settings)
        self._times: list[float] = []  # of the nodes
        self._speeds: list[float] = []
        self._kept: list[tuple[float, float, Floats, Floats]] = []  # time, speed, mean, variances
        self._params = params

    def advance(
        self, state: npt.NDArray[Any], obs: npt.NDArray[Any], est: npt.NDArray[Any]
    ) -> None:
        """Take a sample; add a node where a window is full."""
        params = self._params
        full = gather(state, obs, params)
        time = float(obs["time"][0])
        if obs["first"][0]:
            self._first(time, state[0], obs[0], params[0])
        if full:
            self._add(time, state)
        self._write(time - LAG, est)

    def _first(self, time: float, state: Any, obs: Any, params: Any) -> None:
        import gtsam

        mean = np.array([0.0, obs["yaw_rate"], 0.0, 0.0, log(params["friction_mean"])])
        deviations = np.array(
            [params["speed_y_std"], 1.0, params["stiffness_std"], params["stiffness_std"],
             params["friction_std"]]
        )  # fmt: skip
        state["x"] = mean
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.PriorFactorVector(0, mean, gtsam.noiseModel.Diagonal.Sigmas(deviations)))
        values.insert(0, mean)
        self._smoother.update(graph, values, {0: time})
        self._times, self._speeds = [time], [float(state["inputs"]["speed"])]
        self._kept = [(time, self._speeds[0], mean, deviations**2)]

    def _add(self, time: float, state: npt.NDArray[Any]) -> None:
        import gtsam

        window = np.empty(len(WINDOW))
        speed = float(state["inputs"]["speed"][0])
        take_window(state, window)
        last = len(self._times)
        keys = [last - 1, last]
        params = self._params

        def error(factor: Any, values: Any, slopes: Any) -> Floats:
            residual, both = np.empty(_RESIDUALS), np.empty((_RESIDUALS, 2 * STATES))
            before, after = (np.asarray(values.atVector(key)).ravel() for key in keys)
            between_slopes(before, after, window, params, residual, both)
            if slopes is not None:
                slopes[0] = np.asfortranarray(both[:, :STATES])
                slopes[1] = np.asfortranarray(both[:, STATES:])
            return residual

        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        unit = gtsam.noiseModel.Unit.Create(_RESIDUALS)
        graph.add(gtsam.CustomFactor(unit, keys, error))
        values.insert(last, np.array(state["x"][0]))
        self._smoother.update(graph, values, {last: time})
        self._smoother.update()
        self._times.append(time)
        self._speeds.append(speed)
        state["x"][0] = self._smoother.calculateEstimateVector(last)
        # the estimates of the next window lie between these two
        at = max(int(np.searchsorted(self._times, time - LAG + 1e-9)) - 1, 0)
        self._kept = [self._node(key) for key in (at, at + 1)]

    def _node(self, key: int) -> tuple[float, float, Floats, Floats]:
        mean = np.asarray(self._smoother.calculateEstimateVector(key)).ravel()
        variances = np.diag(self._smoother.marginalCovariance(key))
        return self._times[key], self._speeds[key], mean, variances

    def _write(self, time: float, est: npt.NDArray[Any]) -> None:
        """Write what the nodes say of a time, on the line between two of them."""
        before, after = self._kept[0], self._kept[-1]
        span = after[0] - before[0]
        share = min(max((time - before[0]) / span, 0.0), 1.0) if span > 0.0 else 0.0
        speed = (1.0 - share) * before[1] + share * after[1]
        mean = (1.0 - share) * before[2] + share * after[2]
        variances = (1.0 - share) * before[3] + share * after[3]
        square = speed * speed + mean[0] ** 2
        spread = min(variances[4], 1.0)
        mu = exp(min(mean[4] + 0.5 * spread, 0.5))
        est["sideslip"], est["speed_y"] = np.arctan2(mean[0], speed), mean[0]
        est["yaw_rate"], est["mu"] = mean[1], mu
        est["sideslip_variance"] = variances[0] * (speed / square) ** 2
        est["speed_y_variance"] = variances[0]
        est["mu_variance"] = mu * mu * (exp(spread) - 1.0)


class FixedLagSmoother(SingleTrackFilter, SolvedMethod):
    """Motion, stiffness and friction of half a second ago."""

    name = "fixed_lag_smoother_500ms"
    title = "Fixed-lag smoother, 0.5 s late"
    reference = "Dellaert & Kaess (2017); Kaess et al. (2012)"
    packages = ("gtsam",)
    lag = LAG
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    parameters = (
        *ADAPTIVE_PARAMETERS,
        Parameter("window_time", 0.05, "s", "Time between two nodes", 5e-3, 0.5),
    )
    state = NODE_STATE
    solver = Graph
