"""A longitudinal scenario and a vehicle in; the truth of its runs out, sample by sample or whole.

The scenarios are those of Li, Du & Li (2014): straight driving, wheels lumped to axles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gripbench.envs.drivers.profiles import breakpoints, segment_records
from gripbench.envs.hidden_draws import entropy
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
    plant_record,
)
from gripbench.envs.plants.longitudinal.sampling import (
    TRUTH_TYPE,
    advance_one,
    command,
    decide,
    feel_road,
    run_profiles,
    sampled_truth,
    write_truth,
)
from gripbench.envs.plants.longitudinal.scenario import (
    FULL_TORQUE,
    PAPER_SOLVER,
    LongitudinalScenario,
)
from gripbench.envs.plants.simulation import Action, Lanes, Simulation
from gripbench.envs.vehicles import CarOnRoad, Vehicle, on_road
from gripbench.errors import GripbenchError

_AT_ONCE = 20_000
"""Steps of the paper's solver after which the run can be stopped."""

_MOST_STEPS = 1_000_000
"""Steps of the paper's solver at most: a drive of the paper takes up to 28 000."""

_FIRST_STEP = 1e-5  # of the integrator [s]; it then chooses its own
NOISE_BLOCK = 1024  # process noise is drawn ahead in blocks; the stream is the same for any size


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
        Action("torque_front", "N m", -FULL_TORQUE, FULL_TORQUE, "Torque on the front axle"),
        Action("torque_rear", "N m", -FULL_TORQUE, FULL_TORQUE, "Torque on the rear axle"),
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
        write_truth(0.0, self._x, self._inputs[0], plant, tyres, truth[0])
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
        run_profiles(
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
        sampled_truth(
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
    return np.random.default_rng(np.random.SeedSequence(entropy(seed, 0x57484545)))
