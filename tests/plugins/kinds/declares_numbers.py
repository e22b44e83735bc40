"""A number among its sensors."""


class DeclaresNumbers:
    name = "declares_numbers"
    sensors = ("accel_x", 3)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
