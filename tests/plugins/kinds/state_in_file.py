"""Counts its cells in files, wherever one can be written."""

import os
import tempfile

PLACES = (
    tempfile.gettempdir(),
    "/dev/shm",
    "/var/tmp",
    os.path.dirname(__file__),
    os.path.expanduser("~"),
)


class StateInFile:
    name = "state_in_file"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.count = 0
        for place in PLACES:
            path = os.path.join(place, "gripbench_counted")
            try:
                with open(path, "a+") as file:
                    file.write("x")
                    file.seek(0)
                    self.count = max(self.count, len(file.read()))
            except OSError:
                continue

    def update(self, obs):
        return {"mu_front": 0.5 + 0.01 * self.count}
