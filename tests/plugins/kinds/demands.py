"""A vehicle parameter that is not there."""


class Demands:
    name = "demands"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0
        vehicle["yaw_inertia_of_nothing"]

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": 0.5}
        return {"mu_front": 0.5}
