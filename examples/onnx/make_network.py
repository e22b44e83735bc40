"""Write `smoothed_force.onnx`: a low-pass as a network with a state. Needs the package onnx.

A network that was trained with any framework is exported to such a file by that framework; what it
keeps between samples must be an input and an output.
"""

import sys
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def low_pass(kind=TensorProto.DOUBLE, share_of_mass=0.5, state="smooth"):
    """Return the network: smooth += elapsed / (time_constant + elapsed) (accel_x - smooth)."""

    def tensor(name):
        return helper.make_tensor_value_info(name, kind, [1, 1])

    value = np.full((1, 1), share_of_mass, helper.tensor_dtype_to_np_dtype(kind))
    nodes = [
        helper.make_node("Add", ["settings", "elapsed"], ["both"]),
        helper.make_node("Div", ["elapsed", "both"], ["share"]),
        helper.make_node("Sub", ["sample", state], ["difference"]),
        helper.make_node("Mul", ["share", "difference"], ["change"]),
        helper.make_node("Add", [state, "change"], ["next"]),
        helper.make_node("Mul", ["factor", "vehicle"], ["mass"]),
        helper.make_node("Mul", ["mass", "next"], ["estimates"]),
    ]
    graph = helper.make_graph(
        nodes,
        "low_pass",
        [tensor(name) for name in ("sample", "elapsed", "vehicle", "settings", state)],
        [tensor("estimates"), tensor("next")],
        [numpy_helper.from_array(value, "factor")],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else __file__).resolve()
    folder = folder if folder.is_dir() else folder.parent
    onnx.save(low_pass(), folder / "smoothed_force.onnx")
