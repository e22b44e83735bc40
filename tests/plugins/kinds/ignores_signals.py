"""Ignores every signal that can be ignored."""

import signal


def ignore_all():
    for number in range(1, signal.NSIG):
        try:
            signal.signal(number, signal.SIG_IGN)
        except (OSError, ValueError):
            continue


class IgnoresSignals:
    name = "ignores_signals"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        ignore_all()

    def update(self, obs):
        return {"mu_front": 0.5}
