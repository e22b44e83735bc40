"""Its message holds a lone surrogate."""


class RaisesSurrogate:
    name = "raises_surrogate"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            raise OSError("file \udc80")
        return {"mu_front": 0.5}
