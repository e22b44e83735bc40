"""Methods that say of the friction what is known before the drive, and how sure they are of it."""


class Prior:
    """Mean and variance of the population, the deviation times a factor."""

    name = "prior"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    variances = ("mu_front",)
    vehicle_parameters = ("friction_prior", "friction_prior_std")
    variants = {"overconfident": {"factor": 0.2}, "cautious": {"factor": 5.0}}

    def __init__(self, factor=1.0):
        self.factor = factor

    def reset(self, vehicle, dt):
        self.mean = vehicle["friction_prior"]
        self.deviation = self.factor * vehicle["friction_prior_std"]

    def update(self, obs):
        return {"mu_front": self.mean, "mu_front_variance": self.deviation**2}


class InQuantiles(Prior):
    """The same in quantiles."""

    name = "in_quantiles"
    variances = ()
    quantiles = {"mu_front": (0.05, 0.25, 0.5, 0.75, 0.95)}
    normal = (-1.6449, -0.6745, 0.0, 0.6745, 1.6449)

    def update(self, obs):
        values = [self.mean + z * self.deviation for z in self.normal]
        names = [f"mu_front_q{level}" for level in ("05", "25", "50", "75", "95")]
        return {"mu_front": self.mean, **dict(zip(names, values, strict=True))}


class Crossing(InQuantiles):
    """Quantiles that cross later on."""

    name = "crossing"

    def update(self, obs):
        found = super().update(obs)
        if obs["time"] > 0.1:
            found["mu_front_q95"] = self.mean - 1.0
        return found


class Negative(Prior):
    """A variance that becomes negative."""

    name = "negative"

    def update(self, obs):
        return {"mu_front": self.mean, "mu_front_variance": 0.1 - obs["time"]}


class Certain(Prior):
    """A variance of zero: not a word on the error."""

    name = "certain"

    def update(self, obs):
        return {"mu_front": self.mean, "mu_front_variance": 0.0}


class Silent(Prior):
    """No variance."""

    name = "silent"
    variances = ()

    def update(self, obs):
        return {"mu_front": self.mean}


class Watched(Prior):
    """A filter that expects no acceleration, and shows how much it is surprised."""

    name = "watched"
    innovations = ("accel_x",)

    def update(self, obs):
        return super().update(obs) | {
            "accel_x_innovation": obs["accel_x"],
            "accel_x_innovation_variance": 1e-4,
        }
