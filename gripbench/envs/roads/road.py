"""The road under a planar vehicle: friction of each wheel, bank, grade; and the magnetic field.

Bank and grade are profiles over the distance travelled, friction depends on the place of each
wheel on the track. Whatever is random is drawn once for a seed, before the run starts, from
streams of its own, so that a run is the same however it is advanced.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.compilation import compiled
from gripbench.configuration import Configuration
from gripbench.envs.hidden_draws import entropy
from gripbench.envs.plants.planar import plant
from gripbench.envs.vehicles import GRAVITY

SPACING = 0.25
"""Distance [m] between two points of a profile."""


class Surface(Configuration):
    """A stretch of the path with a friction coefficient of its own."""

    start: float = Field(ge=0.0, description="distance along the path [m]")
    mu: float = Field(gt=0.0, le=2.0)
    length: float = Field(gt=0.0, description="[m]")


class Road(Configuration):
    """The road's friction and shape.

    Attributes
    ----------
    mu
        Available friction coefficient.
    mu_right
        The same right of the track's centre line (split friction); 0: as on the left.
    mu_after
        The same, on both sides, from `mu_jump_at` [m] along the track; 0: no jump.
    mu_jump_length
        Length [m] over which the jump happens.
    bank, grade
        Constant inclinations [rad]: left side up, downhill.
    turn_bank
        Superelevation [rad] of the path's sharpest curve; inner side down, in proportion to
        curvature.
    bank_std, grade_std
        Standard deviation [rad] of smooth noise on both.
    mu_std
        Standard deviation of smooth noise on the logarithm of the friction coefficient.
    correlation_length
        Of the noise [m].
    surfaces
        Stretches of another friction coefficient, under both sides, the later one on top.
    """

    mu: float = Field(gt=0.0, le=2.0)
    mu_right: float = Field(default=0.0, ge=0.0, le=2.0)
    mu_after: float = Field(default=0.0, ge=0.0, le=2.0)
    mu_jump_at: float = Field(default=0.0, ge=0.0)
    mu_jump_length: float = Field(default=1.0, gt=0.0)
    bank: float = Field(default=0.0, ge=-0.5, le=0.5)
    grade: float = Field(default=0.0, ge=-0.5, le=0.5)
    turn_bank: float = Field(default=0.0, ge=0.0, le=0.5)
    bank_std: float = Field(default=0.0, ge=0.0, le=0.2)
    grade_std: float = Field(default=0.0, ge=0.0, le=0.2)
    mu_std: float = Field(default=0.0, ge=0.0, le=0.5)
    correlation_length: float = Field(default=40.0, ge=1.0)
    surfaces: tuple[Surface, ...] = ()

    @model_validator(mode="after")
    def _check_jump(self) -> Self:
        if (self.mu_after > 0.0) != (self.mu_jump_at > 0.0):
            raise ValueError("mu_after and mu_jump_at belong together: give both or neither")
        return self


class MagneticField(Configuration):
    """The Earth's magnetic field at the site and what disturbs it.

    Attributes
    ----------
    horizontal, vertical
        Flux density [T] to the north and upwards.
    pulse_rate
        Passing vehicles a second.
    pulse_low, pulse_high
        Range [T] of the amplitude of a pulse.
    pulse_shortest, pulse_longest
        Range [s] of its width.
    slow_std, slow_time
        Standard deviation [T] and correlation time [s] of slow noise on each axis.
    """

    horizontal: float = Field(default=1.58e-5, gt=0.0)
    vertical: float = -5.32e-5
    pulse_rate: float = Field(default=0.0, ge=0.0)
    pulse_low: float = Field(default=1.5e-6, ge=0.0)
    pulse_high: float = Field(default=8.0e-6, ge=0.0)
    pulse_shortest: float = Field(default=0.3, gt=0.0)
    pulse_longest: float = Field(default=1.2, gt=0.0)
    slow_std: float = Field(default=0.0, ge=0.0)
    slow_time: float = Field(default=2.0, gt=0.0)

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        if self.pulse_high < self.pulse_low:
            raise ValueError("pulse_high is below pulse_low")
        if self.pulse_longest < self.pulse_shortest:
            raise ValueError("pulse_longest is below pulse_shortest")
        return self


GROUND = np.dtype(
    [(name, np.float64) for name in ("mu", "mu_right", "mu_after", "mu_jump_at", "mu_jump_length")]
)
"""What the compiled loop knows of the road's friction."""


@dataclass(frozen=True)
class Ground:
    """The road of one run: its friction (one record of `GROUND`) and profiles (n, 3).

    The profiles hold bank and grade [rad] and the friction over that of the record.
    """

    friction: npt.NDArray[np.void]
    profile: npt.NDArray[np.float64]


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the random stream of a run that belongs to a name."""
    return np.random.default_rng(np.random.SeedSequence(entropy(seed, zlib.crc32(name.encode()))))


def lay_road(road: Road, curvature: npt.NDArray[np.float64], length: float, seed: int) -> Ground:
    """Return the road of one run.

    Parameters
    ----------
    road
        Its description.
    curvature
        Curvature [1/m] of the path every `SPACING`, may be empty.
    length
        Distance [m] that the vehicle may travel.
    seed
        Seed of the run.
    """
    points = int(length / SPACING) + 4
    profile = np.empty((points, 3))
    profile[:, 0] = road.bank + road.bank_std * smooth_noise(
        road.correlation_length, points, seed, "bank"
    )
    profile[:, 1] = road.grade + road.grade_std * smooth_noise(
        road.correlation_length, points, seed, "grade"
    )
    profile[:, 2] = 1.0
    if road.mu_std > 0.0:
        profile[:, 2] = np.exp(
            road.mu_std * smooth_noise(road.correlation_length, points, seed, "mu")
        )
    for surface in road.surfaces:
        first = round(surface.start / SPACING)
        profile[first : first + round(surface.length / SPACING), 2] *= surface.mu / road.mu
    if road.turn_bank > 0.0 and len(curvature):
        sharpest = np.abs(curvature).max()
        shared = min(points, len(curvature))
        profile[:shared, 0] -= road.turn_bank * curvature[:shared] / sharpest
    friction = np.zeros(1, GROUND)
    friction["mu"] = road.mu
    friction["mu_right"] = road.mu_right or road.mu
    friction["mu_after"] = road.mu_after
    friction["mu_jump_at"] = road.mu_jump_at
    friction["mu_jump_length"] = road.mu_jump_length
    return Ground(friction, profile)


def smooth_noise(length: float, points: int, seed: int, name: str) -> npt.NDArray[np.float64]:
    """Return Gaussian noise of unit variance whose autocorrelation falls to 1/e in the length [m].

    Shape (points,), one value every `SPACING`.
    """
    from scipy.ndimage import gaussian_filter1d  # slow to import, and few roads are random

    width = 0.5 * length / SPACING
    margin = math.ceil(4.0 * width)
    white = stream(seed, f"road.{name}").standard_normal(points + 2 * margin)
    # A Gaussian kernel of deviation w gives the autocorrelation exp(-(lag / 2 w)^2).
    smooth = gaussian_filter1d(white, width)[margin : margin + points]
    return np.asarray(smooth * math.sqrt(2.0 * math.sqrt(math.pi) * width))


def disturb_field(
    field: MagneticField, sample_time: float, samples: int, seed: int
) -> npt.NDArray[np.float64]:
    """Return what is added to the Earth's field in the vehicle's axes [T], shape (samples, 3)."""
    added = np.zeros((samples, 3))
    time = np.arange(samples) * sample_time
    draws = stream(seed, "magnetic.pulses")
    if field.pulse_rate > 0.0:
        at = draws.exponential(1.0 / field.pulse_rate)
        while at < time[-1]:
            amplitude = draws.uniform(field.pulse_low, field.pulse_high)
            width = draws.uniform(field.pulse_shortest, field.pulse_longest)
            main = draws.standard_normal(3)
            main /= np.linalg.norm(main)
            across = np.cross(main, draws.standard_normal(3))
            across /= np.linalg.norm(across)
            # The field of a dipole that passes: along its axis and along the way.
            along = (time - at) / (0.5 * width)
            decay = (1.0 + along**2) ** -2.5
            added += amplitude * np.outer((1.0 - 0.5 * along**2) * decay, main)
            added += amplitude * np.outer(1.5 * along * decay, across)
            at += draws.exponential(1.0 / field.pulse_rate)
    if field.slow_std > 0.0:
        from scipy.signal import lfilter  # slow to import: it brings scipy.stats

        keep = math.exp(-sample_time / field.slow_time)
        steps = stream(seed, "magnetic.slow").standard_normal((samples, 3))
        steps *= field.slow_std * math.sqrt(1.0 - keep * keep)
        steps[0] *= 1.0 / math.sqrt(1.0 - keep * keep)
        added += lfilter([1.0], [1.0, -keep], steps, axis=0)
    return added


@compiled
def feel_road(x, p, friction, profile, u):
    """Write the inputs `u` that the place on the road gives the state `x`: gravity, friction."""
    place = min(max(x[plant.DISTANCE] / SPACING, 0.0), profile.shape[0] - 2.000001)
    first = int(place)
    part = place - first
    bank_slope = profile[first + 1, 0] - profile[first, 0]
    grade_slope = profile[first + 1, 1] - profile[first, 1]
    surface = profile[first, 2] + part * (profile[first + 1, 2] - profile[first, 2])
    bank = profile[first, 0] + part * bank_slope
    grade = profile[first, 1] + part * grade_slope
    u[plant.BANK] = bank
    u[plant.GRADE] = grade
    u[plant.BANK_RATE] = bank_slope / SPACING * x[plant.V_X]
    u[plant.GRADE_RATE] = grade_slope / SPACING * x[plant.V_X]
    cos_bank = math.cos(bank)
    sin_bank = math.sin(bank)
    cos_grade = math.cos(grade)
    sin_grade = math.sin(grade)
    u[plant.GRAVITY_X] = GRAVITY * sin_grade
    u[plant.GRAVITY_Y] = -GRAVITY * cos_grade * sin_bank
    u[plant.YAW_GAIN] = 1.0 / (cos_grade * cos_bank)
    u[plant.YAW_OFFSET] = u[plant.GRADE_RATE] * sin_bank * u[plant.YAW_GAIN]
    # The road turns under the vehicle: a dip or a banked turn presses it onto its wheels.
    turning = u[plant.YAW_GAIN] * x[plant.YAW_RATE] + u[plant.YAW_OFFSET]
    rolling = u[plant.BANK_RATE] - turning * sin_grade
    pitching = u[plant.GRADE_RATE] * cos_bank + turning * cos_grade * sin_bank
    pressed = rolling * x[plant.V_Y] - pitching * x[plant.V_X]
    u[plant.NORMAL] = max(GRAVITY * cos_grade * cos_bank + pressed, 0.0)
    u[plant.ALONG_X] = cos_grade
    u[plant.ALONG_Y] = sin_grade * sin_bank
    u[plant.ACROSS_Y] = cos_bank
    cos_yaw = math.cos(x[plant.YAW])
    sin_yaw = math.sin(x[plant.YAW])
    for i in range(4):
        ahead = p.cg_to_front if i < 2 else -p.cg_to_rear
        aside = 0.5 * (p.track_front if i < 2 else p.track_rear)
        if i % 2 == 1:
            aside = -aside
        across = x[plant.Y] + sin_yaw * ahead + cos_yaw * aside
        mu = friction.mu if across >= 0.0 else friction.mu_right
        if friction.mu_jump_at > 0.0:
            along = x[plant.X] + cos_yaw * ahead - sin_yaw * aside
            reached = (along - friction.mu_jump_at) / friction.mu_jump_length
            mu += min(max(reached, 0.0), 1.0) * (friction.mu_after - mu)
        u[plant.MU + i] = mu * surface * (p.peak_front if i < 2 else p.peak_rear)
    plant.hold_stiffness(x, p, u)
