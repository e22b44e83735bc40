"""A method in an ONNX file: run `python make_network.py` first."""

from gripbench import OnnxModel, Parameter


class SmoothedForceOnnx(OnnxModel):
    name = "smoothed_force_onnx"
    title = "Smoothed force, as a network"
    model = "smoothed_force.onnx"
    states = {"smooth": "next"}
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-4),)
