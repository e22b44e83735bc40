"""State, driver and road of a sample in; state and truth of the next sample out, all compiled."""

from __future__ import annotations

import numpy as np

from gripbench.compilation import compiled
from gripbench.envs.drivers.profiles import profile_value, profile_values
from gripbench.envs.plants.longitudinal import integrators
from gripbench.envs.plants.longitudinal.paper_solver import set_inputs
from gripbench.envs.plants.longitudinal.plant import evaluate_tyres, gravity_along, rates
from gripbench.envs.roads.road import SPACING
from gripbench.envs.signals import record_type
from gripbench.envs.tyres.longitudinal import slip_ratio

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
def write_truth(time, x, inputs, plant, tyres, truth):
    """Write the sample of the state `x` at a time [s] into `truth`, a record of `TRUTH_TYPE`."""
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
    write_truth((k + 1) * sample_time, x, inputs, plant, tyres, truth)
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
def run_profiles(
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
def sampled_truth(times, states, inputs, plant, profiles, grade, tyres, truth):
    """Write the samples of given states, shape (n, 3), at their times [s], shape (n,)."""
    front, rear, friction = profiles
    last = times[-1] - 1e-12  # profiles end at the horizon; its sample belongs to their inside
    for k in range(times.shape[0]):
        set_inputs(inputs[0], min(times[k], last), front, rear, friction, grade)
        evaluate_tyres(states[k], plant[0], tyres[0])
        write_truth(times[k], states[k], inputs[0], plant[0], tyres[0], truth[k])
