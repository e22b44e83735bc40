"""Looks for the samples to come in the frames of its callers."""

import gc
import struct
import sys

import numpy as np


class LooksAhead:
    name = "looks_ahead"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        found, frame = list(gc.get_objects()), sys._getframe(1)
        while frame is not None:
            found += frame.f_locals.values()
            frame = frame.f_back
        return {"mu_front": 1.0 if any(self.holds_more(item, obs) for item in found) else 0.5}

    def holds_more(self, item, obs):
        """Tell whether an object holds this sample among others."""
        if isinstance(item, bytes | bytearray | memoryview) and len(item) > 800:
            return struct.pack("d", obs["accel_x"]) in bytes(item)
        if isinstance(item, np.ndarray) and item.size > 100 and item.dtype.kind in "fV":
            return struct.pack("d", obs["accel_x"]) in item.tobytes()
        return False
