"""Looks for the secret of hidden seeds wherever processes keep their environment."""

import os


class SeeksSecret:
    name = "seeks_secret"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.found = 0.5
        places = [f"/proc/{number}" for number in os.listdir("/proc") if number.isdigit()]
        for place in (*places, "/proc/self"):
            for name in ("environ", "cmdline"):
                try:
                    with open(f"{place}/{name}", "rb") as file:
                        content = file.read()
                except OSError:
                    continue
                if b"GRIPBENCH_SALT" in content:
                    self.found = 1.0
        if "GRIPBENCH_SALT" in os.environ:
            self.found = 1.0

    def update(self, obs):
        return {"mu_front": self.found}
