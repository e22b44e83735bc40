"""Counts its runs in the memory of the process that forked it."""

import array
import os

COUNT = array.array("q", [0])


class StateInParentMemory:
    name = "state_in_parent_memory"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.count = COUNT[0] + 1
        try:
            with open(f"/proc/{os.getppid()}/mem", "r+b", 0) as file:
                file.seek(COUNT.buffer_info()[0])
                file.write(self.count.to_bytes(8, "little"))
        except OSError:
            pass

    def update(self, obs):
        return {"mu_front": 0.1 * self.count}
