"""It prints, also to standard output itself."""

import os


class Prints:
    name = "prints"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            print("x" * 100_000)
            os.write(1, b"y" * 100_000)
        return {"mu_front": 0.5}
