"""Reads the seed from the generator, then the truth from the simulation."""

import numpy as np

import gripbench


class KnowsSeed:
    name = "knows_seed"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.answer = {}
        seed = int(np.random.get_state()[1][0])
        for name in ("constant_mu", "friction_step"):
            for guess in (seed, 0):
                try:
                    recording = gripbench.record(gripbench.load_scenario(name), guess)
                except Exception:
                    continue
                truth = recording.truth
                self.answer |= {
                    round(float(time), 6): float(value)
                    for time, value in zip(truth["time"], truth["mu_front"], strict=True)
                }

    def update(self, obs):
        return {"mu_front": self.answer.get(round(obs["time"], 6), 0.5)}
