"""A method in a program of its own, which speaks JSON lines."""

import sys

from gripbench import Parameter, Program


class SmoothedForceProgram(Program):
    name = "smoothed_force_program"
    title = "Smoothed force, in a program"
    command = (sys.executable, "smoothed_force_lines.py")
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-4),)
