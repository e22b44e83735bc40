"""A whole number that no float holds."""


class HugeInteger:
    name = "huge_integer"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 10**400}
        return {"mu_front": 0.5}
