"""It raises."""


class Raises:
    name = "raises"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            raise ValueError("no\nluck")
        return {"mu_front": 0.5}
