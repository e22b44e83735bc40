"""What it returns would run code where it is unpickled."""


class Trap:
    def __reduce__(self):
        return exec, ("open('/tmp/gripbench_was_here', 'w')",)


class UnpicklesInParent:
    name = "unpickles_in_parent"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return {"mu_front": Trap()}
        return {"mu_front": 0.5}
