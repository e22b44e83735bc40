"""Another name than declared."""


class Misnames:
    name = "misnames"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu": 0.5}
        return {"mu_front": 0.5}
