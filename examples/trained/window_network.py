"""A trained method: sideslip by a small network on windows of a second, in NumPy.

gripbench check examples/trained/window_network.py --scenario slalom_snow@1
gripbench run --suite lateral_population --seeds 2 --method examples/trained/window_network.py
"""

import numpy as np
from scipy.optimize import minimize
from windows import SENSORS, VEHICLE, Windows, training_rows

EVERY = 5
"""Of the training rows each fifth counts: its neighbours say the same."""


def sideslip(rows, inner, outer, linear):
    """Return the network's sideslip [rad], shape (n,): a linear part and `tanh` units."""
    return rows @ linear + np.tanh(rows @ inner) @ outer


class WindowNetwork:
    """Sideslip as a weighted sum of what the last second held, and of functions of it."""

    name = "window_network"
    title = "Small network on windows"
    sensors = SENSORS
    estimates = ("sideslip",)
    vehicle_parameters = VEHICLE
    trained_on = "cornering"

    def __init__(self, units=16, decay=1e-3):
        self.units = int(units)
        self.decay = decay

    def fit(self, recordings, budget):
        """Return the weights after at most `budget` passes of L-BFGS."""
        rows, targets, share = training_rows(recordings, EVERY)
        scale = np.sqrt(share @ rows**2) + 1e-12
        rows, size = rows / scale, np.sqrt(share @ targets**2)
        targets = targets / size
        wide, units = rows.shape[1], self.units
        random = np.random.default_rng(0)
        matrix = rows.T @ (share[:, None] * rows) + self.decay * np.eye(wide)
        linear = np.linalg.solve(matrix, rows.T @ (share * targets))
        inner = random.normal(0.0, 1.0 / np.sqrt(wide), wide * units)
        start = np.concatenate([inner, np.zeros(units), linear])

        def loss(point):
            inner = point[: wide * units].reshape(wide, units)
            outer, linear = np.split(point[wide * units :], [units])
            hidden = np.tanh(rows @ inner)
            error = rows @ linear + hidden @ outer - targets
            pull = share * error
            back = np.outer(pull, outer) * (1.0 - hidden**2)
            slope = np.concatenate([(rows.T @ back).ravel(), hidden.T @ pull, rows.T @ pull])
            value = 0.5 * (share @ error**2 + self.decay * point @ point)
            return value, slope + self.decay * point

        found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxfun": budget}).x
        outer, linear = np.split(found[wide * units :], [units])
        return {
            "inner": found[: wide * units].reshape(wide, units) / scale[:, None],
            "outer": size * outer,
            "linear": size * linear / scale,
        }

    def reset(self, vehicle, dt):
        self.windows = Windows(vehicle)
        self.sideslip = 0.0

    def update(self, obs):
        row = self.windows.take(obs)
        if row is not None:
            self.sideslip = float(sideslip(row[None, :], **self.fitted)[0])
        return {"sideslip": self.sideslip}
