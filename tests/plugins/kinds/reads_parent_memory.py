"""Opens the memory of the process that started it, and of its parents."""

import os


class ReadsParentMemory:
    name = "reads_parent_memory"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.own = {os.getpid(), os.getppid()}

    def update(self, obs):
        found = 0.5
        process = os.getppid()
        for _ in range(4):
            try:
                open(f"/proc/{process}/mem", "rb").close()
                found = 1.0 if process not in self.own else found
                status = open(f"/proc/{process}/stat").read()
            except OSError:
                break
            process = int(status.rpartition(")")[2].split()[1])
        return {"mu_front": found}
