"""Drivers: one that follows a path and counter-steers on snow and ice, and open-loop steering.

The path driver looks at a point of the path ahead and asks for the lateral acceleration whose
circle leads there from the present direction of travel, not from the heading. It turns that into
a slip angle of the front tyres, no larger than they can use, and steers by it from the direction
in which the front axle moves. A sliding vehicle is therefore steered into the slide, which plain
pure pursuit (it steers from the heading) does not do: it spins.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from gripbench.compilation import compiled
from gripbench.configuration import Configuration
from gripbench.envs.plants.planar import plant
from gripbench.envs.roads.road import SPACING


class Driver(Configuration):
    """How the driver steers and holds the speed.

    Attributes
    ----------
    preview_time
        The point that the driver looks at is so many seconds ahead.
    slip_use
        Largest front slip angle that the driver asks for, over mu F_z / C.
    counter_steer
        Front slip angle for a slide of the rear axle beyond what the turn needs [-].
    yaw_damping
        Steering angle for an excess of yaw rate [s].
    reaction
        Time constant of the driver's arms [s].
    speed_gain
        Acceleration for an error of speed [1/s].
    accel_limit
        Largest acceleration and engine braking that the driver uses to hold the speed [m/s^2].
    brake_at
        Time from which the driver brakes [s]; 0: never.
    brake_deceleration
        What the driver then asks for [m/s^2].
    anti_lock_slip
        Slip ratio from which brake torque is released, gone at twice of it; 0: never.
    """

    preview_time: float = Field(default=0.8, gt=0.05, le=5.0)
    slip_use: float = Field(default=2.5, gt=0.0, le=20.0)
    counter_steer: float = Field(default=0.5, ge=0.0, le=10.0)
    yaw_damping: float = Field(default=0.1, ge=0.0, le=2.0)
    reaction: float = Field(default=0.08, gt=0.0, le=1.0)
    speed_gain: float = Field(default=0.6, ge=0.0, le=10.0)
    accel_limit: float = Field(default=0.5, ge=0.0, le=10.0)
    brake_at: float = Field(default=0.0, ge=0.0)
    brake_deceleration: float = Field(default=0.0, ge=0.0, le=15.0)
    anti_lock_slip: float = Field(default=0.0, ge=0.0, le=0.5)


class StepSteer(Configuration):
    """Steer to an angle and hold it."""

    kind: Literal["step_steer"]
    start: float = Field(default=2.0, ge=0.0, description="[s]")
    amplitude: float = Field(ge=-1.0, le=1.0, description="[rad]")
    rise: float = Field(default=0.2, gt=0.0, description="[s]")


class SineSteer(Configuration):
    """A sine of constant frequency; builds up over `build_up`, ends at `end` (0: never)."""

    kind: Literal["sine_steer"]
    start: float = Field(default=0.0, ge=0.0, description="[s]")
    amplitude: float = Field(ge=-1.0, le=1.0, description="[rad]")
    frequency: float = Field(gt=0.0, le=10.0, description="[Hz]")
    build_up: float = Field(default=2.0, gt=0.0, description="[s]")
    end: float = Field(default=0.0, ge=0.0, description="[s]")


class SquareSteer(Configuration):
    """A square wave with smoothed edges."""

    kind: Literal["square_steer"]
    start: float = Field(default=0.0, ge=0.0, description="[s]")
    amplitude: float = Field(ge=-1.0, le=1.0, description="[rad]")
    frequency: float = Field(gt=0.0, le=10.0, description="[Hz]")
    build_up: float = Field(default=2.0, gt=0.0, description="[s]")
    sharpness: float = Field(default=4.0, gt=0.0, le=100.0)


class SineThenSquareSteer(Configuration):
    """A sine until `change`, then a square wave with smoothed edges."""

    kind: Literal["sine_then_square_steer"]
    amplitude: float = Field(ge=-1.0, le=1.0, description="[rad]")
    sine_frequency: float = Field(default=0.4, gt=0.0, le=10.0, description="[Hz]")
    square_frequency: float = Field(default=0.2, gt=0.0, le=10.0, description="[Hz]")
    build_up: float = Field(default=2.0, gt=0.0, description="[s]")
    change: float = Field(default=18.0, gt=0.0, description="[s]")
    sharpness: float = Field(default=4.0, gt=0.0, le=100.0)


Steering = Annotated[
    StepSteer | SineSteer | SquareSteer | SineThenSquareSteer, Field(discriminator="kind")
]


def steering_angles(
    steering: Steering, time: npt.NDArray[np.floating[Any]]
) -> npt.NDArray[np.float64]:
    """Return the steering angle [rad] of an open-loop manoeuvre at the given times [s]."""
    if isinstance(steering, StepSteer):
        rise = np.clip((time - steering.start) / steering.rise, 0.0, 1.0)
        return np.asarray(steering.amplitude * rise**2 * (3.0 - 2.0 * rise))
    if isinstance(steering, SineThenSquareSteer):
        sine = np.sin(2.0 * math.pi * steering.sine_frequency * time)
        after = np.maximum(time - steering.change, 0.0)
        square = _square(2.0 * math.pi * steering.square_frequency * after, steering.sharpness)
        wave = np.where(time < steering.change, sine, square)
        return np.asarray(steering.amplitude * np.clip(time / steering.build_up, 0.0, 1.0) * wave)
    since = np.maximum(time - steering.start, 0.0)
    phase = 2.0 * math.pi * steering.frequency * since
    if isinstance(steering, SineSteer):
        wave = np.sin(phase)
        if steering.end > 0.0:
            wave = np.where(time < steering.end, wave, 0.0)
    else:
        wave = _square(phase, steering.sharpness)
    return np.asarray(steering.amplitude * np.clip(since / steering.build_up, 0.0, 1.0) * wave)


def _square(phase: npt.NDArray[np.floating[Any]], sharpness: float) -> npt.NDArray[np.float64]:
    return np.asarray(np.tanh(sharpness * np.sin(phase)) / math.tanh(sharpness))


DRIVER = np.dtype(
    [
        (name, np.float64)
        for name in (
            "preview_time",
            "slip_use",
            "counter_steer",
            "yaw_damping",
            "reaction",
            "speed_gain",
            "accel_limit",
            "brake_at",
            "brake_deceleration",
            "anti_lock_slip",
            "sample_time",
        )
    ]
)
"""What the compiled loop knows of the driver."""

INDEX, ARMS, OFFSET, ASTRAY, BEYOND, MEMORY = 0, 1, 2, 3, 4, 5


@compiled
def wrapped(angle):
    """Return an angle within -pi to pi."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@compiled
def find_on_path(x, path, memory):
    """Move the driver's place on the path forward to the point beside the vehicle."""
    last = path.shape[0] - 2
    i = int(memory[INDEX])
    while i < last:
        ahead_x = x[plant.X] - path[i + 1, 0]
        ahead_y = x[plant.Y] - path[i + 1, 1]
        if ahead_x * math.cos(path[i + 1, 2]) + ahead_y * math.sin(path[i + 1, 2]) < 0.0:
            break
        i += 1
    memory[INDEX] = i
    cos_path = math.cos(path[i, 2])
    sin_path = math.sin(path[i, 2])
    from_x = x[plant.X] - path[i, 0]
    from_y = x[plant.Y] - path[i, 1]
    memory[OFFSET] = cos_path * from_y - sin_path * from_x
    memory[BEYOND] = max(cos_path * from_x + sin_path * from_y, 0.0) if i == last else 0.0
    memory[ASTRAY] = wrapped(x[plant.YAW] - path[i, 2])


@compiled
def steer_along(x, u, p, driver, path, memory):
    """Return the steering angle that the path driver wants [rad]."""
    v_x = max(x[plant.V_X], 1.0)
    speed = math.hypot(v_x, x[plant.V_Y])
    ahead = max(speed * driver.preview_time, 2.0) / SPACING
    # Behind its end the path goes straight on.
    place = memory[INDEX] + ahead + memory[BEYOND] / SPACING
    j = min(int(place), path.shape[0] - 2)
    part = place - j
    target_x = path[j, 0] + part * (path[j + 1, 0] - path[j, 0]) - x[plant.X]
    target_y = path[j, 1] + part * (path[j + 1, 1] - path[j, 1]) - x[plant.Y]
    drift = math.atan2(x[plant.V_Y], v_x)
    aim = wrapped(math.atan2(target_y, target_x) - x[plant.YAW] - drift)
    curvature = 2.0 * math.sin(aim) / max(math.hypot(target_x, target_y), 1.0)
    mu = 0.5 * (u[plant.MU] + u[plant.MU + 1])
    grip = mu * u[plant.NORMAL]
    softness_front = p.mass_front / (2.0 * p.tyre_y_front)
    softness_rear = p.mass_rear / (2.0 * p.tyre_y_rear)
    # Bank pushes sideways too: the tyres carry it besides the wanted acceleration.
    wanted = curvature * speed * speed - u[plant.GRAVITY_Y]
    wanted = min(max(wanted, -grip), grip)
    slide = math.atan2(x[plant.V_Y] - p.cg_to_rear * x[plant.YAW_RATE], v_x)
    slip = softness_front * wanted + driver.counter_steer * (slide + softness_rear * wanted)
    largest = driver.slip_use * softness_front * grip
    slip = min(max(slip, -largest), largest)
    moving = math.atan2(x[plant.V_Y] + p.cg_to_front * x[plant.YAW_RATE], v_x)
    return moving + slip + driver.yaw_damping * (curvature * speed - x[plant.YAW_RATE])


@compiled
def command(time, x, u, p, driver, planned, path, memory, action):
    """Write the driver's next action: the steering angle to reach and four wheel torques.

    Parameters
    ----------
    time
        Time at the start of the sample [s].
    x, u, p
        State, inputs and parameters of the plant.
    driver
        Record of type `DRIVER`.
    planned
        Open-loop steering angle at the end of the sample [rad] and speed to hold [m/s], shape (2,).
    path
        Table of the path, empty for open-loop steering.
    memory
        The driver's memory, shape (MEMORY,).
    action
        Output, shape (5,).
    """
    if path.shape[0] > 0:
        find_on_path(x, path, memory)
        wanted = steer_along(x, u, p, driver, path, memory)
        memory[ARMS] += -math.expm1(-driver.sample_time / driver.reaction) * (wanted - memory[ARMS])
        memory[ARMS] = min(max(memory[ARMS], -p.steer_limit), p.steer_limit)
        action[0] = memory[ARMS]
    else:
        action[0] = planned[0]
    if driver.brake_at > 0.0 and time >= driver.brake_at:
        wheels_front = 0.5 * p.brake_share_front
        torque = -p.mass * driver.brake_deceleration * p.wheel_radius
    else:
        v_x = x[plant.V_X]
        wanted = driver.speed_gain * (planned[1] - v_x) - u[plant.GRAVITY_X]
        wanted = min(max(wanted, -driver.accel_limit), driver.accel_limit)
        held = p.drag * v_x * abs(v_x) + p.rolling_resistance * p.mass * u[plant.NORMAL]
        torque = (p.mass * wanted + held) * p.wheel_radius
        wheels_front = 0.5 * (p.drive_share_front if torque > 0.0 else p.brake_share_front)
    for i in range(4):
        share = wheels_front if i < 2 else 0.5 - wheels_front
        action[1 + i] = share * torque
        if driver.anti_lock_slip > 0.0 and torque < 0.0:
            rolling = p.wheel_radius * x[plant.WHEEL + i]
            slip = (x[plant.V_X] - rolling) / max(x[plant.V_X], 2.0)
            action[1 + i] *= min(max(2.0 - slip / driver.anti_lock_slip, 0.0), 1.0)
