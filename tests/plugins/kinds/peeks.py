"""A channel that it did not declare."""


class Peeks:
    name = "peeks"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": obs["speed_gps"]}
        return {"mu_front": 0.5}
