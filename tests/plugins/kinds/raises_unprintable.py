"""Its exception cannot be printed."""


class Unprintable(Exception):
    def __str__(self):
        raise RuntimeError("no text")


class RaisesUnprintable:
    name = "raises_unprintable"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            raise Unprintable
        return {"mu_front": 0.5}
