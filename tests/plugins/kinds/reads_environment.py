"""Looks for the run in its environment and arguments."""

import os
import sys


class ReadsEnvironment:
    name = "reads_environment"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        told = " ".join([*os.environ, *os.environ.values(), *sys.argv])
        return {
            "mu_front": 1.0 if "short" in told or "GRIPBENCH" in told or "PYTEST" in told else 0.5
        }
