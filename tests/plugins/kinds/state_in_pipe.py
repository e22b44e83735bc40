"""Counts its runs by what lies in a pipe that forks share."""

import os

READ, WRITE = os.pipe()
os.set_blocking(READ, False)


class StateInPipe:
    name = "state_in_pipe"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        try:
            self.count = len(os.read(READ, 100)) + 1
        except BlockingIOError:
            self.count = 1
        os.write(WRITE, b"x" * self.count)

    def update(self, obs):
        return {"mu_front": 0.1 * self.count}
