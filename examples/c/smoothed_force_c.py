"""A method in C: build `smoothed_force.c` first, see `gripbench_method.h`."""

from gripbench import Parameter, SharedLibrary


class SmoothedForceC(SharedLibrary):
    name = "smoothed_force_c"
    title = "Smoothed force, in C"
    library = "libsmoothed_force.so"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-4),)
    variants = {"slow": {"time_constant": 0.5}}
