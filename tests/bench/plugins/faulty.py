"""Methods that go wrong at their hundredth sample, each in its own way."""

import ctypes
import math
import os
import sys


class Base:
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            return self.fault(obs)
        return {"mu_front": 0.5}


class Sound(Base):
    name = "sound"

    def fault(self, obs):
        return {"mu_front": 0.5}


class Raises(Base):
    name = "raises"

    def fault(self, obs):
        raise ValueError("no\nluck")


class Hangs(Base):
    name = "hangs"

    def fault(self, obs):
        while True:
            pass


class Exits(Base):
    name = "exits"

    def fault(self, obs):
        os._exit(0)


class Leaves(Base):
    name = "leaves"

    def fault(self, obs):
        sys.exit(3)


class Crashes(Base):
    name = "crashes"

    def fault(self, obs):
        ctypes.string_at(0)


class Hoards(Base):
    name = "hoards"

    def fault(self, obs):
        self.hoard = [bytearray(10**7) for _ in range(400)]


class NotANumber(Base):
    name = "not_a_number"

    def fault(self, obs):
        return {"mu_front": math.nan}


class Infinite(Base):
    name = "infinite"

    def fault(self, obs):
        return {"mu_front": 1e200}


class Peeks(Base):
    name = "peeks"

    def fault(self, obs):
        return {"mu_front": obs["speed_gps"]}


class Misnames(Base):
    name = "misnames"

    def fault(self, obs):
        return {"mu": 0.5}


class Adds(Base):
    name = "adds"

    def fault(self, obs):
        return {"mu_front": 0.5, "mu_rear": 0.5}


class Nests(Base):
    name = "nests"

    def fault(self, obs):
        return {"mu_front": [0.5, 0.5]}


class Demands(Base):
    name = "demands"

    def reset(self, vehicle, dt):
        vehicle["yaw_inertia_of_nothing"]


class Blind(Base):
    name = "blind"
    sensors = ("yaw_rate",)


class Floods(Base):
    name = "floods"

    def __reduce__(self):
        raise RuntimeError("not to be pickled")

    def fault(self, obs):
        return {"mu_front": self}
