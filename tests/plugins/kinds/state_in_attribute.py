"""Counts its cells in an extended attribute of its own file."""

import os


class StateInAttribute:
    name = "state_in_attribute"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        try:
            self.count = int(os.getxattr(__file__, "user.counted"))
        except OSError:
            self.count = 0
        try:
            os.setxattr(__file__, "user.counted", str(self.count + 1).encode())
        except OSError:
            self.count = 0

    def update(self, obs):
        return {"mu_front": 0.5 + 0.01 * self.count}
