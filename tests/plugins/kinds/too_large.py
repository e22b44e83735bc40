"""A number whose square is none."""


class TooLarge:
    name = "too_large"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 1e200}
        return {"mu_front": 0.5}
