"""The time as a sensor."""


class DeclaresTime:
    name = "declares_time"
    sensors = ("accel_x", "time")
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
