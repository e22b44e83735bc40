"""Ignores every signal that can be ignored, and never answers."""

import signal
import time


def ignore_all():
    for number in range(1, signal.NSIG):
        try:
            signal.signal(number, signal.SIG_IGN)
        except (OSError, ValueError):
            continue


class IgnoresSignalsAndHangs:
    name = "ignores_signals_and_hangs"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        ignore_all()

    def update(self, obs):
        time.sleep(1e6)
