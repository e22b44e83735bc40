"""It counts its runs in the class."""


class StateInClass:
    name = "state_in_class"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    runs = 0

    def reset(self, vehicle, dt):
        StateInClass.runs += 1

    def update(self, obs):
        return {"mu_front": float(StateInClass.runs)}
