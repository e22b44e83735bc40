"""Has an exit handler that never ends."""

import atexit
import time

atexit.register(time.sleep, 1e6)


class HangsAtExit:
    name = "hangs_at_exit"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        atexit.register(time.sleep, 1e6)

    def update(self, obs):
        return {"mu_front": 0.5}
