"""Identify a vehicle from a log: tyres, steering and what they are worth on unseen time.

With a reference of the lateral velocity the forces of both axles follow from acceleration and
yaw acceleration, and the axles' slip angles from the velocity; brush tyres are fitted to them.
Without one, steering ratio, offset and understeer gradient follow from steady cornering,
`steer = offset + ratio (L r / v + K v r / g)`.

Standard deviations come from residuals that are correlated in time: samples closer together than
`CORRELATION` count as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY
from gripbench.errors import InputError
from gripbench.logs.channels.derivation import slope
from gripbench.logs.vehicle.brush_fit import brush_force, covariance, slip_angles

CORRELATION = 0.2
"""Time [s] over which residuals are taken for correlated."""

LOOSE = 0.2
"""Relative standard deviation above which a parameter counts as undetermined."""

_MOST_GRIP = 1.5
_MU = 2  # its place among the parameters
_MAY_BE_ZERO = ("steer_offset", "understeer_gradient")
_SLOWEST = 0.8  # m/s; below, slip angles are noise
_SMOOTHING = 0.1  # s, of the steering and yaw acceleration

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Identified:
    """Parameters found on one part of a log and tried on another.

    Attributes
    ----------
    values, deviations
        Parameters by name and their standard deviations, SI units; stiffnesses are those of an
        axle over the vehicle's mass [N/rad/kg].
    train_rms, test_rms
        RMS of what the model does not explain, on the training and on the test windows; the
        latter is None where there is no test window.
    unit
        Unit of these.
    samples
        Samples of the training windows.
    reached
        Largest mean of |a_y|/g over half a second of them: no less is the friction; None where it
        was not looked at.
    linear
        Whether the tyres stay linear, so that the friction is not to be found: stiffnesses are
        those of linear tyres.
    """

    values: dict[str, float]
    deviations: dict[str, float]
    train_rms: float
    test_rms: float | None
    unit: str
    samples: int
    reached: float | None = None
    linear: bool = False

    def undetermined(self) -> str | None:
        """Return a sentence on what the log cannot tell, None where it tells everything.

        A parameter that cannot be zero, such as a stiffness or a ratio, counts as undetermined
        where its standard deviation is above a fifth of it.
        """
        loose = [
            f"{name} ({value:.3g} with a standard deviation of {self.deviations[name]:.2g})"
            for name, value in self.values.items()
            if name not in _MAY_BE_ZERO and self.deviations[name] > LOOSE * abs(value)
        ]
        mu = self.values.get("mu")
        if self.linear:
            loose.append(
                f"mu (the tyres stay linear up to the |a_y|/g of {self.reached or 0.0:.3g} that "
                "the training windows hold for half a second)"
            )
        if mu is not None and self.reached is not None and mu < self.reached:
            loose.append(
                f"mu ({mu:.3g} is below the |a_y|/g of {self.reached:.3g} that the training "
                "windows hold for half a second, so only that bound is known: fix the friction)"
            )
        return f"undetermined by this log: {', '.join(loose)}" if loose else None


def identify_tyres(
    recordings: Sequence[Recording], steering: bool = True, friction: float | None = None
) -> Identified:
    """Fit brush tyres, friction, yaw inertia and steering to a log with a velocity reference.

    Parameters
    ----------
    recordings
        Runs with `speed_x`, `yaw_rate` and `accel_y` in their truth or, without a reference of
        them, in their observations, with `speed_y` or `sideslip` in their truth and `steer_angle`
        in their observations; the window `train` is fitted, `test` only judged.
    steering
        Whether scale and offset of the steering are fitted too.
    friction
        Friction that is taken as known, for a log in which the tyres never reach their limit;
        None: it is fitted.

    Raises
    ------
    InputError
        If a signal or the geometry is missing, or the training windows hold too little.
    """
    needed = ("speed_x", "speed_y", "yaw_rate", "accel_y")
    _require(recordings, (*needed, "steer_angle"))
    train = _axles(recordings, "train", needed)
    if train is None or train.forward.size < 100:
        raise InputError("identification: the windows 'train' hold fewer than 100 samples")
    test = _axles(recordings, "test", needed)
    names = ("stiffness_front", "stiffness_rear", "mu", "gyration_squared", "steer_scale",
             "steer_offset")  # fmt: skip
    grip = 0.5 if friction is None else friction
    first = np.array([30.0, 30.0, grip, train.front * train.rear, 1.0, 0.0])
    # A steering angle that never changes cannot tell its scale from the front stiffness.
    varied = steering and float(np.std(train.steer)) > np.deg2rad(1.0)
    free = np.array([True, True, friction is None, True, varied, varied])
    low = np.array([1.0, 1.0, 0.05, 0.05 * first[3], 0.5, -0.2])
    high = np.array([500.0, 500.0, _MOST_GRIP, 5.0 * first[3], 2.0, 0.2])

    def whole(part: Floats) -> Floats:
        full = first.copy()
        full[free] = part
        return full

    def misfit(part: Floats) -> Floats:
        return _axle_residuals(whole(part), train)

    def fitted() -> Any:
        return least_squares(
            misfit,
            first[free],
            bounds=(low[free], high[free]),
            x_scale=np.maximum(np.abs(first[free]), 0.01),
            loss="soft_l1",
            f_scale=0.5,
        )

    fit = fitted()
    linear = friction is None and bool(whole(fit.x)[_MU] > 0.99 * _MOST_GRIP)
    if linear:  # any friction would bend the curve and take its stiffness for too large
        first[_MU], free[_MU] = np.inf, False
        fit = fitted()
    found = whole(fit.x)
    residuals = _axle_residuals(found, train)
    spread = _deviations(np.asarray(fit.jac), residuals, train.correlated)
    deviations = dict(zip(np.array(names)[free], spread, strict=True))
    return Identified(
        values={str(n): float(v) for n, v, f in zip(names, found, free, strict=True) if f},
        deviations={str(name): float(value) for name, value in deviations.items()},
        train_rms=float(np.sqrt(np.mean(residuals**2))),
        test_rms=None
        if test is None
        else float(np.sqrt(np.mean(_axle_residuals(found, test) ** 2))),
        unit="m/s^2",
        samples=train.forward.size,
        reached=_held_for(np.abs(train.lateral) / GRAVITY, train.correlated),
        linear=linear,
    )


def identify_steering(recordings: Sequence[Recording], known_scale: float = 1.0) -> Identified:
    """Fit steering ratio, offset and understeer gradient to steady cornering.

    Parameters
    ----------
    recordings
        Runs whose observations have `steer_angle`, `yaw_rate` and a speed.
    known_scale
        Scale that the map has applied to the steering column; the ratio found belongs to the
        column itself.

    Raises
    ------
    InputError
        If a channel or the wheelbase is missing, or the training windows hold too little.
    """
    _require(recordings, ("steer_angle", "yaw_rate", "speed_x"))
    parts = {name: _steady(recordings, name) for name in ("train", "test")}
    train, test = parts["train"], parts["test"]
    if train is None or len(train[0]) < 50:
        raise InputError("identification: the windows 'train' hold fewer than 50 steady samples")
    steer, design = train[0] / known_scale, train[1]
    solution, *_ = np.linalg.lstsq(design, steer, rcond=None)
    residuals = steer - design @ solution
    spread = _deviations(design, residuals, train[2])
    offset, ratio, product = (float(value) for value in solution)
    gradient = product / ratio
    of_gradient = abs(gradient) * np.hypot(spread[1] / ratio, spread[2] / product)
    rms = None
    if test is not None and len(test[0]):
        rms = float(np.sqrt(np.mean((test[0] / known_scale - test[1] @ solution) ** 2)))
    return Identified(
        values={"steering_ratio": ratio, "steer_offset": offset, "understeer_gradient": gradient},
        deviations={
            "steering_ratio": float(spread[1]),
            "steer_offset": float(spread[0]),
            "understeer_gradient": float(of_gradient),
        },
        train_rms=float(np.sqrt(np.mean(residuals**2))),
        test_rms=rms,
        unit="rad at the steering wheel",
        samples=len(steer),
    )


def with_velocity(recordings: Sequence[Recording]) -> bool:
    """Return whether a reference tells the lateral velocity, so that tyres can be identified."""
    return bool({"speed_y", "sideslip"} & set(recordings[0].truth.dtype.names or ()))


@dataclass(frozen=True)
class _Axles:
    """Samples of the training or test windows, and the geometry."""

    forward: Floats
    left: Floats
    turn: Floats
    turn_rate: Floats
    lateral: Floats
    steer: Floats
    front: float
    rear: float
    correlated: float  # samples that count as one


def _axles(recordings: Sequence[Recording], window: str, needed: tuple[str, ...]) -> _Axles | None:
    columns: list[Floats] = []
    spacing = []
    for recording in recordings:
        truth, seen = recording.truth, recording.observations
        known = {name: signal_of(recording, name) for name in needed}
        kept = inside(recording, window)
        for values in known.values():
            kept &= np.isfinite(values)
        kept &= np.nan_to_num(known["speed_x"]) > _SLOWEST
        if kept.sum() < 3:
            continue
        time = np.ascontiguousarray(truth["time"])
        turn = np.nan_to_num(np.ascontiguousarray(known["yaw_rate"]))
        turning = slope(time, turn, _SMOOTHING)
        columns.append(
            np.array(
                [*(known[name][kept] for name in needed), turning[kept],
                 seen["steer_angle"][kept]]
            )
        )  # fmt: skip
        spacing.append(float(np.median(np.diff(time))))
    if not columns:
        return None
    forward, left, turn, lateral, turn_rate, steer = np.concatenate(columns, axis=1)
    vehicle = recordings[0].vehicle
    return _Axles(
        forward, left, turn, turn_rate, lateral, steer, vehicle["cg_to_front"],
        vehicle["cg_to_rear"], max(1.0, CORRELATION / float(np.median(spacing))),
    )  # fmt: skip


def _held_for(used: Floats, correlated: float) -> float:
    """Return the largest mean over half a second."""
    wide = max(1, round(correlated * 0.5 / CORRELATION))
    return float(np.convolve(used, np.ones(wide) / wide, mode="valid").max())


def _axle_residuals(parameters: Floats, axles: _Axles) -> Floats:
    """Return force over mass [m/s^2] that is not explained, front then rear."""
    front_stiffness, rear_stiffness, mu, gyration, scale, offset = parameters
    wheelbase = axles.front + axles.rear
    steer = scale * axles.steer + offset
    slip_front, slip_rear = slip_angles(
        axles.forward, axles.left, axles.turn, steer, axles.front, axles.rear
    )
    moment = gyration * axles.turn_rate
    of_front = (axles.lateral * axles.rear + moment) / wheelbase
    of_rear = (axles.lateral * axles.front - moment) / wheelbase
    grip = mu * GRAVITY / wheelbase
    front = brush_force(slip_front, front_stiffness, grip * axles.rear) * np.cos(steer)
    rear = brush_force(slip_rear, rear_stiffness, grip * axles.front)
    return np.concatenate([of_front - front, of_rear - rear])


def _steady(recordings: Sequence[Recording], window: str) -> tuple[Floats, Floats, float] | None:
    steers, rows, spacing = [], [], []
    for recording in recordings:
        seen = recording.observations
        time = np.ascontiguousarray(seen["time"])
        wide = max(3, round(0.5 / float(np.median(np.diff(time)))))
        kernel = np.ones(wide) / wide
        smooth = {
            name: np.convolve(np.nan_to_num(signal_of(recording, name)), kernel, mode="same")
            for name in ("steer_angle", "yaw_rate", "speed_x")
        }
        kept = inside(recording, window) & (smooth["speed_x"] > 3.0)
        kept[:wide] = kept[-wide:] = False  # the mean is cut short at the ends
        speed, turn = smooth["speed_x"][kept], smooth["yaw_rate"][kept]
        wheelbase = recording.vehicle["cg_to_front"] + recording.vehicle["cg_to_rear"]
        ones = np.ones_like(speed)
        rows.append(np.array([ones, wheelbase * turn / speed, speed * turn / GRAVITY]).T)
        steers.append(smooth["steer_angle"][kept])
        spacing.append(float(np.median(np.diff(time))))
    steer = np.concatenate(steers)
    if not steer.size:
        return None
    # The mean over half a second makes that long a stretch one sample.
    return steer, np.concatenate(rows), max(1.0, 0.5 / float(np.median(spacing)))


def inside(recording: Recording, window: str) -> npt.NDArray[Any]:
    """Return which rows lie in a window, shape (n,)."""
    time = recording.truth["time"]
    within = np.zeros(len(time), dtype=bool)
    for start, end in recording.windows.get(window, ()):
        within |= (time >= start) & (time <= end)
    return within


_INSTEAD = {"speed_x": ("speed_x", "speed_gps"), "steer_angle": ("steer_angle",)}
"""Channels that stand for a signal without a reference, the best first."""


def signal_of(recording: Recording, name: str) -> Floats:
    """Return a signal, shape (n,): the reference's, else a sensor's, else from the sideslip.

    Without any, it is empty.
    """
    truth, seen = recording.truth.dtype.names or (), recording.observations.dtype.names or ()
    if name in truth and name != "steer_angle":
        return np.ascontiguousarray(recording.truth[name])
    if name == "speed_y":
        if "sideslip" not in truth or not len(signal_of(recording, "speed_x")):
            return np.empty(0)
        return signal_of(recording, "speed_x") * np.tan(recording.truth["sideslip"])
    for channel in _INSTEAD.get(name, (name,)):
        if channel in seen:
            return np.ascontiguousarray(recording.observations[channel])
    return np.empty(0)


def _require(recordings: Sequence[Recording], names: tuple[str, ...]) -> None:
    """Name all that is missing at once."""
    first = recordings[0]
    where = {"speed_x": "speed_x or speed_gps", "speed_y": "speed_y or sideslip in the reference"}
    lacking = [
        f"'{where.get(name, name)}'"
        for name in names
        if any(not len(signal_of(recording, name)) for recording in recordings)
    ]
    paper = [name for name in ("cg_to_front", "cg_to_rear") if name not in first.vehicle]
    said = [f"the recording has no {', '.join(lacking)}"] if lacking else []
    said += [f"the vehicle gives no {' and no '.join(paper)}"] if paper else []
    if not any(recording.windows.get("train") for recording in recordings):
        said.append("the map has no window 'train'")
    if said:
        raise InputError(f"{first.scenario}: nothing to identify from: {'; '.join(said)}")


def _deviations(jacobian: Floats, residuals: Floats, correlated: float) -> Floats:
    """Return standard deviations of a least-squares solution, residuals correlated in time."""
    found = covariance(jacobian, float(np.mean(residuals**2)), correlated)
    return np.sqrt(np.diag(found))
