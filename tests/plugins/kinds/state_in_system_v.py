"""Counts its cells in shared memory of System V."""

import ctypes


class StateInSystemV:
    name = "state_in_system_v"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        library = ctypes.CDLL(None)
        library.shmat.restype = ctypes.c_void_p
        segment = library.shmget(0x67726970, 4096, 0o1600)
        self.count = 0
        if segment >= 0:
            count = ctypes.cast(library.shmat(segment, None, 0), ctypes.POINTER(ctypes.c_int))
            count[0] += 1
            self.count = count[0]

    def update(self, obs):
        return {"mu_front": 0.5 + 0.01 * self.count}
