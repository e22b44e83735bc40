"""Nothing at all."""


class ReturnsNothing:
    name = "returns_nothing"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return None
        return {"mu_front": 0.5}
