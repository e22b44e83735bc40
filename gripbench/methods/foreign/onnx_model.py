"""A neural network in an ONNX file as a method: samples in, estimates and the next state out.

The network is run sample by sample by onnxruntime, on one thread. What it keeps between samples is
an input and an output of its own: `states` says which output becomes which input.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gripbench.errors import LONGEST, GripbenchError, InputError, one_line
from gripbench.methods.foreign.declared import ForeignMethod
from gripbench.methods.foreign.whole_samples import WholeSamples

_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}


class OnnxModel(ForeignMethod):
    """A method in an ONNX file.

    Inputs of the network by name: `sample`, the declared channels in their order; where it has
    them, `elapsed`, the time [s] since the sample before (0 at first), `vehicle` and `settings`,
    the declared parameters in their order; and its states. Its output `estimates` holds the
    estimates, then the variances. All are float or double tensors of fixed shape, with as many
    elements as there are values.

    It is given whole samples in order, as a compiled step is; where there is none its estimates
    hold.

    Attributes
    ----------
    model
        The file, relative to the method's own. Files of weights that it names are found beside it.
    states
        For each input that is a state, the output whose value it has at the next sample; all are
        zero at first.
    """

    model: ClassVar[str]
    states: ClassVar[Mapping[str, str]] = {}

    def __init__(self, variant: str = "", **overrides: Any) -> None:
        super().__init__(variant, **overrides)
        self._open()

    @property
    def files(self) -> tuple[str, ...]:
        """The model and the files of weights that it names: part of every row's key."""
        try:
            content = self.place(self.model).read_bytes()
        except OSError:
            return (self.model,)  # who asks for its digest says that it is missing
        folder = self.model.rpartition("/")[0]
        names = sorted({name.decode("utf-8", "replace") for name in _named_in(content)})
        return (self.model, *(f"{folder}/{name}" if folder else name for name in names))

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start afresh for a vehicle: all states are zero."""
        self._samples = WholeSamples(self.sensors)
        self._given = {name: np.zeros(shape, kind) for name, (shape, kind) in self._inputs.items()}
        self._fill("vehicle", list(self.paper(vehicle).values()))
        self._fill("settings", list(self.numbers().values()))
        self._estimates = dict.fromkeys(self.outputs, 0.0)

    def update(self, obs: Mapping[str, float]) -> dict[str, float]:
        """Take one sample and return the estimates."""
        taken = self._samples.take(obs)
        if taken is None:
            return dict(self._estimates)
        values, _, elapsed = taken
        self._fill("sample", values)
        self._fill("elapsed", [elapsed])
        asked = ["estimates", *self.states.values()]
        try:
            found = self._session.run(asked, self._given)
        except Exception as error:  # onnxruntime has classes of its own for each
            raise GripbenchError(f"{self.model}: {_words(error)}") from None
        estimates = np.asarray(found[0], np.float64).ravel()
        if len(estimates) != len(self.outputs):
            raise GripbenchError(
                f"{self.model}: the output 'estimates' has {len(estimates)} values; declared are "
                f"{', '.join(self.outputs)}"
            )
        for name, value in zip(self.states, found[1:], strict=True):
            if value.shape != self._given[name].shape:
                raise GripbenchError(
                    f"{self.model}: the output '{self.states[name]}' has the shape "
                    f"{list(value.shape)}, the state '{name}' {list(self._given[name].shape)}"
                )
            self._given[name] = value
        self._estimates = dict(zip(self.outputs, estimates.tolist(), strict=True))
        return dict(self._estimates)

    def _fill(self, name: str, values: list[float]) -> None:
        if name in self._given:
            self._given[name][...] = np.reshape(values, self._given[name].shape)

    def _open(self) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise InputError(
                f"{self.name}: an ONNX model needs onnxruntime: pip install 'gripbench[onnx]'"
            ) from None
        for file in self.files:
            if not self.place(file).is_file():
                raise InputError(f"{self.place(file)}: no such file")
        path = self.place(self.model)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # one order of every sum
        options.log_severity_level = 4
        try:
            self._session = onnxruntime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise InputError(f"{path}: cannot be used as a model: {_words(error)}") from None
        self._inputs = {item.name: self._checked(item) for item in self._session.get_inputs()}
        outputs = {item.name for item in self._session.get_outputs()}
        wanted = {
            "sample": len(self.sensors),
            "elapsed": 1,
            "vehicle": len(self.vehicle_parameters),
            "settings": len(self.parameters),
        }
        for name, (shape, _) in self._inputs.items():
            if name not in wanted and name not in self.states:
                raise InputError(
                    f"{path}: the input '{name}' is none of {', '.join(wanted)}, and no state: "
                    "name it in 'states'"
                )
            if name in wanted and int(np.prod(shape)) != wanted[name]:
                raise InputError(
                    f"{path}: the input '{name}' has {int(np.prod(shape))} elements, declared are "
                    f"{wanted[name]}"
                )
        for name in ("sample", *self.states):
            if name not in self._inputs:
                raise InputError(
                    f"{path}: has no input '{name}'; it has {', '.join(self._inputs) or 'none'}"
                )
        for name in ("estimates", *self.states.values()):
            if name not in outputs:
                raise InputError(
                    f"{path}: has no output '{name}'; it has {', '.join(sorted(outputs))}"
                )

    def _checked(self, item: Any) -> tuple[tuple[int, ...], npt.DTypeLike]:
        """Return shape and type of an input."""
        if item.type not in _TYPES:
            raise InputError(
                f"{self.place(self.model)}: the input '{item.name}' is a {item.type}; allowed are "
                f"{', '.join(_TYPES)}"
            )
        if not all(isinstance(length, int) for length in item.shape):
            raise InputError(
                f"{self.place(self.model)}: the input '{item.name}' has the shape {item.shape}; "
                "export the model with fixed ones"
            )
        return tuple(item.shape), _TYPES[item.type]

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be stored: the settings; a copy starts with `reset`."""
        return {"settings": self.settings}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.settings = state["settings"]
        self._open()


def _named_in(content: bytes) -> list[bytes]:
    """Return the files that the tensors of a model name as the place of their values.

    Such a name is a protobuf record of key and value (`StringStringEntryProto`) with the key
    `location`; it is found without a parser of the whole format.
    """
    found = []
    for match in re.finditer(rb"\x0a\x08location\x12([\x80-\xff]?)([\x01-\x7f])", content):
        length = (match[1][0] & 127) + (match[2][0] << 7) if match[1] else match[2][0]
        found.append(content[match.end() : match.end() + length])
    return found


def _words(error: Exception) -> str:
    return one_line(" ".join(str(error).split()), LONGEST // 2)
