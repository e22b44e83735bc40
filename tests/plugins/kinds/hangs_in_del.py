"""Never lets go of itself."""

import time


class HangsInDel:
    name = "hangs_in_del"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.own = [self]

    def update(self, obs):
        return {"mu_front": 0.5}

    def __del__(self):
        time.sleep(1e6)
