"""A method in a program of its own, in C, which speaks records of float64."""

from gripbench import Parameter, Program


class SmoothedForceRecords(Program):
    name = "smoothed_force_records"
    title = "Smoothed force, in a program that speaks records"
    command = ("./smoothed_force",)
    protocol = "records"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-4),)
