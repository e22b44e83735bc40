"""It has no update."""


class DeclaresNoUpdate:
    name = "declares_no_update"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def advance(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
