"""It takes all memory."""


class Hoards:
    name = "hoards"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            self.hoard = [bytearray(10**7) for _ in range(400)]
        return {"mu_front": 0.5}
