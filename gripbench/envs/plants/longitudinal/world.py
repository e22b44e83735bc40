"""The longitudinal world: scenarios of Li, Du & Li (2014) and their simulation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from gripbench.compilation import compiled
from gripbench.configuration import Configuration
from gripbench.envs.drivers.profiles import (
    Segment,
    breakpoints,
    check_range,
    profile_value,
    profile_values,
    segment_records,
)
from gripbench.envs.plants.longitudinal import integrators
from gripbench.envs.plants.longitudinal.paper_solver import (
    STOP_EVERY,
    fresh,
    paper_solver,
    set_inputs,
)
from gripbench.envs.plants.longitudinal.plant import (
    INPUT_TYPE,
    TYRE_TYPE,
    evaluate_tyres,
    gravity_along,
    plant_record,
    rates,
)
from gripbench.envs.plants.simulation import Action, Lanes, Simulation
from gripbench.envs.roads.road import SPACING, smooth_noise
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import record_type
from gripbench.envs.tyres.longitudinal import slip_ratio
from gripbench.envs.vehicles import CarOnRoad, Vehicle, on_road
from gripbench.errors import GripbenchError

PAPER_SOLVER = "paper"

_AT_ONCE = 20_000
"""Steps of the paper's solver after which the run can be stopped."""

_MOST_STEPS = 1_000_000
"""Steps of the paper's solver at most: a drive of the paper takes up to 28 000."""

_FULL_TORQUE = 5000.0
_LONGEST_ROAD = 2000.0  # of a rough road [m]
_FIRST_STEP = 1e-5  # of the integrator [s]; it then chooses its own
NOISE_BLOCK = 1024  # process noise is drawn ahead in blocks; the stream is the same for any size


class TorqueDriver(Configuration):
    """Torque [N m] on each axle over time; the rear axle follows the front unless given.

    Attributes
    ----------
    front, rear
        Torque profiles.
    slip_limit
        Slip ratio from which torque is reduced (traction control, anti-lock brakes), gone at twice
        of it; 0: never.
    """

    front: tuple[Segment, ...]
    rear: tuple[Segment, ...] | None = None
    slip_limit: float = Field(default=0.0, ge=0.0, le=0.5)

    @field_validator("front", "rear")
    @classmethod
    def _check_range(cls, torque: tuple[Segment, ...] | None) -> tuple[Segment, ...] | None:
        check_range(torque or (), -_FULL_TORQUE, _FULL_TORQUE)
        for before, after in pairwise(sorted(torque or (), key=lambda s: s.start)):
            if after.start < before.end:
                raise ValueError(f"pieces overlap at {after.start:g} s")
        return torque


class LongitudinalScenario(Scenario):
    """A scenario of straight driving, wheels lumped to axles.

    Attributes
    ----------
    initial_speed
        Speed at the start [m/s]; the wheels roll without slip.
    road_grade
        Inclination [rad], positive downhill.
    grade_std
        Standard deviation [rad] of smooth noise on it along the road.
    friction
        Friction coefficient over time, both axles.
    mu_std
        Standard deviation of smooth noise on its logarithm along the road.
    correlation_length
        Of the noise [m].
    tyre
        Shape of the tyres' force curve, see `gripbench.envs.tyres.combined`; the Magic Formula is
        the vehicle's own.
    wheel_speed_noise
        Process noise: relative standard deviation of the wheel speeds' jumps after each
        millisecond; 0 in the paper's solver, whose own error takes its place.
    driver
        Torque profiles.
    """

    world: Literal["longitudinal"]
    integrator: Literal["ros3", "rk4", "paper"] = "ros3"
    initial_speed: float = Field(default=1.0, ge=0.0, le=100.0)
    road_grade: float = Field(default=0.0, ge=-0.5, le=0.5)
    grade_std: float = Field(default=0.0, ge=0.0, le=0.2)
    friction: tuple[Segment, ...] = Field(min_length=1)
    mu_std: float = Field(default=0.0, ge=0.0, le=0.5)
    correlation_length: float = Field(default=40.0, ge=1.0)
    tyre: Literal["brush", "dugoff", "magic_formula", "fitted_curve"] = "magic_formula"
    wheel_speed_noise: float = Field(default=0.0, ge=0.0, le=0.1)
    driver: TorqueDriver

    @field_validator("friction")
    @classmethod
    def _check_range(cls, friction: tuple[Segment, ...]) -> tuple[Segment, ...]:
        check_range(friction, 0.01, 2.0)
        return friction

    @model_validator(mode="after")
    def _check_friction(self) -> Self:
        covered = 0.0
        for piece in sorted(self.friction, key=lambda s: s.start):
            if piece.start != covered:
                raise ValueError(f"friction has a gap or an overlap at {piece.start:g} s")
            covered = piece.end
        if covered < self.horizon:
            raise ValueError(f"friction ends at {covered:g} s, before the horizon")
        if self.integrator == PAPER_SOLVER and self.wheel_speed_noise > 0.0:
            raise ValueError("wheel_speed_noise has no meaning with the paper's solver")
        if self.integrator == PAPER_SOLVER and (self.driver.slip_limit or self.rough):
            raise ValueError(
                "mu_std, grade_std and driver.slip_limit need samples: set integrator = 'ros3'"
            )
        return self

    @property
    def rough(self) -> bool:
        """Whether friction or grade change along the road."""
        return self.mu_std > 0.0 or self.grade_std > 0.0

    def lay_road(self, seed: int) -> npt.NDArray[np.float64]:
        """Return friction over that of the profile and grade [rad] on top of `road_grade`.

        Shape (n, 2), every `SPACING` metres; beyond the end the last values hold.
        """
        if not self.rough:
            return np.array([[1.0, 0.0], [1.0, 0.0]])
        points = int(_LONGEST_ROAD / SPACING)
        road = np.empty((points, 2))
        length = self.correlation_length
        road[:, 0] = np.exp(self.mu_std * smooth_noise(length, points, seed, "mu"))
        road[:, 1] = self.grade_std * smooth_noise(length, points, seed, "grade")
        return road


TRUTH_TYPE = record_type(
    (
        "time",
        "speed_x",
        "wheel_speed_front",
        "wheel_speed_rear",
        "slip_ratio_front",
        "slip_ratio_rear",
        "force_x_front",
        "force_x_rear",
        "mu_front",
        "mu_rear",
        "utilisation",
        "torque_front",
        "torque_rear",
        "accel_x",
        "speed_x_rate",
        "wheel_acceleration_front",
        "wheel_acceleration_rear",
        "road_grade",
    )
)


@compiled
def _write_truth(time, x, inputs, plant, tyres, truth):
    force_front = inputs.mu_front * plant.load_front * tyres.front
    force_rear = inputs.mu_rear * plant.load_rear * tyres.rear
    gravity = gravity_along(inputs)
    speed_rate, front_rate, rear_rate = rates(
        x[0], x[1], x[2], force_front, force_rear, gravity, inputs, plant
    )
    truth.time = time
    truth.speed_x = x[0]
    truth.wheel_speed_front = x[1]
    truth.wheel_speed_rear = x[2]
    truth.slip_ratio_front = slip_ratio(plant.radius_front * x[1], x[0])
    truth.slip_ratio_rear = slip_ratio(plant.radius_rear * x[2], x[0])
    truth.force_x_front = force_front
    truth.force_x_rear = force_rear
    truth.mu_front = inputs.mu_front
    truth.mu_rear = inputs.mu_rear
    limit = inputs.mu_front * plant.load_front + inputs.mu_rear * plant.load_rear
    truth.utilisation = abs(force_front + force_rear) / limit
    truth.torque_front = inputs.torque_front
    truth.torque_rear = inputs.torque_rear
    truth.speed_x_rate = speed_rate
    truth.accel_x = speed_rate - gravity
    truth.wheel_acceleration_front = front_rate
    truth.wheel_acceleration_rear = rear_rate
    truth.road_grade = inputs.road_grade


@compiled
def advance_one(k, sample_time, x, step, inputs, plant, integrator, jumps, tyres, work, truth):
    """Advance from sample `k` to the next; `jumps` are the wheel speeds' relative jumps at it."""
    before = x[0]
    step = integrators.integrate(x, step, sample_time, inputs, plant, integrator, tyres, work)
    x[1] *= 1.0 + jumps[0]
    x[2] *= 1.0 + jumps[1]
    inputs.distance += 0.5 * (before + x[0]) * sample_time
    evaluate_tyres(x, plant, tyres)
    _write_truth((k + 1) * sample_time, x, inputs, plant, tyres, truth)
    return step


@compiled
def feel_road(inputs, road, grade, plant):
    """Apply what the place on the road and the tyres make of the friction profile; write grade.

    Parameters
    ----------
    inputs
        Record of `INPUT_TYPE` with the friction of the profile and the distance.
    road
        Friction over that of the profile and grade [rad] along the road, shape (n, 2).
    grade
        Road grade on which that comes on top [rad].
    plant
        Record of `PLANT_TYPE`.
    """
    place = min(max(inputs.distance / SPACING, 0.0), road.shape[0] - 1.000001)
    first = int(place)
    part = place - first
    surface = road[first, 0] + part * (road[first + 1, 0] - road[first, 0])
    inputs.mu_front = inputs.mu_front * surface * plant.peak_front
    inputs.mu_rear = inputs.mu_rear * surface * plant.peak_rear
    inputs.road_grade = grade + (road[first, 1] + part * (road[first + 1, 1] - road[first, 1]))


@compiled
def limited(torque, wheel_speed, speed, radius, slip_limit):
    """Return what traction control and anti-lock brakes leave of a torque [N m]."""
    if slip_limit <= 0.0:
        return torque
    slip = slip_ratio(radius * wheel_speed, speed)
    if torque < 0.0:
        slip = -slip
    return torque * min(max(2.0 - slip / slip_limit, 0.0), 1.0)


@compiled
def command(k, sample_time, friction, grade, road, plant, inputs):
    """Write the road that acts from sample `k` to the next: the profile at the interval's middle.

    A held mean is exact for a constant and second-order accurate for a slope; a jump of a profile
    that lies on a sample is met exactly.
    """
    mu = profile_value((k + 0.5) * sample_time, friction)
    inputs.mu_front = mu
    inputs.mu_rear = mu
    feel_road(inputs, road, grade, plant)


@compiled
def decide(k, sample_time, x, front, rear, slip_limit, plant, torques):
    """Write the driver's axle torques from sample `k` to the next [N m], shape (2,)."""
    middle = (k + 0.5) * sample_time
    for i, profile, radius in ((0, front, plant.radius_front), (1, rear, plant.radius_rear)):
        torques[i] = limited(profile_value(middle, profile), x[1 + i], x[0], radius, slip_limit)


@compiled
def _run(
    sample_time, x, step, inputs, plant, integrator, profiles, grade, road, slip_limit, jumps,
    tyres, work, truth,
):  # fmt: skip
    """Run to the end: the bytes of `decide`, `command` and `advance_one`, sample by sample."""
    count = truth.shape[0] - 1
    middles = (np.arange(count) + 0.5) * sample_time
    front = profile_values(middles, profiles[0])
    rear = profile_values(middles, profiles[1])
    friction = profile_values(middles, profiles[2])
    now = inputs[0]
    car = plant[0]
    for k in range(count):
        now.torque_front = limited(front[k], x[1], x[0], car.radius_front, slip_limit)
        now.torque_rear = limited(rear[k], x[2], x[0], car.radius_rear, slip_limit)
        now.mu_front = friction[k]
        now.mu_rear = friction[k]
        feel_road(now, road, grade, car)
        step = advance_one(
            k, sample_time, x, step, now, car, integrator, jumps[k], tyres[0], work, truth[k + 1]
        )


@compiled
def _sampled_truth(times, states, inputs, plant, profiles, grade, tyres, truth):
    front, rear, friction = profiles
    last = times[-1] - 1e-12  # profiles end at the horizon; its sample belongs to their inside
    for k in range(times.shape[0]):
        set_inputs(inputs[0], min(times[k], last), front, rear, friction, grade)
        evaluate_tyres(states[k], plant[0], tyres[0])
        _write_truth(times[k], states[k], inputs[0], plant[0], tyres[0], truth[k])


class LongitudinalSimulation(Simulation):
    """One run of a longitudinal scenario.

    Parameters
    ----------
    scenario
        What to run.
    vehicle
        The vehicle to run it with.
    """

    actions: ClassVar[tuple[Action, ...]] = (
        Action("torque_front", "N m", -_FULL_TORQUE, _FULL_TORQUE, "Torque on the front axle"),
        Action("torque_rear", "N m", -_FULL_TORQUE, _FULL_TORQUE, "Torque on the rear axle"),
    )
    truth_type = TRUTH_TYPE

    def __init__(self, scenario: LongitudinalScenario, vehicle: Vehicle | CarOnRoad) -> None:
        self.scenario = scenario
        self._road = scenario.lay_road(0)
        paper = scenario.integrator == PAPER_SOLVER
        self.sample_time = None if paper else scenario.sample_time
        self._integrator = -1 if paper else integrators.INTEGRATORS[scenario.integrator]
        self._plant = plant_record(on_road(vehicle), scenario.tyre)
        driver = scenario.driver
        rear = driver.front if driver.rear is None else driver.rear
        self._segments = (driver.front, rear, scenario.friction)
        self._profiles = tuple(segment_records(part) for part in self._segments)
        self._inputs = np.zeros(1, INPUT_TYPE)
        self._tyres = np.zeros(1, TYRE_TYPE)
        self._work = integrators.scratch()
        self._step = _FIRST_STEP
        self._start()

    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Start a run; return its first sample."""
        if self.sample_time is None:
            raise GripbenchError(
                f"{self.scenario.name}: the paper's solver chooses its own steps and cannot be "
                "advanced sample by sample; set integrator = 'ros3'"
            )
        self._start()
        self._jumps = _jump_stream(seed)
        self._road = self.scenario.lay_road(seed)
        self._pending = np.empty((0, 2))
        truth = np.zeros(1, TRUTH_TYPE)
        self._set_start_inputs()
        plant, tyres = self._plant[0], self._tyres[0]
        evaluate_tyres(self._x, plant, tyres)
        _write_truth(0.0, self._x, self._inputs[0], plant, tyres, truth[0])
        return truth

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the torques of the scenario's profiles for the next interval [N m]."""
        front, rear, _ = self._profiles
        torques = np.empty(2)
        decide(
            self._k, self.scenario.sample_time, self._x, front, rear,
            self.scenario.driver.slip_limit, self._plant[0], torques,
        )  # fmt: skip
        return torques

    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold the axle torques [N m] for one sample time; return the sample at its end."""
        sample_time = self.scenario.sample_time
        friction = self._profiles[2]
        inputs = self._inputs[0]
        plant = self._plant[0]
        command(self._k, sample_time, friction, self.scenario.road_grade, self._road, plant, inputs)
        inputs["torque_front"], inputs["torque_rear"] = action
        if len(self._pending) == 0:
            self._pending = self._draw(NOISE_BLOCK)
        truth = np.zeros(1, TRUTH_TYPE)
        self._step = advance_one(
            self._k,
            sample_time,
            self._x,
            self._step,
            inputs,
            plant,
            self._integrator,
            self._pending[0],
            self._tyres[0],
            self._work,
            truth[0],
        )
        self._pending = self._pending[1:]
        self._k += 1
        if not np.isfinite(self._x).all():
            self.termination = "diverged"
        return truth

    def run(self, seed: int) -> npt.NDArray[Any]:
        """Run to the horizon under the torque profiles; return the truth at every sample."""
        if self.sample_time is None:
            return self._run_paper_solver()
        first = self.reset(seed)
        truth = np.zeros(self.scenario.steps + 1, TRUTH_TYPE)
        truth[0] = first[0]
        _run(
            self.scenario.sample_time,
            self._x,
            self._step,
            self._inputs,
            self._plant,
            self._integrator,
            self._profiles,
            self.scenario.road_grade,
            self._road,
            self.scenario.driver.slip_limit,
            self._draw(self.scenario.steps),
            self._tyres,
            self._work,
            truth,
        )
        finite = np.isfinite(truth["speed_x"])
        if not finite.all():
            self.termination = "diverged"
            truth = truth[: int(finite.argmin())]
        return truth

    def notes(self) -> dict[str, float]:
        """Return the time [s] of the first friction step, if there is one."""
        steps = sorted(piece.start for piece in self.scenario.friction)[1:]
        return {"friction_step": steps[0]} if steps else {}

    @classmethod
    def together(cls, simulations: Sequence[LongitudinalSimulation]) -> Lanes:
        """Return runs that advance in one compiled call."""
        from gripbench.envs.plants.longitudinal.lanes import LongitudinalLanes

        return LongitudinalLanes(simulations)

    def _start(self) -> None:
        speed = self.scenario.initial_speed
        radii = [self._plant[f"radius_{axle}"][0] for axle in ("front", "rear")]
        self._x = np.array([speed, *(speed / radius for radius in radii)])
        self._step = _FIRST_STEP
        self._k = 0
        self.termination = ""

    def _set_start_inputs(self) -> None:
        """Set the inputs of the first sample: friction and grade, no torque yet."""
        _, _, friction = self._profiles
        nothing = friction[:0]
        set_inputs(self._inputs[0], 0.0, nothing, nothing, friction, self.scenario.road_grade)
        self._inputs["distance"] = 0.0
        feel_road(self._inputs[0], self._road, self.scenario.road_grade, self._plant[0])

    def _draw(self, n: int) -> npt.NDArray[np.float64]:
        deviation = self.scenario.wheel_speed_noise * np.sqrt(self.scenario.sample_time / 1e-3)
        if deviation == 0.0:
            return np.zeros((n, 2))
        return deviation * self._jumps.standard_normal((n, 2))

    def _run_paper_solver(self) -> npt.NDArray[Any]:
        self._start()
        scenario = self.scenario
        stops = {round(i * STOP_EVERY, 9) for i in range(1, int(scenario.horizon / STOP_EVERY) + 1)}
        stops |= set().union(*(breakpoints(part) for part in self._segments), {scenario.horizon})
        ordered = np.array(sorted(t for t in stops if 0.0 < t <= scenario.horizon))
        carry = fresh(self._x)
        times, states = [np.zeros(1)], [self._x[None].copy()]
        count = 1
        while carry["stop"][0] < len(ordered):
            some, reached = np.empty(_AT_ONCE), np.empty((_AT_ONCE, 3))
            written = paper_solver(
                self._x, carry, ordered, self._inputs, self._plant, *self._profiles,
                scenario.road_grade, some, reached,
            )  # fmt: skip
            times.append(some[:written])
            states.append(reached[:written])
            count += written
            if count > _MOST_STEPS or not written:
                raise GripbenchError(
                    f"{scenario.name}: the paper's solver came to {carry['time'][0]:.3g} of "
                    f"{scenario.horizon:g} s in {count} steps: this vehicle is too stiff for an "
                    "explicit method; choose the integrator 'ros3'"
                )
        truth = np.zeros(count, TRUTH_TYPE)
        _sampled_truth(
            np.concatenate(times),
            np.concatenate(states),
            self._inputs,
            self._plant,
            self._profiles,
            scenario.road_grade,
            self._tyres,
            truth,
        )
        return truth


def _jump_stream(seed: int) -> np.random.Generator:
    """Return the stream of the process noise: one of its own, apart from the sensors'."""
    return np.random.default_rng(np.random.SeedSequence([seed, 0x57484545]))
