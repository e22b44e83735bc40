"""Direct figures on the errata of Li, Du & Li (2014): one small computation each, one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.plants.longitudinal.plant import plant_record
from gripbench.envs.plants.longitudinal.scenario import LongitudinalScenario
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY, Vehicle, load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.extended_kalman_filter import ExtendedKalmanFilter
from gripbench.methods.proposed_observer import ProposedObserver

_Array = npt.NDArray[np.float64]


def with_parameter(vehicle: Vehicle, name: str, value: float) -> Vehicle:
    """Return a vehicle with another value of a parameter, possible or not."""
    given = vehicle.parameters[name].model_copy(update={"value": value})
    return vehicle.model_copy(update={"parameters": {**vehicle.parameters, name: given}})


def _rms(error: npt.NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def rolling_resistance() -> str:
    """Return what a vehicle with C_r = 1.5 does under the torque of the simple scenario."""
    scenario = load_scenario("constant_mu").model_copy(update={"wheel_speed_noise": 0.0})
    assert isinstance(scenario, LongitudinalScenario)
    vehicle = with_parameter(load_vehicle(scenario.vehicle), "rolling_resistance", 1.5)
    truth = LongitudinalSimulation(scenario, vehicle).run(0)
    moving = truth["time"][np.abs(truth["speed_x"]) > 0.05]
    return (
        f"decelerates by {1.5 * GRAVITY:.1f} m/s^2, stands after {moving[-1]:.2f} s "
        f"for the rest of the run"
    )


@compiled
def _printed_observer(times, torque, wheel_acceleration, accel, rolling, grade, car, sign, d, out):  # type: ignore[no-untyped-def]
    """Integrate eq. 24 with Sat(sign (v_hat - R w_f)) of width `d` by backward Euler."""
    mass, radius, inertia, drag, resistance, gain = car
    out[0] = rolling[0]
    for k in range(1, times.shape[0]):
        h = times[k] - times[k - 1]
        constant = GRAVITY * np.sin(grade[k]) - gain * accel[k]
        constant -= (1.0 + gain) * inertia * wheel_acceleration[k] / (mass * radius)
        constant -= (1.0 + gain) * resistance * GRAVITY
        before = out[k - 1]
        low, high = 0.0, 200.0
        v = before
        for _ in range(60):
            sat = max(-1.0, min(1.0, sign * (v - rolling[k]) / d))
            drive = torque[k] * sat / (mass * radius) - drag * v * v / mass
            rate = constant + (1.0 + gain) * drive
            # the first look, at the start, says on which side of it the estimate ends
            if v - before - h * rate > 0.0:
                high = v
            else:
                low = v
            v = 0.5 * (low + high)
        out[k] = v


def _velocity_error(run: Recording, sign: float, d: float) -> float:
    """Return the RMS error [m/s] of eq. 24 for a sign and a width of Sat's argument."""
    obs, car = run.observations, run.vehicle
    names = ("mass", "wheel_radius", "wheel_inertia", "drag", "rolling_resistance")
    speed = np.empty(len(obs))
    _printed_observer(
        obs["time"],
        obs["torque_front"] + obs["torque_rear"],
        obs["wheel_acceleration_front"] + obs["wheel_acceleration_rear"],
        obs["accel_x"],
        car["wheel_radius"] * obs["wheel_speed_front"],
        obs["road_grade"],
        (*(car[name] for name in names), 8e5),
        sign,
        d,
        speed,
    )
    return _rms(speed - run.truth["speed_x"])


def sat_argument(run: Recording) -> str:
    """Return the velocity errors of eq. 24 as printed, and with the argument turned round."""
    printed, turned = _velocity_error(run, 1.0, 0.1), _velocity_error(run, -1.0, 0.1)
    return f"velocity error {printed:.2f} m/s RMS; with the argument turned round {turned:.4f} m/s"


def sat_width(run: Recording) -> str:
    """Return the velocity errors of eq. 24 (argument corrected) for widths of Sat's line."""
    slip_speed = run.vehicle["wheel_radius"] * run.truth["wheel_speed_front"] - run.truth["speed_x"]
    driven = run.truth["torque_front"] > 0.0
    limit = ProposedObserver("paper").run(run.vehicle, run.observations)["speed_x"]
    errors = ", ".join(f"{_velocity_error(run, -1.0, d):.4f} at d = {d:g}" for d in (0.1, 1e-2))
    return (
        f"slip speed {np.mean(slip_speed[driven]):.3f} m/s; velocity error in m/s RMS: {errors}, "
        f"{_rms(limit - run.truth['speed_x']):.4f} for d to 0"
    )


def accelerometer_bias() -> str:
    """Return the shift of v_hat^2 that a bias of 0.1 m/s^2 makes, beside b m/D_a."""
    base = load_scenario("constant_mu")
    biased = base.model_copy(
        update={
            "initial_speed": 30.0,
            "wheel_speed_noise": 0.0,
            "sensors": {"accel_x": Sensor(bias=0.1)},
        }
    )
    run = record(biased, 0)
    speed = ProposedObserver("paper").run(run.vehicle, run.observations)["speed_x"]
    shift = np.median((run.truth["speed_x"] ** 2 - speed**2)[run.truth["time"] > 5.0])
    expected = 0.1 * run.vehicle["mass"] / run.vehicle["drag"]
    return f"v^2 too low by {shift:.1f} m^2/s^2 at a bias of 0.1 m/s^2; b m/D_a = {expected:.1f}"


def printed_stiffness_law(run: Recording) -> str:
    """Return how the error of Figure 19's law grows while the slip is negative."""
    weight = plant_record(run.vehicle)[0]
    share = weight["load_rear"] / weight["load_front"]
    slip = run.truth["slip_ratio_front"] + share * run.truth["slip_ratio_rear"]
    elapsed = np.diff(run.truth["time"], prepend=0.0)
    negative = slip < 0.0
    growth = 8e4 * np.sum((-slip * elapsed)[negative]) / np.log(10.0)
    return (
        f"slip is negative for {np.sum(elapsed[negative]):.1f} s, in which the error of k grows "
        f"by a factor of 10^{growth:.0f}"
    )


def tyre_slope() -> str:
    """Return the slope of the Magic Formula of a front tyre beside C_s."""
    car = load_vehicle("li2014").values()
    slope = car["magic_b"] * car["magic_c"] * 0.9 * plant_record(car)["load_front"][0]
    return f"Magic Formula, one front tyre, friction 0.9: {slope / 2.0:.0f} N; C_s is 50000 N"


def friction_map() -> str:
    """Return what the printed map makes of the tyre's own slope."""
    car = load_vehicle("li2014").values()
    slope = car["magic_b"] * car["magic_c"]
    read = {mu: 0.03 * slope * mu + 0.1 for mu in (0.9, 0.5)}
    return ", ".join(f"reads {value:.3f} at friction {mu:g}" for mu, value in read.items())


def open_loop_speed(run: Recording) -> str:
    """Return the error of the filter's own velocity, which no measurement of eq. 20 corrects."""
    estimates = ExtendedKalmanFilter("paper").run(run.vehicle, run.observations)
    force = estimates["force_x_front"] + estimates["force_x_rear"]
    elapsed = np.diff(run.truth["time"], prepend=0.0)
    speed = run.truth["speed_x"][0] + np.cumsum(elapsed * force) / run.vehicle["mass"]
    slip_speed = run.vehicle["wheel_radius"] * run.truth["wheel_speed_front"] - run.truth["speed_x"]
    return (
        f"velocity error {_rms(speed - run.truth['speed_x']):.2f} m/s RMS, where the slip speed "
        f"is {_rms(slip_speed):.3f} m/s"
    )


def single_seeds(run_of: Any, seeds: int, chosen: ProposedObserver) -> str:
    """Return median and range over single seeds of the friction error in the noisy row."""
    values = []
    for seed in range(seeds):
        run = run_of(seed)
        estimates = chosen.run(run.vehicle, run.observations)
        values.append(_rms(estimates["mu_front"] - run.truth["mu_front"]))
    return (
        f"friction error pooled {np.sqrt(np.mean(np.square(values))):.3f}; single seeds: median "
        f"{np.median(values):.3f}, {min(values):.3f} to {max(values):.3f}; published 1.905"
    )


def solver_error(run: Recording) -> str:
    """Return the spurious front force of the paper's solver against the accurate integrator."""
    scenario = load_scenario("constant_mu").model_copy(update={"wheel_speed_noise": 0.0})
    exact = record(scenario, 0).truth
    force = np.interp(run.truth["time"], exact["time"], exact["force_x_front"])
    held = (run.truth["time"] > 1.5) & (run.truth["time"] < 19.9)
    error = (run.truth["force_x_front"] - force)[held]
    return f"the solver's front force is off by {np.mean(error):.0f} +/- {np.std(error):.0f} N"


def early_error(run: Recording) -> str:
    """Return how much of the proposed observer's friction error lies in the first half second."""
    estimates = ProposedObserver("paper").run(run.vehicle, run.observations)
    early = run.truth["time"] < 0.5
    squares = np.square(estimates["mu_front"] - run.truth["mu_front"])
    speed = estimates["speed_x"] - run.truth["speed_x"]
    slip_speed = run.vehicle["wheel_radius"] * run.truth["wheel_speed_front"] - run.truth["speed_x"]
    return (
        f"{100.0 * np.sum(squares[early]) / np.sum(squares):.0f} % of the squared error lies in "
        f"the first 0.5 s: velocity off by {np.mean(speed[early]):.5f} m/s at a slip speed of "
        f"{np.mean(slip_speed[early]):.5f} m/s"
    )
