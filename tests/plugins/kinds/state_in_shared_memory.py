"""Counts its runs in memory that forks share."""

import mmap

SHARED = mmap.mmap(-1, 4096)


class StateInSharedMemory:
    name = "state_in_shared_memory"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        SHARED[0] += 1

    def update(self, obs):
        return {"mu_front": 0.1 * SHARED[0]}
