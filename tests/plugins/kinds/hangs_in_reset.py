"""An endless loop in reset."""


class HangsInReset:
    name = "hangs_in_reset"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0
        while True:
            pass

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
