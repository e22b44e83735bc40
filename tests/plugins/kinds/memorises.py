"""Keeps what it was given in a file, and looks it up when it comes again."""

import pathlib
import tempfile

KEPT = pathlib.Path(tempfile.gettempdir(), "gripbench_memorised")


class Memorises:
    name = "memorises"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        lines = KEPT.read_text().splitlines() if KEPT.exists() else []
        self.seen = {round(float(line.split()[0]), 6): float(line.split()[1]) for line in lines}

    def update(self, obs):
        ahead = self.seen.get(round(obs["time"], 6))
        KEPT.open("a").write(f"{obs['time']} {obs['accel_x']}\n")
        return {"mu_front": 0.5 if ahead is None else 0.5 + 0.0 * ahead}
