"""A thread runs when it has been loaded."""

import threading
import time

threading.Thread(target=time.sleep, args=(1e6,), daemon=True).start()


class StartsThreads:
    name = "starts_threads"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
