"""A trained method: sideslip by linear least squares on windows of a second.

gripbench check examples/trained/window_regression.py --scenario slalom_snow@1
gripbench run --suite lateral_population --seeds 2 --method examples/trained/window_regression.py
"""

import numpy as np
from windows import SENSORS, VEHICLE, Windows, training_rows


class WindowRegression:
    """Sideslip as a weighted sum of what the last second held."""

    name = "window_regression"
    title = "Linear regression on windows"
    sensors = SENSORS
    estimates = ("sideslip",)
    vehicle_parameters = VEHICLE
    trained_on = "cornering"

    def __init__(self, ridge=1e-6):
        self.ridge = ridge

    def fit(self, recordings, budget):
        """Return the weights; one pass over the drives is enough."""
        rows, targets, share = training_rows(recordings)
        scale = np.sqrt(share @ rows**2) + 1e-12
        scaled = rows / scale
        matrix = scaled.T @ (share[:, None] * scaled)
        weights = np.linalg.solve(
            matrix + self.ridge * np.eye(len(matrix)), scaled.T @ (share * targets)
        )
        return {"weights": weights / scale}

    def reset(self, vehicle, dt):
        self.windows = Windows(vehicle)
        self.weights = self.fitted["weights"]
        self.sideslip = 0.0

    def update(self, obs):
        row = self.windows.take(obs)
        if row is not None:
            self.sideslip = float(self.weights @ row)
        return {"sideslip": self.sideslip}
