"""It counts its runs in the module."""

RUNS = [0]


class StateInModule:
    name = "state_in_module"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        RUNS[0] += 1

    def update(self, obs):
        return {"mu_front": float(RUNS[0])}
