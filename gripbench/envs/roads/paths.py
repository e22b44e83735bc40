"""Paths that a driver follows: ISO 3888-1 double lane change, slalom, turns, public road.

A path is a table every `SPACING` metres: x, y, heading and curvature, in the axes of the track:
it starts at the origin along x. Turns to the left have positive curvature.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.configuration import Configuration
from gripbench.envs.roads.road import SPACING, stream

_FINE = 0.05  # spacing at which curvature is integrated to a path [m]
_MARGIN = 200.0  # straight on behind the end, for the driver's preview


class DoubleLaneChange(Configuration):
    """ISO 3888-1: lanes of 15, 25 and 15 m, 30 m and 25 m between them."""

    kind: Literal["double_lane_change"]
    lead_in: float = Field(default=6.0, gt=0.0, description="straight before it [s]")
    offset: float = Field(default=3.5, ge=-10.0, le=10.0, description="of the other lane [m]")


class Slalom(Configuration):
    """A sine in the plane; its amplitude grows over the first and fades over the last wave."""

    kind: Literal["slalom"]
    lead_in: float = Field(default=6.0, gt=0.0, description="straight before it [s]")
    amplitude: float = Field(ge=-20.0, le=20.0, description="first to the left [m]")
    wavelength: float = Field(ge=5.0, description="[m]")
    waves: int = Field(default=5, ge=1, le=100)


class Segment(Configuration):
    """A straight (`length`) or a turn (`radius`, `angle`, left positive; clothoid transitions)."""

    length: float = Field(default=0.0, ge=0.0, description="[m]")
    radius: float = Field(default=0.0, ge=0.0, description="[m]")
    angle: float = Field(default=0.0, ge=-100.0, le=100.0, description="[rad]")
    transition: float = Field(default=0.0, ge=0.0, description="length of each [m]")

    @model_validator(mode="after")
    def _check_geometry(self) -> Self:
        turn = self.radius > 0.0 and self.angle != 0.0
        if (self.length > 0.0) == turn or (not turn and (self.radius > 0.0 or self.angle != 0.0)):
            raise ValueError("give either 'length' or both 'radius' and 'angle'")
        if turn and self.radius < 2.0:
            raise ValueError(
                f"a radius of {self.radius:g} m is less than any car turns: 2 and above"
            )
        if turn and self.transition > abs(self.angle) * self.radius:
            raise ValueError(
                f"a transition of {self.transition:g} m does not fit into an arc of "
                f"{abs(self.angle) * self.radius:g} m"
            )
        return self


class Turns(Configuration):
    """Straights and turns, one after the other."""

    kind: Literal["turns"]
    segments: list[Segment] = Field(min_length=1)


class PublicRoad(Configuration):
    """Corners and straights that are drawn for each seed."""

    kind: Literal["public_road"]
    lead_in: float = Field(default=6.0, gt=0.0, description="straight before it [s]")
    corners: int = Field(default=7, ge=1, le=1000)
    angle_low: float = Field(default=math.radians(60.0), gt=0.0)
    angle_high: float = Field(default=math.radians(100.0), gt=0.0)
    radius_low: float = Field(default=27.0, gt=0.0)
    radius_high: float = Field(default=40.0, gt=0.0)
    straight_low: float = Field(default=40.0, ge=0.0)
    straight_high: float = Field(default=90.0, ge=0.0)
    transition: float = Field(default=8.0, ge=0.0)

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        for name in ("angle", "radius", "straight"):
            if getattr(self, f"{name}_high") < getattr(self, f"{name}_low"):
                raise ValueError(f"{name}_high is below {name}_low")
        if self.transition > self.angle_low * self.radius_low:
            raise ValueError(
                f"a transition of {self.transition:g} m does not fit into every corner"
            )
        return self


Path = Annotated[DoubleLaneChange | Slalom | Turns | PublicRoad, Field(discriminator="kind")]


def lay_path(path: Path, speed: float, seed: int) -> npt.NDArray[np.float64]:
    """Return the table of a path, shape (n, 4): x, y [m], heading [rad], curvature [1/m].

    Parameters
    ----------
    path
        Its description.
    speed
        Speed [m/s] that turns a lead-in of so many seconds into metres.
    seed
        Seed of the run; only a public road depends on it.
    """
    if isinstance(path, DoubleLaneChange):
        return _of_offsets(*_lane_change(path, speed * path.lead_in))
    if isinstance(path, Slalom):
        return _of_offsets(*_slalom(path, speed * path.lead_in))
    if isinstance(path, Turns):
        return _of_segments(path.segments)
    return _of_segments(_public_road(path, speed * path.lead_in, seed))


def _lane_change(
    path: DoubleLaneChange, start: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    x = np.arange(0.0, start + 125.0 + _MARGIN, 0.01)
    along = x - start
    there = _blend((along - 15.0) / 30.0)
    back = _blend((along - 70.0) / 25.0)
    return x, path.offset * (there - back)


def _slalom(path: Slalom, start: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    length = path.waves * path.wavelength
    x = np.arange(0.0, start + length + _MARGIN, 0.01)
    along = x - start
    window = _blend(2.0 * along / path.wavelength) * _blend(
        2.0 * (length - along) / path.wavelength
    )
    return x, path.amplitude * window * np.sin(2.0 * math.pi * along / path.wavelength)


def _blend(part: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Rise from 0 to 1 with continuous curvature."""
    t = np.clip(part, 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)


def _of_offsets(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    station = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    heading = np.unwrap(np.arctan2(np.gradient(y, x), 1.0))
    curvature = np.gradient(heading, station)
    at = np.arange(0.0, station[-1], SPACING)
    return np.column_stack([np.interp(at, station, c) for c in (x, y, heading, curvature)])


def _public_road(path: PublicRoad, start: float, seed: int) -> list[Segment]:
    draws = stream(seed, "public_road")
    segments = [Segment(length=start)]
    for _ in range(path.corners):
        side = 1.0 if draws.random() < 0.5 else -1.0
        segments += [
            Segment(length=draws.uniform(path.straight_low, path.straight_high)),
            Segment(
                radius=draws.uniform(path.radius_low, path.radius_high),
                angle=side * draws.uniform(path.angle_low, path.angle_high),
                transition=path.transition,
            ),
        ]
    return [*segments, Segment(length=path.straight_low)]


def _of_segments(segments: list[Segment]) -> npt.NDArray[np.float64]:
    knots = [(0.0, 0.0)]  # station and curvature, linear between
    for segment in segments:
        station = knots[-1][0]
        if segment.length > 0.0:
            knots.append((station + segment.length, 0.0))
        if segment.radius > 0.0 and segment.angle != 0.0:
            curvature = math.copysign(1.0 / segment.radius, segment.angle)
            arc = abs(segment.angle) * segment.radius - segment.transition
            ramp = max(segment.transition, 0.01)
            station = knots[-1][0]
            knots.append((station + ramp, curvature))
            knots.append((station + ramp + max(arc, 0.01), curvature))
            knots.append((station + 2.0 * ramp + max(arc, 0.01), 0.0))
    knots.append((knots[-1][0] + _MARGIN, 0.0))
    at = np.arange(0.0, knots[-1][0], _FINE)
    stations, curvatures = np.array(knots).T
    curvature = np.interp(at, stations, curvatures)
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * _FINE)])
    middle = 0.5 * (heading[1:] + heading[:-1])
    x = np.concatenate([[0.0], np.cumsum(np.cos(middle) * _FINE)])
    y = np.concatenate([[0.0], np.cumsum(np.sin(middle) * _FINE)])
    every = round(SPACING / _FINE)
    return np.column_stack([x, y, heading, curvature])[::every].copy()
