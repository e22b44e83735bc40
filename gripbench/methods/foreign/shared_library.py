"""A shared library with three C functions as a method: samples in, estimates out.

`HEADER` is the whole interface; `examples/c/gripbench_method.h` is the same for a compiler.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gripbench.envs.signals import record_type
from gripbench.errors import GripbenchError, InputError
from gripbench.methods.foreign.declared import ForeignMethod

HEADER = """
void *gripbench_start(const double *vehicle, const double *settings, double step);
int gripbench_update(void *state, const double *sample, double *estimates);
void gripbench_end(void *state);
"""
"""The three functions that a library has."""


@cache
def library_loop() -> Callable[[int, int, npt.NDArray[np.float64], npt.NDArray[np.float64]], int]:
    """Return the compiled loop that calls a library's update for every sample of a recording.

    It takes the address of the function, the state, samples of shape (n, channels + 1) and
    estimates of shape (n, outputs) to fill; it returns the first code that is not 0, or 0.
    """
    import numba
    from llvmlite import ir
    from numba.core import types
    from numba.extending import intrinsic

    @intrinsic
    def call(context, function, state, sample, estimates):
        def generate(context, builder, signature, arguments):
            pointer = ir.IntType(8).as_pointer()
            kind = ir.FunctionType(ir.IntType(32), [pointer] * 3)
            target = builder.inttoptr(arguments[0], kind.as_pointer())
            given = [builder.inttoptr(item, pointer) for item in arguments[1:]]
            return builder.call(target, given)

        return types.int32(types.intp, types.intp, types.intp, types.intp), generate

    @numba.njit(nogil=True)
    def loop(function, state, samples, estimates):
        sample, estimate = samples.ctypes.data, estimates.ctypes.data
        for k in range(samples.shape[0]):
            if k > 0:
                estimates[k] = estimates[k - 1]  # what is not written keeps its value
            code = call(
                function, state, sample + k * samples.strides[0],
                estimate + k * estimates.strides[0],
            )  # fmt: skip
            if code != 0:
                return code
        return 0

    return loop


class SharedLibrary(ForeignMethod):
    """A method in a shared library.

    `gripbench_start` gets the vehicle parameters and the settings in their declared order and the
    nominal time [s] between samples, and returns a new state, or NULL. `gripbench_update` gets the
    declared channels in their order, `time` last (a channel that is missing is NaN), and writes
    what `outputs` names in this order; what it does not write keeps its last value, at first zero.
    It returns 0, or a number of its own that ends the run. `gripbench_end` frees the state.

    Attributes
    ----------
    library
        The library's file, relative to the method's own.
    """

    library: ClassVar[str]

    def __init__(self, variant: str = "", **overrides: Any) -> None:
        super().__init__(variant, **overrides)
        self._state: Any = None
        self._open()

    @property
    def files(self) -> tuple[str, ...]:
        """The library: its content is part of every row's key."""
        return (self.library,)

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start afresh for a vehicle."""
        self._end()
        given = self._ffi.new("double[]", [*self.paper(vehicle).values(), 0.0])
        settings = self._ffi.new("double[]", [*self.numbers().values(), 0.0])
        state = self._functions.gripbench_start(given, settings, dt)
        if state == self._ffi.NULL:
            raise GripbenchError(f"{self.library}: gripbench_start returned NULL")
        self._state = state
        self._sample = self._ffi.new("double[]", len(self.sensors) + 1)
        self._estimates = self._ffi.new("double[]", len(self.outputs))

    def update(self, obs: Mapping[str, float]) -> dict[str, float]:
        """Take one sample and return the estimates."""
        sample = self._sample
        for k, name in enumerate(self.sensors):
            sample[k] = obs[name]
        sample[len(self.sensors)] = obs["time"]
        code = self._functions.gripbench_update(self._state, sample, self._estimates)
        if code:
            raise GripbenchError(f"{self.library}: gripbench_update returned {code}")
        return dict(zip(self.outputs, self._estimates, strict=True))

    def run(self, vehicle: Mapping[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Run over a whole recording in one compiled loop.

        Parameters
        ----------
        vehicle
            Vehicle parameters by name.
        observations
            Structured array, shape (n,), with `time` and at least the declared channels.

        Returns
        -------
        Structured array, shape (n,), one field for each output.
        """
        times = observations["time"]
        self.reset(vehicle, float(times[1] - times[0]) if len(times) > 1 else 0.0)
        samples = np.stack([observations[name] for name in (*self.sensors, "time")], axis=1)
        estimates = np.zeros((len(samples), len(self.outputs)))
        update, state = (
            int(self._ffi.cast("uintptr_t", item))
            for item in (self._functions.gripbench_update, self._state)
        )
        code = library_loop()(update, state, np.ascontiguousarray(samples), estimates)
        if code:
            raise GripbenchError(f"{self.library}: gripbench_update returned {code}")
        return estimates.view(record_type(self.outputs)).reshape(len(samples))

    def _open(self) -> None:
        try:
            import cffi
        except ImportError:
            raise InputError(
                f"{self.name}: a shared library needs cffi: pip install 'gripbench[foreign]'"
            ) from None
        self._ffi = cffi.FFI()
        self._ffi.cdef(HEADER)
        path = self.place(self.library)
        try:
            self._functions: Any = self._ffi.dlopen(str(path))
            for name in ("gripbench_start", "gripbench_update", "gripbench_end"):
                getattr(self._functions, name)
        except (OSError, AttributeError) as error:
            raise InputError(f"{path}: cannot be used as a library: {error}") from None

    def _end(self) -> None:
        if self._state is not None:
            self._functions.gripbench_end(self._state)
            self._state = None

    def __del__(self) -> None:
        if getattr(self, "_state", None) is not None:
            self._end()

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be stored: the settings; a copy starts with `reset`."""
        return {"settings": self.settings}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.settings = state["settings"]
        self._state = None
        self._open()
