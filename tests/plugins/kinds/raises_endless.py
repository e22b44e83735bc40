"""Its message has five million characters."""


class RaisesEndless:
    name = "raises_endless"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            raise ValueError("x" * 5_000_000)
        return {"mu_front": 0.5}
