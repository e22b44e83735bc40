"""It writes to every descriptor that it finds."""

import os


class WritesToPipes:
    name = "writes_to_pipes"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            for descriptor in range(3, 64):
                try:
                    os.write(descriptor, b"0" * 48)
                except OSError:
                    continue
        return {"mu_front": 0.5}
